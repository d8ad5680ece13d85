//! Blending between the coarse and the refined surface: every triangle has a *level* `s`, 0 where it is coarse and 1
//! where it is refined.
//!
//! The springs of both surfaces act by weight, so that energy and force change without a step. The level `s_e` of an
//! edge is the larger one of its two triangles, the level `s_v` of a vertex the largest one of the triangles around it.
//! The stiffnesses are
//! ```text
//! coarse edge           (1 − s_e) K_m          anchor of a coarse vertex   (1 − s_v) K_h + s_v K′_h
//! its two halves        s_e K′_m               anchor of type 2            s_e K′_h
//! inside a triangle     s_t K′_m               crack of a triangle         (s_e − s_t)⁺ K′_m
//! tie of type 2         (1 − s_e) K′_h: ½ k |u_e − ½ (u_a + u_b)|², a and b its ends
//! ```
//! The *tie* keeps a node of low level near the coarse surface: together with its anchor spring it has the same
//! stiffness at every level. Without it, blended springs alone would leave a mass that swings ever slower until it is
//! removed. A level follows `s = 3 w² − 2 w³` while its progress `w` is linear in time, so that the force has no kink
//! where blending begins and ends.
//!
//! At levels 0 and 1 of a [`super::Region`] the springs are those of [`super::Refined::net`]. Each level moves by
//! itself, so that regions may grow, shrink and overlap while they are blended.
use super::{
    region::{Constants, Region},
    triangulation::{NONE, Triangulation},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Levels of the triangles that are not coarse.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Levels {
    /// Triangles, ascending, each with its progress `w`, which is larger than 0.
    of: Vec<(u32, f64)>,
}

/// Returns the level `s` at a progress `w` in 0..=1.
fn smooth(progress: f64) -> f64 {
    progress * progress * (3.0 - 2.0 * progress)
}

/// Returns the largest change of a level while its progress changes by `step`.
pub fn steepest(step: f64) -> f64 {
    (1.5 * step).min(1.0)
}

/// A spring that blending adds to those of the coarse surface; one of negative stiffness takes from them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Added {
    /// A spring between two nodes.
    Spring {
        /// Its ends.
        nodes: [u32; 2],
        /// Rest length `r` (m).
        rest_length_m: f64,
        /// Stiffness `k` (N/m).
        stiffness_n_per_m: f64,
    },
    /// An anchor spring from a node to its rest position.
    Anchor {
        /// The node.
        node: u32,
        /// Stiffness `K_h` (N/m).
        stiffness_n_per_m: f64,
    },
    /// A tie from an edge's node to where the displacements of the edge's ends would have it.
    Tie {
        /// The node, then the two ends.
        nodes: [u32; 3],
        /// Stiffness `k` (N/m).
        stiffness_n_per_m: f64,
    },
}

impl Levels {
    /// Returns levels of a surface that is coarse everywhere, with room for so many triangles.
    pub fn with_room(triangles: usize) -> Self {
        Self { of: Vec::with_capacity(triangles) }
    }

    /// Returns levels of no surface that have the length of levels of so many triangles.
    pub fn filled(triangles: usize) -> Self {
        Self { of: vec![(0, 0.0); triangles] }
    }

    /// Returns the levels of a region that is completely refined.
    pub fn full(region: &Region) -> Self {
        Self { of: region.triangles().iter().map(|&triangle| (triangle, 1.0)).collect() }
    }

    /// Copies other levels. Nothing is allocated where there is room.
    pub fn copy_from(&mut self, other: &Self) {
        self.of.clone_from(&other.of);
    }

    /// Makes every triangle coarse. Nothing is allocated.
    pub fn clear(&mut self) {
        self.of.clear();
    }

    /// Returns the triangles that are not coarse, ascending, each with its progress.
    pub fn triangles(&self) -> &[(u32, f64)] {
        &self.of
    }

