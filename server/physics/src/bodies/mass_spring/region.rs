//! Refining a part of a surface: rings about what is touched, in fours, without cracks.
//!
//! Every triangle of the region becomes four. A neighbour of it becomes two, by an edge from the middle of the one they share to its corner across; one with two such
//! neighbours is taken into the region. A region is a set, so what several contacts have in common is refined once: to the same level.
use super::{
    home::HomeLaw,
    net::{Net, Spring},
    topology::{NONE, Triangulation},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Triangles to be refined.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Region {
    triangles: BTreeSet<u32>,
}

impl Region {
    /// So many rings about vertices: the first ring's triangles have one of them as a corner, the next ring's some corner of those. Triangles of which two neighbours are in it
    /// are, too.
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

    /// Its triangles, ascending.
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

/// Triangles across the edges of one.
fn neighbours(surface: &Triangulation, triangle: u32) -> impl Iterator<Item = u32> + '_ {
    let edges = surface.edges_of(triangle).into_iter().flat_map(|edge| surface.edges()[edge as usize].triangles);
    edges.filter(move |&t| t != NONE && t != triangle)
}

/// Where a spring of a partly refined surface lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Along an edge of the coarse surface.
    Coarse,
    /// In the region or along its rim.
    Fine,
    /// From the rim into a coarse triangle beside it.
    Crack,
}

/// A surface whose region is refined. Nodes are the coarse vertices in their order (those of the region of type 1), then vertices of type 2.
#[derive(Debug, Clone, PartialEq)]
pub struct Refined {
    /// Homes (m).
    pub rest_m: Vec<DVec3>,
    /// The coarse edge of every node of type 2, ascending.
    pub edges: Vec<u32>,
    /// Ends of the springs and where they lie.
    pub springs: Vec<([u32; 2], Kind)>,
    /// Triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Whether each node belongs to the region.
    pub is_inside: Vec<bool>,
    /// Coarse vertices of the region: `N`. With those of type 2 they are `N′`.
    pub coarse_inside: usize,
}

impl Refined {
    /// Refines a region. `fine_rest_m` are homes (m) of the whole surface refined ([`super::loop_scheme::refined`]).
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

    /// Splits a triangle at the middles that there are of its edges.
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
            // None, and never two: regions are closed.
            _ => self.triangles.push([a, b, c]),
        }
    }

    /// `N/N′`.
    pub fn node_ratio(&self) -> f64 {
        self.coarse_inside as f64 / (self.coarse_inside + self.edges.len()) as f64
    }

    /// Springs of one kind.
    pub fn count(&self, kind: Kind) -> usize {
        self.springs.iter().filter(|(_, of)| *of == kind).count()
    }

    /// Springs on it: constants (N/m) outside, and those inside, of the rim and of cracks.
    pub fn net(&self, outside: &Constants, inside: &Constants) -> Net {
        let spring = |&(nodes, kind): &([u32; 2], Kind)| {
            let [a, b] = nodes.map(|node| self.rest_m[node as usize]);
            let of = if kind == Kind::Coarse { outside } else { inside };
            Spring { nodes, rest_length_m: a.distance(b), stiffness_n_per_m: of.mesh_n_per_m }
        };
        let home = |inside_region: &bool| if *inside_region { inside.home_n_per_m } else { outside.home_n_per_m };
        Net {
            rest_m: self.rest_m.clone(),
            springs: self.springs.iter().map(spring).collect(),
            home_n_per_m: self.is_inside.iter().map(home).collect(),
            home_law: HomeLaw::Linear,
        }
    }
}

/// Spring constants.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Constants {
    /// `K_m` (N/m).
    pub mesh_n_per_m: f64,
    /// `K_h` (N/m).
    pub home_n_per_m: f64,
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

    /// The counts of MODEL.md: 7 → 19 nodes with 42 + 6 springs, 19 → 61 with 156 + 12.
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
        let is_border = |edge: &u32| of.edges()[*edge as usize].is_border();
        let borders = (0..of.edges().len() as u32).filter(is_border).count()
            + refined.edges.iter().filter(|e| is_border(e)).count();
        let surface = Triangulation::new(refined.rest_m.clone(), refined.triangles.clone()).unwrap();
        let mut springs: Vec<[u32; 2]> =
            refined.springs.iter().map(|(n, _)| [n[0].min(n[1]), n[0].max(n[1])]).collect();
        springs.sort_unstable();
        let edges: Vec<[u32; 2]> = surface.edges().iter().map(|edge| edge.nodes).collect();
        assert_eq!(springs, edges, "every edge has one spring");
        assert_eq!(surface.edges().iter().filter(|edge| edge.is_border()).count(), borders);
    }

    #[test]
    fn a_partly_refined_surface_has_no_cracks() {
        let (patch, ball) = (hexagon(4, 0.03), sphere(3, 0.05));
        is_whole(&patch, &about(&patch, &[0], 2));
        // On the border, and about two vertices whose regions touch, overlap, or leave single triangles between them.
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
