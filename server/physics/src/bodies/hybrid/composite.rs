//! The shape functions of the coarse level. Every tetrahedron has ten nodes, four at its corners and six at the middles
//! of its edges; the functions are linear on each of its eight parts (the four corner tets, and the octahedron between
//! them cut in four along its shortest diagonal).
//!
//! They are never negative and reproduce affine functions, so a particle that follows the coarse nodes by them,
//! `y_p = Σ_i ζ_pi x_i`, moves rigidly where they do, and its mass, spread by the same weights, is positive. A particle
//! has at most four weights. (Composite tetrahedra: Thoutireddy et al. 2002. Quadratic functions on the same nodes are
//! negative in places: mass spread by them would be, too.)
use super::locate::Locator;
use crate::mesh::{TetMesh, tet::EDGES};
use glam::DVec3;
use std::collections::BTreeMap;

/// Number of nodes of a composite tetrahedron.
pub const NODES: usize = 10;
/// Number of parts over which its strain is averaged: the corner tets and the octahedron.
pub const PARTS: usize = 5;
/// Number of the octahedron among the parts.
const MIDDLE: u8 = 4;

/// Number, within a tet, of the node on the edge between two corners.
const NODE_OF_EDGE: [[usize; 4]; 4] = [[0, 4, 5, 6], [4, 1, 7, 8], [5, 7, 2, 9], [6, 8, 9, 3]];

/// Weights below this count as zero: a particle does not follow such a coarse node.
pub(super) const NO_WEIGHT: f64 = 1e-9;

/// The shape functions over a tetrahedral mesh.
#[derive(Debug, Clone)]
pub struct Composite {
    positions_m: Vec<DVec3>,
    tets: Vec<[u32; NODES]>,
    /// Of each tet, the corner that, with corner 0, has the edge from whose middle the octahedron's shortest diagonal
    /// starts.
    diagonal: Vec<u8>,
    locator: Locator,
}

/// The coarse nodes that a point follows, with their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Anchor {
    /// Coarse nodes.
    pub nodes: [u32; 4],
    /// Weights ζ of the nodes; they sum to one, and are negative only outside the coarse tets.
    pub weights: [f64; 4],
    /// The tet that they belong to.
    pub tet: u32,
    /// The part of the tet.
    pub part: u8,
}

impl Anchor {
    /// Returns weights `a_i ≥ 0` with which lumped masses `m a_i Σ_j a_j` on the nodes have no less kinetic energy than the
    /// point, of mass `m`: `|ζ_i|`. Inside the coarse tets the lumped masses are `m ζ_i`; outside, where some weights are
    /// negative, they sum to more than `m`.
    ///
    /// By Cauchy's inequality, `|Σ ζ_i v_i|² ≤ Σ_j |ζ_j| Σ_i |ζ_i| |v_i|²`.
    pub fn bearing_weights(&self) -> [f64; 4] {
        if self.is_inside() { self.weights } else { self.weights.map(f64::abs) }
    }

    /// Returns the lumped masses (kg) on the nodes of a point of mass `mass_kg` ([`Self::bearing_weights`]).
    pub fn lumped_kg(&self, mass_kg: f64) -> [f64; 4] {
        let weights = self.bearing_weights();
        let sum = if self.is_inside() { 1.0 } else { weights.iter().sum() };
        weights.map(|weight| mass_kg * weight * sum)
    }

    /// Returns whether no weight is negative.
    pub fn is_inside(&self) -> bool {
        self.weights.iter().all(|weight| *weight > -NO_WEIGHT)
    }

    /// Returns `Σ ζ_i a_i`.
    #[inline]
    pub fn of(&self, a: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.weights).map(|(&node, weight)| a[node as usize] * weight).sum()
    }

    /// Adds a force (N) on the point to those of its nodes: `f_i ← f_i + ζ_i f`.
    pub fn push(&self, force_n: DVec3, forces_n: &mut [DVec3]) {
        for (&node, weight) in self.nodes.iter().zip(self.weights) {
            forces_n[node as usize] += force_n * weight;
        }
    }
}

impl Composite {
    /// Makes the functions over a mesh. The mesh's nodes come first, in their order, then one for every edge.
    pub fn new(mesh: &TetMesh) -> Self {
        let mut positions_m = mesh.positions_m().to_vec();
        let mut of_edge: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut tets = Vec::with_capacity(mesh.tets().len());
        let mut diagonal = Vec::with_capacity(mesh.tets().len());
        for corners in mesh.tets() {
            let mut nodes = [0; NODES];
            nodes[..4].copy_from_slice(corners);
            for (number, [a, b]) in EDGES.into_iter().enumerate() {
                let edge = [corners[a].min(corners[b]), corners[a].max(corners[b])];
                nodes[4 + number] = *of_edge.entry(edge).or_insert_with(|| {
                    positions_m.push((positions_m[edge[0] as usize] + positions_m[edge[1] as usize]) * 0.5);
                    positions_m.len() as u32 - 1
                });
            }
            let length = |mate: &u8| {
                let [c, d] = others(*mate as usize);
                let [from, to] = [NODE_OF_EDGE[0][*mate as usize], NODE_OF_EDGE[c][d]].map(|n| nodes[n] as usize);
                positions_m[from].distance_squared(positions_m[to])
            };
            diagonal.push([1, 2, 3].into_iter().min_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(1));
            tets.push(nodes);
        }
        Self { positions_m, tets, diagonal, locator: Locator::new(mesh) }
    }