    /// Returns whether these may be levels of a surface of `triangles` triangles, at most `most` of which are not
    /// coarse.
    pub fn fit(&self, triangles: usize, most: usize) -> bool {
        let known =
            |&(triangle, progress): &(u32, f64)| (triangle as usize) < triangles && progress > 0.0 && progress <= 1.0;
        self.of.len() <= most && self.of.iter().all(known) && self.of.windows(2).all(|pair| pair[0].0 < pair[1].0)
    }

    fn progress(&self, triangle: u32) -> f64 {
        self.of.binary_search_by_key(&triangle, |of| of.0).map_or(0.0, |found| self.of[found].1)
    }

    /// Returns the level `s_t` of a triangle, which is 0 of [`NONE`].
    pub fn of_triangle(&self, triangle: u32) -> f64 {
        smooth(self.progress(triangle))
    }

    /// Returns the level `s_e` of an edge.
    pub fn of_edge(&self, surface: &Triangulation, edge: u32) -> f64 {
        let [one, other] = surface.edges()[edge as usize].triangles;
        self.of_triangle(one).max(self.of_triangle(other))
    }

    /// Returns the level `s_v` of a vertex.
    pub fn of_vertex(&self, surface: &Triangulation, vertex: u32) -> f64 {
        surface.triangles_at(vertex).iter().map(|&triangle| self.of_triangle(triangle)).fold(0.0, f64::max)
    }

    /// Moves every triangle's progress by up to `step`: towards 1 in the triangles of `refined`, which is ascending,
    /// and towards 0 in the others. Returns whether any progress changed. `next` is a buffer; nothing is allocated
    /// where both have room.
    pub fn advance(&mut self, refined: &[u32], step: f64, next: &mut Self) -> bool {
        next.of.clear();
        let mut changed = false;
        let (mut own, mut wanted) = (self.of.iter().peekable(), refined.iter().peekable());
        loop {
            let first = match (own.peek(), wanted.peek()) {
                (Some((triangle, _)), Some(&&want)) => want.min(*triangle),
                (Some((triangle, _)), None) => *triangle,
                (None, Some(&&want)) => want,
                (None, None) => break,
            };
            let level = own.next_if(|of| of.0 == first).map_or(0.0, |of| of.1);
            let target = if wanted.next_if(|&&want| want == first).is_some() { 1.0 } else { 0.0 };
            let now = level + (target - level).clamp(-step, step);
            changed |= now.to_bits() != level.to_bits();
            if now > 0.0 {
                next.of.push((first, now));
            }
        }
        std::mem::swap(self, next);
        changed
    }

    /// Calls `tell` once with every edge that has a node of type 2 now, and with its level `s_e`.
    pub fn for_each_edge(&self, surface: &Triangulation, mut tell: impl FnMut(u32, f64)) {
        for &(triangle, progress) in &self.of {
            for edge in surface.edges_of(triangle) {
                let [one, other] = surface.edges()[edge as usize].triangles;
                let across = if one == triangle { other } else { one };
                let beyond = self.progress(across);
                // The edge of two triangles that are not coarse is told for the first one.
                if beyond == 0.0 || triangle < across {
                    tell(edge, smooth(progress.max(beyond)));
                }
            }
        }
    }

    /// Calls `tell` once with every vertex of triangles that are not coarse, and with its level `s_v`.
    pub fn for_each_vertex(&self, surface: &Triangulation, mut tell: impl FnMut(u32, f64)) {
        for &(triangle, _) in &self.of {
            for vertex in surface.triangles()[triangle as usize] {
                let around = || surface.triangles_at(vertex).iter().filter(|&&t| self.progress(t) > 0.0);
                if around().next() == Some(&triangle) {
                    tell(vertex, self.of_vertex(surface, vertex));
                }
            }
        }
    }

