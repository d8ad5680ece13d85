//! What carries the skin's vertices at rest: their particles, and those particles' anchors. To find these takes several
//! times as long as to use them, and self-contact asks for every vertex.
//!
//! A vertex follows the eight particles of its cell by trilinear weights. Such a surface gives way more at a particle, which takes a
//! force alone, than in the middle of a face, where four share it, and a tool that touches less than a cell feels that
//! (`docs/measurements/ripple.md`). A smooth skin follows the mean of trilinear points over a cube of one spacing about each vertex:
//! ```text
//! w_p(X) = 1/h³ ∫ t_p(X + s) ds,   s in [−h/2, h/2]³        x = X + Σ w_p u_p
//! ```
//! with the trilinear weights `t_p`; on a whole lattice `w_p` is the quadratic B-spline. As the cube is symmetric about the vertex and
//! trilinear points move affinely, so does the mean, whatever cells the cube meets: where it reaches out of the body, the nearest cell's
//! weights are continued. Across a flat face that lies on the lattice the mean changes nothing, so no deeper particles take part there.
//!
//! Particles that sleep follow the coarse nodes, `u_p = Σ_i ζ_pi u_i`, so a vertex needs those alone, and what active particles deviate:
//! ```text
//! Σ_p w_p u_p = Σ_i ω_i u_i + Σ_{p active} w_p d_p        ω_i = Σ_p w_p ζ_pi,  d_p = u_p − Σ_i ζ_pi u_i
//! ```
//! A vertex of a smooth skin has some thirty particles of four nodes each, but few different nodes.
use super::{
    composite::Anchor,
    partition::{NONE, Partition},
    trilinear_point::{CellPoint, TrilinearPoint},
};
use glam::DVec3;
use std::collections::BTreeMap;

/// Points along an edge of the cube over which a smooth skin takes the mean; the weights are then exact at particles.
const POINTS: usize = 4;
/// Weights below this are rounding.
const ROUNDING: f64 = 1e-14;

/// The particles that carry the skin.
#[derive(Debug, Clone, Default)]
pub(super) struct SkinCarriers {
    /// Index in `carriers` of the first entry of each vertex, and the end of the last.
    first: Vec<u32>,
    /// Particles with their weights, of which none is zero.
    carriers: Vec<(u32, f64)>,
    /// Index in `nodes` of the first entry of each vertex, and the end of the last.
    first_node: Vec<u32>,
    /// Coarse nodes with their weights `ω`, of which none is zero.
    nodes: Vec<(u32, f64)>,
    /// Number in `anchors` of every particle, [`NONE`] of those that carry no vertex.
    number_of: Vec<u32>,
    anchors: Vec<Anchor>,
}

impl SkinCarriers {
    /// Finds what carries vertices that are given by their cells; a smooth skin's are carried as told above.
    pub(super) fn new(partition: &Partition, vertices: &[CellPoint], is_smooth: bool) -> Self {
        let mut found = Self { first: vec![0], number_of: vec![NONE; partition.particle_count()], ..Self::default() };
        for point in vertices {
            if is_smooth {
                for carrier in smoothed(partition, point) {
                    found.push(partition, carrier);
                }
            } else {
                let TrilinearPoint { particles, weights } = point.trilinear(partition);
                for carrier in particles.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
                    found.push(partition, carrier);
                }
            }
            found.first.push(found.carriers.len() as u32);
        }
        found.merge_anchors();
        found
    }

    /// Finds the nodes that each vertex follows while all of its particles sleep.
    fn merge_anchors(&mut self) {
        self.first_node.push(0);
        for vertex in 0..self.vertices() {
            let mut sums = BTreeMap::<u32, f64>::new();
            for &(particle, weight) in self.of_vertex(vertex) {
                let Anchor { nodes, weights, .. } = self.anchor(particle);
                for (node, zeta) in nodes.iter().zip(weights) {
                    *sums.entry(*node).or_default() += weight * zeta;
                }
            }
            self.nodes.extend(sums.into_iter().filter(|(_, weight)| *weight != 0.0));
            self.first_node.push(self.nodes.len() as u32);
        }
    }

    fn push(&mut self, partition: &Partition, (particle, weight): (u32, f64)) {
        self.carriers.push((particle, weight));
        let number = &mut self.number_of[particle as usize];
        if *number == NONE {
            *number = self.anchors.len() as u32;
            self.anchors.push(partition.anchor(particle));
        }
    }

    /// Returns the particles that carry a vertex, with their weights, of which none is zero: 1 to 8, of a smooth skin more.
    pub(super) fn of_vertex(&self, vertex: u32) -> &[(u32, f64)] {
        let at = vertex as usize;
        &self.carriers[self.first[at] as usize..self.first[at + 1] as usize]
    }

    /// Returns the number of vertices.
    pub(super) fn vertices(&self) -> u32 {
        self.first.len() as u32 - 1
    }

    /// Returns the anchor of a particle that carries a vertex.
    pub(super) fn anchor(&self, particle: u32) -> &Anchor {
        &self.anchors[self.number_of[particle as usize] as usize]
    }

    /// Returns whether a particle carries any vertex.
    pub(super) fn has(&self, particle: u32) -> bool {
        self.number_of[particle as usize] != NONE
    }

    /// Returns the coarse nodes that a vertex follows while all of its particles sleep, with their weights `ω`.
    pub(super) fn nodes_of_vertex(&self, vertex: u32) -> &[(u32, f64)] {
        let at = vertex as usize;
        &self.nodes[self.first_node[at] as usize..self.first_node[at + 1] as usize]
    }

    /// Returns `Σ ω_i a_i` of a vertex, with values of the coarse nodes.
    #[inline]
    pub(super) fn of_nodes(&self, vertex: u32, a: &[DVec3]) -> DVec3 {
        self.nodes_of_vertex(vertex).iter().map(|&(node, weight)| a[node as usize] * weight).sum()
    }
}

