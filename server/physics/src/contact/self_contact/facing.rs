//! Which triangles the skin at a vertex faces.
use super::rest::{FACING, SelfContact, twice_area_m2};
use glam::DVec3;

/// Most triangles around a vertex whose areas are kept; vertices of hearts have five to eight.
const MOST: usize = 16;

/// The triangles around a vertex. They are asked about many others, so their areas are computed once.
pub(super) struct OwnTriangles<'a> {
    /// Twice their area vectors (m²), and the lengths of these.
    areas: [(DVec3, f64); MOST],
    count: usize,
    /// Those for which there was no room.
    others: &'a [u32],
    walls: &'a SelfContact,
    x: &'a [DVec3],
}

impl SelfContact {
    /// Returns the triangles around a vertex, with nodes at `x` (m).
    pub(super) fn own_triangles<'a>(&'a self, node: u32, x: &'a [DVec3]) -> OwnTriangles<'a> {
        let around = self.around.row(node as usize);
        let (kept, others) = around.split_at(around.len().min(MOST));
        let mut areas = [(DVec3::ZERO, 0.0); MOST];
        for (area, &triangle) in areas.iter_mut().zip(kept) {
            *area = self.area_m2(triangle, x);
        }
        OwnTriangles { areas, count: kept.len(), others, walls: self, x }
    }

    fn area_m2(&self, triangle: u32, x: &[DVec3]) -> (DVec3, f64) {
        let area = twice_area_m2(self.triangles.corners(triangle as usize, x));
        (area, area.length())
    }
}

impl OwnTriangles<'_> {
    /// Returns whether any of them faces a triangle with this normal.
    pub(super) fn face(&self, normal: DVec3) -> bool {
        let faces = |(area, length): (DVec3, f64)| -area.dot(normal) > FACING * length;
        self.areas[..self.count].iter().copied().any(faces)
            || self.others.iter().any(|&triangle| faces(self.walls.area_m2(triangle, self.x)))
    }
}
