//! The anchors of the particles that carry the skin. They are asked for vertex by vertex, eight at a time; to find one
//! takes four times as long as to use it.
use super::{
    composite::Anchor,
    partition::{NONE, Partition},
    trilinear_point::CellPoint,
};

/// Anchors of the particles in cells with vertices of the skin.
#[derive(Debug, Clone, Default)]
pub(super) struct SkinAnchors {
    /// Number of every particle among these, [`NONE`] for others.
    number_of: Vec<u32>,
    anchors: Vec<Anchor>,
}

impl SkinAnchors {
    pub(super) fn new(partition: &Partition, vertices: &[CellPoint]) -> Self {
        let mut found = Self { number_of: vec![NONE; partition.particle_count()], anchors: Vec::new() };
        for particle in vertices.iter().flat_map(|point| partition.corners(point.cell as usize)) {
            let number = &mut found.number_of[particle as usize];
            if *number == NONE {
                *number = found.anchors.len() as u32;
                found.anchors.push(partition.anchor(particle));
            }
        }
        found
    }

    /// Returns the anchor of a particle that is in a cell with a vertex of the skin.
    pub(super) fn of(&self, particle: u32) -> &Anchor {
        &self.anchors[self.number_of[particle as usize] as usize]
    }
}
