//! Layers of prisms over a triangulation, split into tetrahedra.
//!
//! Every prism side (a quadrilateral over one edge of the triangulation) gets one diagonal, shared by both prisms at it:
//! the mesh conforms whatever the choice. The diagonal from the lower end of `a` to the upper end of `b` reads "a before
//! b"; a prism splits into three tets when its three edges do not form a cycle. Starting from the order of the vertices
//! (no cycles), single diagonals are flipped while that improves the tets' shapes.
use glam::DVec3;
use palpate_physics::mesh::quality::volume_length_ratio;
use std::collections::BTreeMap;

/// Passes of diagonal flipping; quality settles after three or four.
const FLIP_PASSES: usize = 8;

/// Corners that the levels `positions[0]` (inner) … `positions[L]` (outer) give to a triangulation. Triangles are
/// counter-clockwise seen from the outer side. Node of vertex `v` on level `l`: `l·vertices + v`.
pub(crate) struct Layers<'a> {
    /// The triangulation all levels share.
    pub(crate) triangles: &'a [[u32; 3]],
    /// Position of every vertex on every level (m).
    pub(crate) levels: &'a [Vec<DVec3>],
}

/// The tets of a stack of layers, and its boundary by part.
pub(crate) struct Split {
    /// Tets, three for each prism, layer by layer.
    pub(crate) tets: Vec<[u32; 4]>,
    /// Inner, outer and side (base) faces, counter-clockwise seen from outside the wall.
    pub(crate) inner: Vec<[u32; 3]>,
    /// See `inner`.
    pub(crate) outer: Vec<[u32; 3]>,
    /// See `inner`; empty for a closed triangulation.
    pub(crate) base: Vec<[u32; 3]>,
}

/// An edge of the triangulation: its ends (ascending) and the triangles at it.
struct Edge {
    ends: [u32; 2],
    triangles: Vec<u32>,
}

struct Topology {
    edges: Vec<Edge>,
    /// Edge from corner i to corner i+1 of each triangle.
    edges_of: Vec<[u32; 3]>,
}

impl Topology {
    fn of(triangles: &[[u32; 3]]) -> Self {
        let mut index: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut edges: Vec<Edge> = Vec::new();
        let mut edges_of = Vec::with_capacity(triangles.len());
        for (t, triangle) in triangles.iter().enumerate() {
            edges_of.push([0, 1, 2].map(|i| {
                let (a, b) = (triangle[i], triangle[(i + 1) % 3]);
                let ends = [a.min(b), a.max(b)];
                let edge = *index.entry(ends).or_insert_with(|| {
                    edges.push(Edge { ends, triangles: Vec::with_capacity(2) });
                    edges.len() as u32 - 1
                });
                edges[edge as usize].triangles.push(t as u32);
                edge
            }));
        }
        Self { edges, edges_of }
    }
}

/// The diagonals of one layer: true when the edge's smaller end comes before its larger one.
struct Diagonals<'a> {
    triangles: &'a [[u32; 3]],
    topology: &'a Topology,
    ascending: Vec<bool>,
}

