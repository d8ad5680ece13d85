//! Refinement of a part of a surface: rings about touched vertices are split in four, without cracks.
//!
//! Every triangle of the region becomes four. A triangle beside the region becomes two, by an edge from the middle of
//! the edge that they share to the corner across; a triangle with two neighbours in the region is added to it. A region
//! is a set, so that triangles which belong to several contacts are refined once.
use super::{
    anchor::AnchorLaw,
    net::{Net, Spring},
    triangulation::{NONE, Triangulation},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// A set of triangles that are to be refined.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Region {
    triangles: BTreeSet<u32>,
}

impl Region {
    /// Returns the region of `rings` rings about the vertices `centres`: triangles of the first ring have one of these
    /// as a corner, those of the next ring a corner of the ring before. Triangles with two neighbours in the region
    /// belong to it, too.
    pub fn rings(surface: &Triangulation, centres: &[u32], rings: u32) -> Self {
        let mut triangles = BTreeSet::new();
        let mut corners: BTreeSet<u32> = centres.iter().copied().collect();
        for _ in 0..rings {
            for &vertex in &corners {
                triangles.extend(surface.triangles_at(vertex));
            }
            corners = triangles.iter().flat_map(|&t| surface.triangles()[t as usize]).collect();
        }
        Self { triangles }.closed(surface)
    }

    /// Returns the triangles of the region, ascending.
    pub fn triangles(&self) -> &BTreeSet<u32> {
        &self.triangles
    }

    fn closed(mut self, surface: &Triangulation) -> Self {
        let mut new: Vec<u32> = self.triangles.iter().copied().collect();
        while let Some(triangle) = new.pop() {
            for next in neighbours(surface, triangle) {
                let refined = neighbours(surface, next).filter(|t| self.triangles.contains(t)).count();
                if refined > 1 && self.triangles.insert(next) {
                    new.push(next);
                }
            }
        }
        self
    }
}

/// Returns the triangles across the edges of a triangle.
fn neighbours(surface: &Triangulation, triangle: u32) -> impl Iterator<Item = u32> + '_ {
    let edges = surface.edges_of(triangle).into_iter().flat_map(|edge| surface.edges()[edge as usize].triangles);
    edges.filter(move |&t| t != NONE && t != triangle)
}

/// Where a spring of a partly refined surface lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The spring lies along an edge of the coarse surface.
    Coarse,
    /// The spring lies in the region or along its rim.
    Fine,
    /// The spring goes from the rim across the coarse triangle beside it, and closes the crack there.
    Crack,
}

/// A surface with a refined region. Nodes are the coarse vertices in their order (those of the region are of type 1),
/// then the vertices of type 2.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Rest positions (m) of the nodes.
    pub rest_m: Vec<DVec3>,
    /// The coarse edge of every node of type 2, ascending.
    pub edges: Vec<u32>,
    /// Ends of the springs and where they lie.
    pub springs: Vec<([u32; 2], Kind)>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Whether each node belongs to the region.
    pub is_inside: Vec<bool>,
    /// Number `N` of the region's coarse vertices; together with those of type 2 there are `N′`.
    pub coarse_inside: usize,
}

impl Refined {
    /// Refines a region. `fine_rest_m` has the rest positions (m) of the whole surface refined
    /// ([`super::loop_scheme::refined`]).
    pub fn new(surface: &Triangulation, region: &Region, fine_rest_m: &[DVec3]) -> Self {
        let vertices = surface.positions_m().len();
        let edges: BTreeSet<u32> = region.triangles.iter().flat_map(|&t| surface.edges_of(t)).collect();
        let middle: BTreeMap<u32, u32> = edges.iter().copied().zip(vertices as u32..).collect();
        let of_edges = edges.iter().map(|&edge| fine_rest_m[vertices + edge as usize]);
        let rest_m: Vec<DVec3> = fine_rest_m[..vertices].iter().copied().chain(of_edges).collect();
        let mut is_inside = vec![false; rest_m.len()];
        is_inside[vertices..].fill(true);
        for &triangle in &region.triangles {
            surface.triangles()[triangle as usize].iter().for_each(|&v| is_inside[v as usize] = true);
        }
        let coarse_inside = is_inside[..vertices].iter().filter(|inside| **inside).count();
        let mut own = Self {
            rest_m,
            edges: edges.into_iter().collect(),
            springs: Vec::new(),
            triangles: Vec::new(),
            is_inside,
            coarse_inside,
        };
        for (edge, number) in surface.edges().iter().zip(0..) {
            let [a, b] = edge.nodes;
            match middle.get(&number) {
                None => own.springs.push(([a, b], Kind::Coarse)),
                Some(&m) => own.springs.extend([([a, m], Kind::Fine), ([m, b], Kind::Fine)]),
            }
        }
        for triangle in 0..surface.triangles().len() as u32 {
            let middles = surface.edges_of(triangle).map(|edge| middle.get(&edge).copied());
            own.split(surface.triangles()[triangle as usize], middles);
        }
        own
    }

    /// Splits a triangle at those of its edges that have a middle.
    fn split(&mut self, [a, b, c]: [u32; 3], middles: [Option<u32>; 3]) {
        match middles {
            [Some(ab), Some(bc), Some(ca)] => {
                self.triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
                self.springs.extend([[ab, bc], [bc, ca], [ca, ab]].map(|nodes| (nodes, Kind::Fine)));
            }
            [Some(ab), None, None] => {
                self.triangles.extend([[a, ab, c], [ab, b, c]]);
                self.springs.push(([ab, c], Kind::Crack));
            }
            [None, Some(bc), None] => self.split([b, c, a], [Some(bc), None, None]),
            [None, None, Some(ca)] => self.split([c, a, b], [Some(ca), None, None]),
            // No edge has a middle; there are never two, as regions are closed.
            _ => self.triangles.push([a, b, c]),
        }
    }