    /// Adds a node of no tet, and returns its number.
    pub(super) fn add_node(&mut self, position_m: DVec3) -> u32 {
        self.positions_m.push(position_m);
        self.positions_m.len() as u32 - 1
    }

    /// Returns the rest positions (m) of all coarse nodes.
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// Returns the nodes of every tet: those of its corners, then those of its edges in the order of [`EDGES`].
    pub fn tets(&self) -> &[[u32; NODES]] {
        &self.tets
    }

    /// Returns what a point follows: nodes of the tet that holds it, or of the one that is least far away.
    pub fn anchor(&self, point_m: DVec3) -> Anchor {
        let (tet, barycentric) = self.locator.nearest(point_m);
        self.anchor_at(tet, barycentric)
    }

    /// Does the same for a point whose tet is known.
    pub fn anchor_in(&self, tet: u32, point_m: DVec3) -> Anchor {
        self.anchor_at(tet as usize, self.locator.barycentric(tet as usize, point_m))
    }

    fn anchor_at(&self, tet: usize, barycentric: [f64; 4]) -> Anchor {
        let (nodes, weights, part) = weights(barycentric, self.diagonal[tet] as usize);
        let nodes = nodes.map(|n| self.tets[tet][n]);
        Anchor { nodes, weights, tet: tet as u32, part }
    }
}

/// Returns the two corners besides 0 and `mate`.
fn others(mate: usize) -> [usize; 2] {
    match mate {
        1 => [2, 3],
        2 => [1, 3],
        _ => [1, 2],
    }
}

/// Returns nodes (numbered within the tet), weights and part for barycentric coordinates. The octahedron's diagonal
/// joins the middle of edge `(0, mate)` with that of the edge opposite.
///
/// Corner tet `a` where `L_a ≥ ½`: `2L_a − 1` at the corner, `2L_b` at the middle of `(a, b)`. In the octahedron let
/// `(s, t)` be the diagonal's edge with the larger `|L_s − L_t|`, `L_s ≥ L_t`, and `(u, v)` the other: `2L_t` at
/// `(s, t)`, `1 − 2L_s` at `(u, v)`, `2L_u + 2L_s − 1` at `(s, u)`, `2L_v + 2L_s − 1` at `(s, v)`.
fn weights(l: [f64; 4], mate: usize) -> ([usize; 4], [f64; 4], u8) {
    if let Some(a) = (0..4).find(|&a| l[a] >= 0.5) {
        let mut nodes = [0, 1, 2, 3].map(|b| NODE_OF_EDGE[a][b]);
        let mut weights = l.map(|l_b| 2.0 * l_b);
        weights[a] = 2.0 * l[a] - 1.0;
        nodes[a] = a;
        return (nodes, weights, a as u8);
    }
    let [c, d] = others(mate);
    let (first, second) = ([0, mate], [c, d]);
    let difference = |[a, b]: [usize; 2]| (l[a] - l[b]).abs();
    let (edge, [u, v]) = if difference(first) >= difference(second) { (first, second) } else { (second, first) };
    let [s, t] = if l[edge[0]] >= l[edge[1]] { edge } else { [edge[1], edge[0]] };
    let across = 1.0 - 2.0 * l[s];
    (
        [NODE_OF_EDGE[s][t], NODE_OF_EDGE[u][v], NODE_OF_EDGE[s][u], NODE_OF_EDGE[s][v]],
        [2.0 * l[t], across, 2.0 * l[u] - across, 2.0 * l[v] - across],
        MIDDLE,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{Random, slab};

    #[test]
    fn weights_are_never_negative_and_reproduce_affine_functions() {
        let coarse = Composite::new(&slab());
        let mut random = Random(3);
        let mut parts = [0; PARTS];
        for _ in 0..5000 {
            let point = DVec3::new(random.unit() * 0.08, random.unit() * 0.08, random.unit() * 0.04);
            let anchor = coarse.anchor(point);
            assert!(anchor.weights.iter().all(|&w| w > -1e-12), "{anchor:?}");
            assert!((anchor.weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            assert!((anchor.of(coarse.positions_m()) - point).length() < 1e-15);
            parts[anchor.part as usize] += 1;
        }
        // Half of the volume is the octahedra's.
        assert!((f64::from(parts[4]) / 5000.0 - 0.5).abs() < 0.03 && parts.iter().all(|&n| n > 400), "{parts:?}");
    }

    #[test]
    fn they_are_continuous_across_faces_and_parts() {
        let coarse = Composite::new(&slab());
        let mut random = Random(4);
        let values: Vec<DVec3> = coarse.positions_m().iter().map(|_| random.vector()).collect();
        for _ in 0..2000 {
            let from = DVec3::new(random.unit() * 0.08, random.unit() * 0.08, random.unit() * 0.04);
            let step = random.vector() * 1e-9;
            let jump = coarse.anchor(from + step).of(&values) - coarse.anchor(from).of(&values);
            // Gradients are some 2 / 10 mm.
            assert!(jump.length() < 2e3 * step.length(), "{jump}");
        }
    }

    #[test]
    fn outside_they_still_reproduce_affine_functions() {
        let coarse = Composite::new(&slab());
        let mut random = Random(5);
        for _ in 0..500 {
            let point = DVec3::new(0.04, 0.04, 0.02) + random.vector() * 0.06;
            let anchor = coarse.anchor(point);
            assert!((anchor.of(coarse.positions_m()) - point).length() < 1e-14, "{point}");
        }
    }
}
