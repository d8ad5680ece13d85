//! Walls coarser than the skin: a skin may be cut much finer than what moves it, and walls need no more triangles than that.
//!
//! A vertex is *collapsed* to a neighbour, shortest edge first, until edges are about as long as wanted. The vertices that remain are
//! vertices of the skin, so whatever carries the skin carries the walls. A collapse is left out where it would change what the surface
//! is (the neighbours that the two ends have in common must be the two opposite their edge: the link condition of Dey and others 1999), where
//! a triangle would turn far, become a sliver, or have too long an edge, or where any vertex that went would be farther from the
//! surface than is allowed. Skin that has an end, or meets itself along an edge, stays as it is there.
use super::rest::twice_area_m2;
use crate::contact::triangle::closest_point;
use glam::DVec3;
use std::{cmp::Reverse, collections::BinaryHeap};

/// Length over the wanted one below which edges are collapsed, and above which none may be made.
const SHORT: f64 = 0.8;
const LONG: f64 = 1.5;
/// Distance over the wanted length of an edge up to which what went may be from the surface that is left.
const DEVIATION: f64 = 0.1;
/// Cosine of the largest angle by which one collapse may turn a triangle.
const TURNED: f64 = 0.6;
/// Height over longest edge below which a triangle is a sliver.
const SLIVER: f64 = 0.25;
/// How often at most short edges are offered: what may not be collapsed may be once its neighbours were.
const PASSES: usize = 4;

/// Returns fewer triangles of the same vertices, at positions (m), with edges of about `edge_m`.
pub(crate) fn coarse_walls(positions_m: &[DVec3], triangles: &[[u32; 3]], edge_m: f64) -> Vec<[u32; 3]> {
    let mut walls = Coarsening::new(positions_m, triangles, edge_m);
    for _ in 0..PASSES {
        walls.offer_all();
        let mut is_done = true;
        while let Some(Reverse((_, from, to))) = walls.short.pop() {
            is_done &= !walls.collapse(from, to);
        }
        if is_done {
            break;
        }
    }
    walls.triangles.into_iter().flatten().collect()
}

/// A surface that becomes coarser.
struct Coarsening<'a> {
    positions_m: &'a [DVec3],
    edge_m: f64,
    /// Triangles; `None` of those that are gone.
    triangles: Vec<Option<[u32; 3]>>,
    /// Triangles around each vertex.
    around: Vec<Vec<u32>>,
    /// Vertices that are gone, by the triangle that they are nearest to.
    gone: Vec<Vec<u32>>,
    /// Short edges, by the bits of their length (m), which grow with it, from the vertex that may go to the other.
    short: BinaryHeap<Reverse<(u64, u32, u32)>>,
}

impl<'a> Coarsening<'a> {
    fn new(positions_m: &'a [DVec3], triangles: &[[u32; 3]], edge_m: f64) -> Self {
        let mut around = vec![Vec::new(); positions_m.len()];
        for (triangle, corners) in (0..).zip(triangles) {
            for &corner in corners {
                around[corner as usize].push(triangle);
            }
        }
        Self {
            positions_m,
            edge_m,
            triangles: triangles.iter().copied().map(Some).collect(),
            around,
            gone: vec![Vec::new(); triangles.len()],
            short: BinaryHeap::new(),
        }
    }

    /// Offers all short edges.
    fn offer_all(&mut self) {
        for triangle in 0..self.triangles.len() {
            let Some([a, b, c]) = self.triangles[triangle] else { continue };
            // On a closed surface the neighbour beyond an edge passes it the other way round.
            for (from, to) in [(a, b), (b, c), (c, a)] {
                self.offer(from, to);
            }
        }
    }

    fn at(&self, vertex: u32) -> DVec3 {
        self.positions_m[vertex as usize]
    }

    /// Notes that an edge may be collapsed to its end, if it is short.
    fn offer(&mut self, from: u32, to: u32) {
        let length_m = self.at(from).distance(self.at(to));
        if length_m < SHORT * self.edge_m {
            self.short.push(Reverse((length_m.to_bits(), from, to)));
        }
    }