    /// Returns `N/N′`.
    pub fn node_ratio(&self) -> f64 {
        self.coarse_inside as f64 / (self.coarse_inside + self.edges.len()) as f64
    }

    /// Returns the number of springs of one kind.
    pub fn count(&self, kind: Kind) -> usize {
        self.springs.iter().filter(|(_, of)| *of == kind).count()
    }

    /// Returns the springs of the surface, with the constants `outside` where it is coarse, and `inside` in the region,
    /// along its rim and for crack springs.
    pub fn net(&self, outside: &Constants, inside: &Constants) -> Net {
        let spring = |&(nodes, kind): &([u32; 2], Kind)| {
            let [a, b] = nodes.map(|node| self.rest_m[node as usize]);
            let of = if kind == Kind::Coarse { outside } else { inside };
            Spring { nodes, rest_length_m: a.distance(b), stiffness_n_per_m: of.mesh_n_per_m }
        };
        let anchor = |inside_region: &bool| if *inside_region { inside.anchor_n_per_m } else { outside.anchor_n_per_m };
        Net {
            rest_m: self.rest_m.clone(),
            springs: self.springs.iter().map(spring).collect(),
            anchor_n_per_m: self.is_inside.iter().map(anchor).collect(),
            anchor_law: AnchorLaw::Linear,
        }
    }
}

/// The constants of mesh and anchor springs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// Stiffness `K_m` (N/m) of the mesh springs.
    pub mesh_n_per_m: f64,
    /// Stiffness `K_h` (N/m) of the anchor springs.
    #[serde(alias = "home_n_per_m")]
    pub anchor_n_per_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::{
        loop_scheme::refined,
        testing::{hexagon, sphere},
    };

    fn about(surface: &Triangulation, centres: &[u32], rings: u32) -> Refined {
        Refined::new(surface, &Region::rings(surface, centres, rings), &refined(surface).0)
    }

    /// The paper's counts: 7 → 19 nodes with 42 + 6 springs, 19 → 61 with 156 + 12.
    #[test]
    fn rings_have_the_papers_nodes_and_springs() {
        let patch = hexagon(6, 0.03);
        for (rings, before, after, fine, crack) in [(1, 7, 19, 42, 6), (2, 19, 61, 156, 12), (3, 37, 127, 342, 18)] {
            let refined = about(&patch, &[0], rings);
            assert_eq!(refined.coarse_inside, before);
            assert_eq!(refined.is_inside.iter().filter(|inside| **inside).count(), after);
            assert_eq!((refined.count(Kind::Fine), refined.count(Kind::Crack)), (fine, crack));
            assert!((refined.node_ratio() - before as f64 / after as f64).abs() < 1e-15);
        }
    }

    fn is_whole(of: &Triangulation, refined: &Refined) {
        let is_boundary = |edge: &u32| of.edges()[*edge as usize].is_boundary();
        let boundary_edges = (0..of.edges().len() as u32).filter(is_boundary).count()
            + refined.edges.iter().filter(|e| is_boundary(e)).count();
        let surface = Triangulation::new(refined.rest_m.clone(), refined.triangles.clone()).unwrap();
        let mut springs: Vec<[u32; 2]> =
            refined.springs.iter().map(|(n, _)| [n[0].min(n[1]), n[0].max(n[1])]).collect();
        springs.sort_unstable();
        let edges: Vec<[u32; 2]> = surface.edges().iter().map(|edge| edge.nodes).collect();
        assert_eq!(springs, edges, "every edge has one spring");
        assert_eq!(surface.edges().iter().filter(|edge| edge.is_boundary()).count(), boundary_edges);
    }

    #[test]
    fn a_partly_refined_surface_has_no_cracks() {
        let (patch, ball) = (hexagon(4, 0.03), sphere(3, 0.05));
        is_whole(&patch, &about(&patch, &[0], 2));
        // On the boundary, and about two vertices whose regions touch, overlap, or leave single triangles between them.
        is_whole(&patch, &about(&patch, &[60], 1));
        for other in 0..ball.positions_m().len() as u32 {
            is_whole(&ball, &about(&ball, &[0, other], 1));
        }
        let all: Vec<u32> = (0..61).collect();
        let whole = about(&patch, &all, 1);
        assert_eq!(whole.triangles.len(), 4 * patch.triangles().len());
    }

    #[test]
    fn what_two_contacts_share_is_refined_once() {
        let patch = hexagon(6, 0.03);
        let near = patch.neighbours(0).next().unwrap();
        let [one, two, both] = [vec![0], vec![near], vec![0, near]].map(|c| Region::rings(&patch, &c, 2));
        assert_eq!(both.triangles(), &one.triangles().union(two.triangles()).copied().collect());
        assert_eq!(about(&patch, &[0, 0], 2), about(&patch, &[0], 2));
        // Every edge is halved at most once, however the regions overlap.
        let refined = about(&patch, &[0, near], 2);
        assert!(
            refined
                .springs
                .iter()
                .all(|(n, _)| refined.rest_m[n[0] as usize].distance(refined.rest_m[n[1] as usize]) > 0.0149)
        );
    }
}
