//! What carries the skin's vertices at rest: their particles, and those particles' anchors. To find these takes several
//! times as long as to use them, and self-contact asks for every vertex.
use super::{
    composite::Anchor,
    partition::{NONE, Partition},
    trilinear_point::CellPoint,
};

/// The particles that carry the skin.
#[derive(Debug, Clone, Default)]
pub(super) struct SkinCarriers {
    /// Index in `carriers` of the first entry of each vertex, and the end of the last.
    first: Vec<u32>,
    /// Particles with their weights, of which none is zero.
    carriers: Vec<(u32, f64)>,
    /// Number in `anchors` of every particle, [`NONE`] of those that carry no vertex.
    number_of: Vec<u32>,
    anchors: Vec<Anchor>,
}

impl SkinCarriers {
    pub(super) fn new(partition: &Partition, vertices: &[CellPoint]) -> Self {
        let mut found = Self { first: vec![0], number_of: vec![NONE; partition.particle_count()], ..Self::default() };
        for point in vertices {
            let particles = partition.corners(point.cell as usize);
            for (particle, weight) in particles.into_iter().zip(point.weights(partition)).filter(|(_, w)| *w != 0.0) {
                found.carriers.push((particle, weight));
                let number = &mut found.number_of[particle as usize];
                if *number == NONE {
                    *number = found.anchors.len() as u32;
                    found.anchors.push(partition.anchor(particle));
                }
            }
            found.first.push(found.carriers.len() as u32);
        }
        found
    }

    /// Returns the particles that carry a vertex, with their weights: 1 to 8, of which none is zero.
    pub(super) fn of_vertex(&self, vertex: u32) -> &[(u32, f64)] {
        let at = vertex as usize;
        &self.carriers[self.first[at] as usize..self.first[at + 1] as usize]
    }

    /// Returns a bound of the speed of any vertex over that of the fastest node or particle:
    /// `max_v Σ_p |w_vp| max(1, Σ_i |ζ_pi|)`.
    pub(super) fn amplification(&self) -> f64 {
        let of_particle = |particle: u32| self.anchor(particle).weights.iter().map(|w| w.abs()).sum::<f64>().max(1.0);
        let of_vertex =
            |vertex: u32| self.of_vertex(vertex).iter().map(|(p, w)| w.abs() * of_particle(*p)).sum::<f64>();
        (0..self.first.len() as u32 - 1).map(of_vertex).fold(1.0, f64::max)
    }

    /// Returns the anchor of a particle that carries a vertex.
    pub(super) fn anchor(&self, particle: u32) -> &Anchor {
        &self.anchors[self.number_of[particle as usize] as usize]
    }
}