impl Diagonals<'_> {
    /// Corners of a triangle in their order, and whether that is an even permutation; None when they form a cycle.
    fn order(&self, t: usize) -> Option<([u32; 3], bool)> {
        let [a, b, c] = self.triangles[t];
        let before = [0, 1, 2].map(|i| {
            let edge = self.topology.edges_of[t][i] as usize;
            (self.topology.edges[edge].ends[0] == self.triangles[t][i]) == self.ascending[edge]
        });
        match before {
            // before[i]: corner i comes before corner i+1.
            [true, true, false] => Some(([a, b, c], true)),
            [false, true, true] => Some(([b, c, a], true)),
            [true, false, true] => Some(([c, a, b], true)),
            [true, false, false] => Some(([a, c, b], false)),
            [false, true, false] => Some(([b, a, c], false)),
            [false, false, true] => Some(([c, b, a], false)),
            [true, true, true] | [false, false, false] => None,
        }
    }

    /// The three tets as (vertex, upper?) pairs, positively oriented when the prism is.
    fn tets(&self, t: usize) -> Option<[[(u32, bool); 4]; 3]> {
        let ([a, b, c], even) = self.order(t)?;
        let lower = |v| (v, false);
        let upper = |v| (v, true);
        let mut tets = [
            [lower(a), lower(b), lower(c), upper(c)],
            [lower(a), lower(b), upper(c), upper(b)],
            [lower(a), upper(a), upper(b), upper(c)],
        ];
        if !even {
            for tet in &mut tets {
                tet.swap(2, 3);
            }
        }
        Some(tets)
    }

    /// Badness of a prism: Σ 1/q² over its tets with q the volume-length ratio, and beyond any sum of good tets when
    /// one is flat or inverted; None for a cycle.
    fn cost(&self, t: usize, lower: &[DVec3], upper: &[DVec3]) -> Option<f64> {
        let tets = self.tets(t)?;
        let position = |(v, up): (u32, bool)| if up { upper[v as usize] } else { lower[v as usize] };
        Some(tets.iter().map(|tet| cost_of_ratio(volume_length_ratio(tet.map(position)))).sum())
    }

    fn improve(&mut self, lower: &[DVec3], upper: &[DVec3]) {
        let mut cost: Vec<f64> =
            (0..self.triangles.len()).map(|t| self.cost(t, lower, upper).unwrap_or(f64::INFINITY)).collect();
        for _ in 0..FLIP_PASSES {
            let mut flipped = false;
            for (e, edge) in self.topology.edges.iter().enumerate() {
                let before: f64 = edge.triangles.iter().map(|&t| cost[t as usize]).sum();
                self.ascending[e] = !self.ascending[e];
                let after: Option<Vec<f64>> =
                    edge.triangles.iter().map(|&t| self.cost(t as usize, lower, upper)).collect();
                match after {
                    Some(after) if after.iter().sum::<f64>() < before * (1.0 - 1e-9) => {
                        edge.triangles.iter().zip(after).for_each(|(&t, new)| cost[t as usize] = new);
                        flipped = true;
                    }
                    _ => self.ascending[e] = !self.ascending[e],
                }
            }
            if !flipped {
                break;
            }
        }
    }
}

/// 1/q², continued by a steep line below q = 0.01 so that untangling always pays.
pub(crate) fn cost_of_ratio(q: f64) -> f64 {
    if q > 0.01 { 1.0 / (q * q) } else { 1e4 + (0.01 - q) * 1e8 }
}

/// Splits all layers.
pub(crate) fn split(layers: &Layers<'_>) -> Split {
    let topology = Topology::of(layers.triangles);
    let vertices = layers.levels.first().map_or(0, Vec::len) as u32;
    let node = |level: usize, v: u32| level as u32 * vertices + v;
    let top = layers.levels.len().saturating_sub(1);
    let mut out = Split {
        tets: Vec::with_capacity(3 * layers.triangles.len() * top),
        inner: layers.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect(),
        outer: layers.triangles.iter().map(|t| t.map(|v| node(top, v))).collect(),
        base: Vec::new(),
    };
    for level in 0..top {
        let ascending = vec![true; topology.edges.len()];
        let mut diagonals = Diagonals { triangles: layers.triangles, topology: &topology, ascending };
        diagonals.improve(&layers.levels[level], &layers.levels[level + 1]);
        for t in 0..layers.triangles.len() {
            // Flips never make a cycle, so there is always an order.
            let Some(tets) = diagonals.tets(t) else { continue };
            out.tets.extend(tets.map(|tet| tet.map(|(v, up)| node(level + usize::from(up), v))));
        }
        push_sides(&diagonals, |v, up| node(level + usize::from(up), v), &mut out.base);
    }
    out
}

/// The two triangles of every side that only one prism has.
fn push_sides(diagonals: &Diagonals<'_>, node: impl Fn(u32, bool) -> u32, base: &mut Vec<[u32; 3]>) {
    let topology = diagonals.topology;
    for (t, edges) in topology.edges_of.iter().enumerate() {
        for (i, &e) in edges.iter().enumerate() {
            if topology.edges[e as usize].triangles.len() != 1 {
                continue;
            }
            // The triangle runs a → b with the prism on the left; seen from outside: a, b, b', a'.
            let (a, b) = (diagonals.triangles[t][i], diagonals.triangles[t][(i + 1) % 3]);
            let a_before_b = (a < b) == diagonals.ascending[e as usize];
            let [al, bl, au, bu] = [node(a, false), node(b, false), node(a, true), node(b, true)];
            base.extend(if a_before_b { [[al, bl, bu], [al, bu, au]] } else { [[al, bl, au], [bl, bu, au]] });
        }
    }
}