/// Returns the particles and weights of the mean over a cube of one spacing about a point, ascending.
fn smoothed(partition: &Partition, point: &CellPoint) -> Vec<(u32, f64)> {
    let spacing_m = partition.sites().spacing_m();
    let at_m = point.rest_m(partition);
    let offset_m = |number: usize| ((number as f64 + 0.5) / POINTS as f64 - 0.5) * spacing_m;
    let mut sums = BTreeMap::<u32, f64>::new();
    for number in 0..POINTS.pow(3) {
        let [i, j, k] = [number % POINTS, number / POINTS % POINTS, number / POINTS.pow(2)].map(offset_m);
        let TrilinearPoint { particles, weights } = TrilinearPoint::new(partition, at_m + DVec3::new(i, j, k));
        for (particle, weight) in particles.into_iter().zip(weights) {
            *sums.entry(particle).or_default() += weight / POINTS.pow(3) as f64;
        }
    }
    sums.into_iter().filter(|(_, weight)| weight.abs() > ROUNDING).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{ball, embedded_balls};

    fn smooth(partition: &Partition, point_m: DVec3) -> Vec<(u32, f64)> {
        smoothed(partition, &CellPoint::new(partition, point_m))
    }

    #[test]
    fn vertices_of_a_smooth_skin_move_affinely() {
        for partition in embedded_balls() {
            for &point_m in ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3).positions_m() {
                let carriers = smooth(&partition, point_m);
                assert!((carriers.iter().map(|(_, w)| w).sum::<f64>() - 1.0).abs() < 1e-12);
                let moved: DVec3 = carriers.iter().map(|&(p, w)| partition.particle_m(p) * w).sum();
                assert!((moved - point_m).length() < 1e-14, "{moved} {point_m}");
                assert!(carriers.iter().all(|&(_, w)| w > -0.5));
            }
        }
    }

    /// Inside the lattice, on a particle, and where four cells meet midway between particles: (1/8, 6/8, 1/8)³ and (1/2, 1/2)³.
    #[test]
    fn inside_the_lattice_weights_are_quadratic_b_splines() {
        let partition = &embedded_balls()[0];
        let middle = (0..partition.particle_count() as u32)
            .min_by(|&a, &b| partition.particle_m(a).length().total_cmp(&partition.particle_m(b).length()))
            .unwrap();
        let (at_m, h) = (partition.particle_m(middle), partition.sites().spacing_m());
        let on_particle = smooth(partition, at_m);
        assert_eq!(on_particle.len(), 27);
        for (particle, weight) in on_particle {
            let apart = ((partition.particle_m(particle) - at_m) / h).abs();
            let of_axis = |a: f64| if a < 0.5 { 0.75 } else { 0.125 };
            let expected: f64 = apart.to_array().into_iter().map(of_axis).product();
            assert!((weight - expected).abs() < 1e-12, "{apart}: {weight}");
        }
        let midway = smooth(partition, at_m + DVec3::splat(0.5 * h));
        assert!(midway.len() == 8 && midway.iter().all(|(_, weight)| (weight - 0.125).abs() < 1e-12), "{midway:?}");
    }
}
