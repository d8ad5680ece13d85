//! The fine surface of a hybrid body: closed, its edges no longer than the spacing of the lattice, its parts named as the body's.
//!
//! Shapes with a curved surface are triangulated anew on it, without the tets inside; everything else keeps its triangles, whose long edges
//! are halved.
mod refine;

pub(crate) use refine::refine;

use glam::DVec3;

/// A surface with what each of its triangles came from.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FineSurface {
    /// Vertices (m).
    pub(crate) positions_m: Vec<DVec3>,
    /// Triangles as vertex indices, counter-clockwise seen from outside.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// What each triangle came from: a triangle before refinement, or a region of a shape.
    pub(crate) origins: Vec<u32>,
}

impl FineSurface {
    /// Without vertices that no triangle has.
    pub(crate) fn compact(mut self) -> Self {
        let mut is_used = vec![false; self.positions_m.len()];
        self.triangles.iter().flatten().for_each(|&vertex| is_used[vertex as usize] = true);
        let mut number = Vec::with_capacity(is_used.len());
        let mut used = 0;
        for is_used in &is_used {
            number.push(used);
            used += u32::from(*is_used);
        }
        let mut keep = is_used.iter();
        self.positions_m.retain(|_| keep.next() == Some(&true));
        self.triangles.iter_mut().flatten().for_each(|vertex| *vertex = number[*vertex as usize]);
        self
    }

    /// The triangles that came from something wanted.
    pub(crate) fn triangles_from(&self, wanted: impl Fn(u32) -> bool) -> Vec<u32> {
        let from = self.origins.iter().zip(0..).filter(|(origin, _)| wanted(**origin));
        from.map(|(_, triangle)| triangle).collect()
    }
}
