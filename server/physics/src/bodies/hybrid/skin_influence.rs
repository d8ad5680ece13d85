//! A bound of how far, or how fast, any vertex of the skin moves, by what moves it: coarse nodes and active particles.
//!
//! A vertex's displacement is `u_v = Σ_p w_vp u_p` of the particles that carry it; one that is not active follows coarse
//! nodes, `u_p = Σ_i ζ_pi u_i`. Node `i` has the *influence* `Y_i = max_v Σ_p |w_vp ζ_pi|`, over all particles, and with
//! `a = max_v Σ_p |w_vp| max(1, Σ_i |ζ_pi|)` no vertex moves by more than `a` times the largest of all displacements. A
//! coarse mesh that holds a body of any shape has nodes far outside of it, which carry next to nothing and, being light,
//! move more than all others. So, with the largest displacement `s` of active particles and of nodes that are not faint,
//! ```text
//! |u_v| ≤ min(a s + Σ_{i faint} Y_i (|u_i| − s)⁺, a max(s, max_{i faint} |u_i|))
//! ```
//! Where a skin stands far out of the lattice's cells, as at the tip of a papillary muscle, a few vertices are extrapolated so far that their `Σ |w_vp| …`
//! is ten times that of all others, and so would the bound be. They are *wild*: `a` and `Y_i` are of the others, and wild vertices are looked at one by one.
use super::skin_carriers::SkinCarriers;

/// Influence below which a node is faint.
const FAINT: f64 = 0.1;
/// Amplification above which a vertex may be wild, and most wild vertices.
const TAME: f64 = 2.0;
const MOST_WILD: usize = 64;

/// How much each coarse node moves the skin.
#[derive(Debug, Clone, Default)]
pub(super) struct SkinInfluence {
    /// `a`.
    amplification: f64,
    /// The same of all vertices.
    largest_amplification: f64,
    /// Vertices of which `a` tells nothing, ascending.
    wild: Vec<u32>,
    /// Nodes that are not faint.
    strong: Vec<u32>,
    /// Faint nodes that move any vertex, each with its influence `Y_i`.
    faint: Vec<(u32, f64)>,
}

impl SkinInfluence {
    /// Measures how much each of so many coarse nodes moves the skin's vertices. None may be wild in a lattice of two sizes, where particles follow
    /// others that are active.
    pub(super) fn new(carriers: &SkinCarriers, nodes: usize, may_be_wild: bool) -> Self {
        let (mut influence, mut of_vertex) = (vec![0.0_f64; nodes], vec![0.0; nodes]);
        let amplifications: Vec<f64> = (0..carriers.vertices()).map(|vertex| amplification(carriers, vertex)).collect();
        let wild = if may_be_wild { wild(&amplifications) } else { Vec::new() };
        let tame = || (0..carriers.vertices()).filter(|vertex| wild.binary_search(vertex).is_err());
        for vertex in tame() {
            for &(particle, weight) in carriers.of_vertex(vertex) {
                let anchor = carriers.anchor(particle);
                for (&node, zeta) in anchor.nodes.iter().zip(anchor.weights) {
                    of_vertex[node as usize] += (weight * zeta).abs();
                }
            }
            for node in carriers.of_vertex(vertex).iter().flat_map(|(particle, _)| carriers.anchor(*particle).nodes) {
                let of_vertex = std::mem::take(&mut of_vertex[node as usize]);
                influence[node as usize] = influence[node as usize].max(of_vertex);
            }
        }
        let all = || (0..).zip(&influence).map(|(node, influence)| (node, *influence));
        Self {
            amplification: tame().map(|vertex| amplifications[vertex as usize]).fold(1.0, f64::max),
            largest_amplification: amplifications.iter().copied().fold(1.0, f64::max),
            strong: all().filter(|(_, influence)| *influence >= FAINT).map(|(node, _)| node).collect(),
            faint: all().filter(|(_, influence)| *influence > 0.0 && *influence < FAINT).collect(),
            wild,
        }
    }