    /// Returns the triangles around a vertex, with their corners.
    fn fan(&self, vertex: u32) -> impl Iterator<Item = (u32, [u32; 3])> + '_ {
        let corners = |&triangle: &u32| self.triangles[triangle as usize].map(|corners| (triangle, corners));
        self.around[vertex as usize].iter().filter_map(corners)
    }

    /// Returns the neighbours of a vertex, ascending.
    fn neighbours(&self, vertex: u32) -> Vec<u32> {
        let mut all: Vec<u32> = self.fan(vertex).flat_map(|(_, corners)| corners).filter(|n| *n != vertex).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Collapses `from` to its neighbour `to`, if they are neighbours and it may be. Returns whether it was.
    fn collapse(&mut self, from: u32, to: u32) -> bool {
        let (fan, neighbours): (Vec<_>, _) = (self.fan(from).collect(), self.neighbours(from));
        // Around a vertex inside a surface there are as many triangles as neighbours.
        if neighbours.len() != fan.len() || neighbours.binary_search(&to).is_err() {
            return false;
        }
        let of_other = self.neighbours(to);
        let has = |corners: &[u32; 3]| corners.contains(&to);
        let in_common = neighbours.iter().filter(|n| of_other.binary_search(n).is_ok()).count();
        if in_common != 2 || fan.iter().filter(|(_, corners)| has(corners)).count() != 2 {
            return false;
        }
        let moved = |corners: [u32; 3]| corners.map(|corner| if corner == from { to } else { corner });
        let left = || fan.iter().filter(|(_, corners)| !has(corners));
        let worst = fan.iter().map(|(_, corners)| self.roundness(*corners)).fold(f64::INFINITY, f64::min);
        if !left().all(|(_, corners)| self.may_become(*corners, moved(*corners), worst.min(SLIVER))) {
            return false;
        }
        let becomes: Vec<(u32, [u32; 3])> = left().map(|(triangle, corners)| (*triangle, moved(*corners))).collect();
        let Some(nearest) = self.nearest(fan.iter().map(|(triangle, _)| *triangle), from, &becomes) else {
            return false;
        };
        for (triangle, corners) in &fan {
            self.gone[*triangle as usize].clear();
            self.triangles[*triangle as usize] = None;
            for corner in corners {
                self.around[*corner as usize].retain(|other| other != triangle);
            }
        }
        for (triangle, corners) in becomes {
            self.triangles[triangle as usize] = Some(corners);
            for corner in corners {
                self.around[corner as usize].push(triangle);
            }
        }
        for (vertex, triangle) in nearest {
            self.gone[triangle as usize].push(vertex);
        }
        for neighbour in neighbours.into_iter().filter(|n| *n != to && of_other.binary_search(n).is_err()) {
            self.offer(to, neighbour);
            self.offer(neighbour, to);
        }
        true
    }

    /// Returns the height of a triangle over its longest edge.
    fn roundness(&self, corners: [u32; 3]) -> f64 {
        let corners_m = corners.map(|corner| self.at(corner));
        let longest_m = longest_m(corners_m);
        twice_area_m2(corners_m).length() / (longest_m * longest_m)
    }

    /// Returns whether a triangle may become another, which has to be as round as that.
    fn may_become(&self, before: [u32; 3], after: [u32; 3], roundness: f64) -> bool {
        let [before_m, after_m] = [before, after].map(|corners| corners.map(|corner| self.at(corner)));
        let [was, is] = [before_m, after_m].map(|corners| twice_area_m2(corners).normalize_or_zero());
        longest_m(after_m) <= LONG * self.edge_m && self.roundness(after) >= roundness && was.dot(is) >= TURNED
    }

    /// Returns of the vertex that goes, and of those that went from a fan of triangles before, which of those left each is nearest
    /// to, or `None` where one would be too far from all of them.
    fn nearest(
        &self,
        fan: impl Iterator<Item = u32>,
        goes: u32,
        becomes: &[(u32, [u32; 3])],
    ) -> Option<Vec<(u32, u32)>> {
        let left_m = becomes.iter().map(|(triangle, corners)| (*triangle, corners.map(|corner| self.at(corner))));
        let left_m: Vec<(u32, [DVec3; 3])> = left_m.collect();
        let most_sq = (DEVIATION * self.edge_m).powi(2);
        let gone = fan.flat_map(|triangle| &self.gone[triangle as usize]).copied().chain([goes]);
        gone.map(|vertex| {
            let y = self.at(vertex);
            let distance_sq = |corners_m: [DVec3; 3]| y.distance_squared(closest_point(y, corners_m));
            let each = left_m.iter().map(|(triangle, corners_m)| (distance_sq(*corners_m), *triangle));
            let (least_sq, triangle) = each.min_by(|one, other| one.0.total_cmp(&other.0))?;
            (least_sq <= most_sq).then_some((vertex, triangle))
        })
        .collect()
    }
}