    /// Calls `tell` with every spring that the levels add to a surface with the constants `coarse`, where the refined
    /// surface has the constants `fine`. A node of type 1 has the number of its vertex, a node of type 2 the number of
    /// vertices plus that of its edge. `fine_rest_m` are the rest positions (m) of all of them.
    pub fn for_each_added(
        &self,
        surface: &Triangulation,
        fine_rest_m: &[DVec3],
        coarse: &Constants,
        fine: &Constants,
        mut tell: impl FnMut(Added),
    ) {
        let vertices = surface.positions_m().len() as u32;
        let mut spring = |a: u32, b: u32, stiffness_n_per_m: f64| {
            if stiffness_n_per_m != 0.0 {
                let rest_length_m = fine_rest_m[a as usize].distance(fine_rest_m[b as usize]);
                tell(Added::Spring { nodes: [a, b], rest_length_m, stiffness_n_per_m });
            }
        };
        self.for_each_edge(surface, |number, level| {
            let edge = &surface.edges()[number as usize];
            let ([a, b], middle) = (edge.nodes, vertices + number);
            spring(a, b, -level * coarse.mesh_n_per_m);
            spring(a, middle, level * fine.mesh_n_per_m);
            spring(middle, b, level * fine.mesh_n_per_m);
            for (triangle, opposite) in edge.triangles.into_iter().zip(edge.opposite).filter(|(t, _)| *t != NONE) {
                let beyond = (level - self.of_triangle(triangle)).max(0.0);
                spring(middle, opposite, beyond * fine.mesh_n_per_m);
            }
        });
        for &(triangle, progress) in &self.of {
            let [ab, bc, ca] = surface.edges_of(triangle).map(|edge| vertices + edge);
            for [one, other] in [[ab, bc], [bc, ca], [ca, ab]] {
                spring(one, other, smooth(progress) * fine.mesh_n_per_m);
            }
        }
        self.for_each_edge(surface, |number, level| {
            let node = vertices + number;
            tell(Added::Anchor { node, stiffness_n_per_m: level * fine.anchor_n_per_m });
            if level < 1.0 {
                let [a, b] = surface.edges()[number as usize].nodes;
                tell(Added::Tie { nodes: [node, a, b], stiffness_n_per_m: (1.0 - level) * fine.anchor_n_per_m });
            }
        });
        self.for_each_vertex(surface, |node, level| {
            let stiffness_n_per_m = level * (fine.anchor_n_per_m - coarse.anchor_n_per_m);
            tell(Added::Anchor { node, stiffness_n_per_m });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::{
        AnchorLaw, Net, Refined, Spring,
        loop_scheme::refined,
        testing::{hexagon, sphere},
    };

    const OUTSIDE: Constants = Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 40.0 };
    const INSIDE: Constants = Constants { mesh_n_per_m: 45.0, anchor_n_per_m: 22.0 };

    /// Returns the coarse surface's springs with those that levels add, on all nodes of the surface refined everywhere.
    fn blended(surface: &Triangulation, levels: &Levels) -> Net {
        let rest_m = refined(surface).0;
        let coarse = surface.edges().iter().map(|edge| {
            let [a, b] = edge.nodes.map(|node| rest_m[node as usize]);
            Spring { nodes: edge.nodes, rest_length_m: a.distance(b), stiffness_n_per_m: OUTSIDE.mesh_n_per_m }
        });
        let mut springs: Vec<Spring> = coarse.collect();
        let mut anchor_n_per_m = vec![0.0; rest_m.len()];
        anchor_n_per_m[..surface.positions_m().len()].fill(OUTSIDE.anchor_n_per_m);
        levels.for_each_added(surface, &rest_m, &OUTSIDE, &INSIDE, |added| match added {
            Added::Spring { nodes, rest_length_m, stiffness_n_per_m } => {
                springs.push(Spring { nodes, rest_length_m, stiffness_n_per_m });
            }
            Added::Anchor { node, stiffness_n_per_m } => anchor_n_per_m[node as usize] += stiffness_n_per_m,
            // Whoever is told has them apart from the springs.
            Added::Tie { .. } => {}
        });
        Net { rest_m, springs, anchor_n_per_m, anchor_law: AnchorLaw::Linear }
    }

    fn shaken(rest_m: &[DVec3]) -> Vec<DVec3> {
        let wave = |p: &DVec3, phase: f64| (170.0 * p.x + 230.0 * p.y + 310.0 * p.z + phase).sin();
        rest_m.iter().map(|p| *p + DVec3::new(wave(p, 0.0), wave(p, 1.0), wave(p, 2.0)) * 2e-3).collect()
    }

    #[test]
    fn at_full_level_it_is_the_refined_surface() {
        let (patch, ball) = (hexagon(5, 0.03), sphere(2, 0.05));
        for (surface, centres) in [(&patch, vec![0]), (&patch, vec![0, 9]), (&patch, vec![60]), (&ball, vec![0, 20])] {
            for rings in 0..3 {
                let region = Region::rings(surface, &centres, rings);
                let fine_rest = refined(surface).0;
                let refined = Refined::new(surface, &region, &fine_rest);
                let (net, blended) = (refined.net(&OUTSIDE, &INSIDE), blended(surface, &Levels::full(&region)));
                let x = shaken(&blended.rest_m);
                let vertices = surface.positions_m().len();
                let of_edges = refined.edges.iter().map(|&edge| vertices + edge as usize);
                let nodes: Vec<usize> = (0..vertices).chain(of_edges).collect();
                let x_refined: Vec<DVec3> = nodes.iter().map(|&node| x[node]).collect();
                let (expected, found) = (net.forces_n(&x_refined), blended.forces_n(&x));
                let scale = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
                for (number, &node) in nodes.iter().enumerate() {
                    assert!(expected[number].distance(found[node]) < 1e-13 * scale, "{centres:?} {rings} {node}");
                }
                let total: f64 = found.iter().map(|f| f.length()).sum();
                let of_nodes: f64 = nodes.iter().map(|&node| found[node].length()).sum();
                assert!((total - of_nodes).abs() < 1e-13 * total, "nothing acts on nodes that are not there");
            }
        }
    }

    /// Energy follows the levels without a step, while one region is refined and another one that overlaps it is made
    /// coarse.
    #[test]
    fn levels_go_over_smoothly_and_end_where_they_should() {
        let patch = hexagon(5, 0.03);
        let [one, other] = [Region::rings(&patch, &[0], 2), Region::rings(&patch, &[9], 1)];
        let wanted: Vec<u32> = other.triangles().iter().copied().collect();
        let mut levels = Levels::full(&one);
        let mut next = Levels::with_room(100);
        let x = shaken(&refined(&patch).0);
        let energy = |levels: &Levels| blended(&patch, levels).energy_j(&x);
        let [start, end] = [&one, &other].map(|region| energy(&Levels::full(region)));
        let (mut before, mut steps) = (start, 0);
        while levels.advance(&wanted, 0.02, &mut next) {
            let now = energy(&levels);
            assert!((now - before).abs() < 0.075 * (start - end).abs().max(0.1 * start), "{before} {now}");
            assert!(levels.triangles().windows(2).all(|pair| pair[0].0 < pair[1].0));
            (before, steps) = (now, steps + 1);
        }
        assert_eq!(levels, Levels::full(&other));
        assert!((50..=52).contains(&steps) && (before - end).abs() < 1e-15, "{steps}");
    }

    #[test]
    fn edges_and_vertices_are_told_once() {
        let ball = sphere(2, 0.05);
        let mut levels = Levels::full(&Region::rings(&ball, &[0, 30], 2));
        for (number, of) in levels.of.iter_mut().enumerate() {
            of.1 = 0.1 + 0.9 * (number as f64).sin().abs();
        }
        let (mut edges, mut vertices) = (Vec::new(), Vec::new());
        levels.for_each_edge(&ball, |edge, level| edges.push((edge, level)));
        levels.for_each_vertex(&ball, |vertex, level| vertices.push((vertex, level)));
        for told in [&mut edges, &mut vertices] {
            told.sort_by_key(|of| of.0);
        }
        let all_edges = (0..ball.edges().len() as u32).map(|edge| (edge, levels.of_edge(&ball, edge)));
        let all_vertices = (0..ball.positions_m().len() as u32).map(|vertex| (vertex, levels.of_vertex(&ball, vertex)));
        assert_eq!(edges, all_edges.filter(|of| of.1 > 0.0).collect::<Vec<_>>());
        assert_eq!(vertices, all_vertices.filter(|of| of.1 > 0.0).collect::<Vec<_>>());
    }
}