    /// Returns `a`, of all vertices.
    pub(super) fn largest_amplification(&self) -> f64 {
        self.largest_amplification
    }

    /// Returns the wild vertices, of which [`Self::bound`] tells nothing.
    pub(super) fn wild(&self) -> &[u32] {
        &self.wild
    }

    /// Returns the bound, with the square of every node's size and that of the largest active particle's.
    pub(super) fn bound(&self, node_sq: impl Fn(usize) -> f64, particles_sq: f64) -> f64 {
        let strong_sq = self.strong.iter().map(|&node| node_sq(node as usize)).fold(particles_sq, f64::max);
        let strong = strong_sq.sqrt();
        let (mut beyond, mut largest_sq) = (0.0, strong_sq);
        for &(node, influence) in &self.faint {
            let faint_sq = node_sq(node as usize);
            if faint_sq > strong_sq {
                beyond += influence * (faint_sq.sqrt() - strong);
                largest_sq = f64::max(largest_sq, faint_sq);
            }
        }
        f64::min(self.amplification * strong + beyond, self.amplification * largest_sq.sqrt())
    }
}

/// Returns `Σ_p |w_vp| max(1, Σ_i |ζ_pi|)` of a vertex.
pub(super) fn amplification(carriers: &SkinCarriers, vertex: u32) -> f64 {
    let of = |&(particle, weight): &(u32, f64)| {
        weight.abs() * carriers.anchor(particle).weights.iter().map(|zeta| zeta.abs()).sum::<f64>().max(1.0)
    };
    carriers.of_vertex(vertex).iter().map(of).sum()
}

/// Returns the vertices with the largest amplifications, as many as may be wild, ascending.
fn wild(amplifications: &[f64]) -> Vec<u32> {
    let mut wild: Vec<u32> =
        (0..).zip(amplifications).filter(|(_, of_vertex)| **of_vertex > TAME).map(|(vertex, _)| vertex).collect();
    wild.sort_by(|a, b| amplifications[*b as usize].total_cmp(&amplifications[*a as usize]));
    wild.truncate(MOST_WILD);
    wild.sort_unstable();
    wild
}

#[cfg(test)]
mod tests {
    use crate::bodies::hybrid::testing::{Random, hybrid_ball, tissue};
    use glam::DVec3;

    /// The coarse nodes move at random, and a faint one a hundred times as fast: the bound holds, and this makes little of it.
    #[test]
    fn a_node_that_carries_little_makes_little_of_the_bound() {
        let [material, other, _] = tissue();
        let body = hybrid_ball(&[material, other]);
        let (carriers, influence) = (&body.skin_carriers, &body.skin_influence);
        assert!(influence.faint.len() > 5 && influence.strong.len() > 50, "{influence:?}");
        let mut random = Random(31);
        for times in [1.0, 100.0] {
            let mut u: Vec<DVec3> = (0..body.node_count()).map(|_| random.vector()).collect();
            u[influence.faint[0].0 as usize] *= times;
            let moved = |vertex| -> DVec3 {
                let of = |&(particle, weight): &(u32, f64)| carriers.anchor(particle).of(&u) * weight;
                carriers.of_vertex(vertex).iter().map(of).sum()
            };
            let tame = (0..carriers.vertices()).filter(|vertex| !influence.wild().contains(vertex));
            let most = tame.map(|vertex| moved(vertex).length()).fold(0.0, f64::max);
            let bound = influence.bound(|node| u[node].length_squared(), 0.0);
            let by_the_largest = influence.largest_amplification() * u.iter().map(|u| u.length()).fold(0.0, f64::max);
            assert!(most <= bound, "{most} {bound}");
            assert!(bound <= by_the_largest * if times == 1.0 { 1.0 } else { 0.3 }, "{bound} {by_the_largest}");
        }
    }
}