fn longest_m([a, b, c]: [DVec3; 3]) -> f64 {
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::Surface,
        testing::{Random, sphere, tet_box},
    };
    use std::collections::BTreeMap;

    /// Returns how often each edge is passed from one end to the other, and the other way round.
    fn passes(triangles: &[[u32; 3]]) -> BTreeMap<(u32, u32), u32> {
        let mut passes = BTreeMap::new();
        for &[a, b, c] in triangles {
            for edge in [(a, b), (b, c), (c, a)] {
                *passes.entry(edge).or_default() += 1;
            }
        }
        passes
    }

    /// Asserts that a surface is closed, each edge passed once in each sense, and of as many parts less handles as so many.
    fn assert_closed(triangles: &[[u32; 3]], euler: i64) {
        let passes = passes(triangles);
        assert!(passes.iter().all(|(&(a, b), &times)| times == 1 && passes.get(&(b, a)) == Some(&1)));
        let mut vertices: Vec<u32> = triangles.iter().flatten().copied().collect();
        vertices.sort_unstable();
        vertices.dedup();
        assert_eq!(vertices.len() as i64 - passes.len() as i64 / 2 + triangles.len() as i64, euler);
    }

    fn volume_m3(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        let corners = triangles.iter().map(|corners| corners.map(|corner| positions_m[corner as usize]));
        corners.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    fn mean_edge_m(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        let edges = passes(triangles);
        let length = |&(a, b): &(u32, u32)| positions_m[a as usize].distance(positions_m[b as usize]);
        edges.keys().map(length).sum::<f64>() / edges.len() as f64
    }

    /// Asserts that no vertex is farther from the surface than is allowed.
    fn assert_near(positions_m: &[DVec3], triangles: &[[u32; 3]], edge_m: f64) {
        for &y in positions_m {
            let corners_m = |corners: &[u32; 3]| corners.map(|corner| positions_m[corner as usize]);
            let distances_m = triangles.iter().map(|corners| y.distance(closest_point(y, corners_m(corners))));
            let least_m = distances_m.fold(f64::INFINITY, f64::min);
            assert!(least_m <= DEVIATION * edge_m * (1.0 + 1e-9), "{least_m}");
        }
    }

    /// Two sides of a wall thinner than an edge of its own stay apart, and each is as round as it was.
    #[test]
    fn a_shell_cut_finely_keeps_its_sides_and_loses_most_of_its_triangles() {
        let (points, triangles) = sphere(5);
        let count = points.len() as u32;
        let mut random = Random(3);
        let noisy: Vec<DVec3> = points.iter().map(|p| *p * (1.0 + 2e-3 * random.vector().x)).collect();
        let positions: Vec<DVec3> = noisy.iter().copied().chain(noisy.iter().map(|p| *p * 0.9)).collect();
        let inner = triangles.iter().map(|&[a, b, c]| [a + count, c + count, b + count]);
        let triangles: Vec<[u32; 3]> = triangles.iter().copied().chain(inner).collect();
        for edge_m in [0.1, 0.2, 0.3] {
            let walls = coarse_walls(&positions, &triangles, edge_m);
            assert_closed(&walls, 4);
            assert!(walls.iter().all(|corners| corners.iter().all(|c| (*c < count) == (corners[0] < count))));
            assert_near(&positions, &walls, edge_m);
            let mean_m = mean_edge_m(&positions, &walls);
            assert!(mean_m > 0.8 * edge_m && mean_m < 1.3 * edge_m, "{mean_m} for {edge_m}");
            let kept = volume_m3(&positions, &walls) / volume_m3(&positions, &triangles);
            println!("{edge_m}: {} of {} triangles, {mean_m:.3}, volume {kept:.3}", walls.len(), triangles.len());
            assert!((kept - 1.0).abs() < 0.05, "{kept}");
        }
    }

    #[test]
    fn corners_and_edges_of_a_box_stay_where_they_are() {
        let mesh = tet_box(DVec3::ZERO, DVec3::new(2.0, 1.0, 1.0), [24, 12, 12]);
        let surface = Surface::of(&mesh).unwrap();
        let triangles: Vec<[u32; 3]> = (0..surface.triangles.len()).map(|t| surface.triangle_nodes(t)).collect();
        let walls = coarse_walls(mesh.positions_m(), &triangles, 0.3);
        assert_closed(&walls, 2);
        assert!(5 * walls.len() < triangles.len(), "{} of {}", walls.len(), triangles.len());
        let kept = volume_m3(mesh.positions_m(), &walls) / 2.0;
        assert!((kept - 1.0).abs() < 0.02, "{kept}");
    }

    #[test]
    fn a_skin_with_an_end_keeps_it_and_one_as_coarse_as_wanted_is_as_it_was() {
        let (points, triangles) = sphere(4);
        let is_end = |vertex: u32| points[vertex as usize].z < 0.0;
        let open: Vec<[u32; 3]> =
            triangles.iter().copied().filter(|corners| !corners.iter().all(|c| is_end(*c))).collect();
        let ends = |triangles: &[[u32; 3]]| -> Vec<(u32, u32)> {
            let passes = passes(triangles);
            passes.keys().copied().filter(|&(a, b)| !passes.contains_key(&(b, a))).collect()
        };
        let walls = coarse_walls(&points, &open, 0.3);
        assert!(4 * walls.len() < 3 * open.len() && !ends(&open).is_empty());
        assert_eq!(ends(&walls), ends(&open));
        assert_eq!(coarse_walls(&points, &open, 0.05), open);
    }
}
