//! Triangles whose long edges are halved, neighbours alike, until none is longer than wanted.
use super::FineSurface;
use glam::DVec3;
use std::collections::HashMap;

/// Edges so little longer than wanted, relatively, are left: they are rounding.
const ROUNDING: f64 = 1e-9;
/// More rounds than any body's size over any spacing needs: each halves the edges.
const MOST_ROUNDS: usize = 40;

/// Halves edges longer than `longest_m`. `put` says where the middle of an edge goes: it is told what the triangles on both sides came from,
/// and the middle (m).
pub(crate) fn refine(mut surface: FineSurface, longest_m: f64, put: &dyn Fn([u32; 2], DVec3) -> DVec3) -> FineSurface {
    for _ in 0..MOST_ROUNDS {
        let halved = Halved::of(&surface, longest_m * (1.0 + ROUNDING));
        if halved.edges.is_empty() {
            break;
        }
        for (edge, origins) in &halved.edges {
            let [a, b] = edge.map(|vertex| surface.positions_m[vertex as usize]);
            surface.positions_m.push(put(*origins, 0.5 * (a + b)));
        }
        let mut triangles = Vec::with_capacity(2 * surface.triangles.len());
        let mut origins = Vec::with_capacity(2 * surface.triangles.len());
        for (triangle, origin) in surface.triangles.iter().zip(&surface.origins) {
            halved.split(*triangle, &surface.positions_m, &mut triangles);
            origins.resize(triangles.len(), *origin);
        }
        (surface.triangles, surface.origins) = (triangles, origins);
    }
    surface
}

/// The long edges of a surface, numbered in the order of its triangles.
struct Halved {
    /// Ends, and what the triangles on both sides came from.
    edges: Vec<([u32; 2], [u32; 2])>,
    /// Vertex in the middle. Looked up only, never iterated: the order of work stays fixed.
    middles: HashMap<[u32; 2], u32>,
}

impl Halved {
    fn of(surface: &FineSurface, longest_m: f64) -> Self {
        let FineSurface { positions_m, triangles, origins } = surface;
        let mut halved = Self { edges: Vec::new(), middles: HashMap::new() };
        let first = positions_m.len() as u32;
        for (&[a, b, c], &origin) in triangles.iter().zip(origins) {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                if positions_m[i as usize].distance(positions_m[j as usize]) <= longest_m {
                    continue;
                }
                let edge = [i.min(j), i.max(j)];
                if let Some(&middle) = halved.middles.get(&edge) {
                    halved.edges[(middle - first) as usize].1[1] = origin;
                } else {
                    halved.middles.insert(edge, first + halved.edges.len() as u32);
                    halved.edges.push((edge, [origin; 2]));
                }
            }
        }
        halved
    }

    fn middle(&self, i: u32, j: u32) -> Option<u32> {
        self.middles.get(&[i.min(j), i.max(j)]).copied()
    }

    fn split(&self, triangle: [u32; 3], positions_m: &[DVec3], into: &mut Vec<[u32; 3]>) {
        let turned = |by: usize| [0, 1, 2].map(|corner| triangle[(corner + by) % 3]);
        let middles = |[a, b, c]: [u32; 3]| [self.middle(a, b), self.middle(b, c), self.middle(c, a)];
        for by in 0..3 {
            let [a, b, c] = turned(by);
            match middles([a, b, c]) {
                [None, None, None] => into.push([a, b, c]),
                [Some(ab), Some(bc), Some(ca)] => into.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]),
                [Some(ab), None, None] => into.extend([[a, ab, c], [ab, b, c]]),
                [Some(ab), Some(bc), None] => {
                    into.push([ab, b, bc]);
                    let length = |i: u32, j: u32| positions_m[i as usize].distance(positions_m[j as usize]);
                    if length(a, bc) < length(ab, c) {
                        into.extend([[a, ab, bc], [a, bc, c]]);
                    } else {
                        into.extend([[a, ab, c], [ab, bc, c]]);
                    }
                }
                _ => continue,
            }
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::bodies::hybrid::Skin;

    fn longest_m(surface: &FineSurface) -> f64 {
        let edges = surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        edges
            .map(|[a, b]| surface.positions_m[a as usize].distance(surface.positions_m[b as usize]))
            .fold(0.0, f64::max)
    }

    /// A tetrahedron with edges of very different length.
    fn spike() -> FineSurface {
        FineSurface {
            positions_m: vec![DVec3::ZERO, DVec3::X * 0.1, DVec3::Y * 0.02, DVec3::Z * 0.31],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            origins: vec![0, 1, 2, 3],
        }
    }

    #[test]
    fn flat_triangles_are_refined_without_a_gap_and_keep_their_volume() {
        let fine = refine(spike(), 6e-3, &|_, middle| middle);
        assert!(longest_m(&fine) <= 6e-3 * 1.000_001, "{}", longest_m(&fine));
        let skin = Skin::new(fine.positions_m.clone(), fine.triangles.clone()).unwrap();
        assert!((skin.volume_m3() / (0.1 * 0.02 * 0.31 / 6.0) - 1.0).abs() < 1e-12);
        for &triangle in &fine.triangles_from(|origin| origin == 1) {
            assert!(fine.triangles[triangle as usize].iter().all(|&v| fine.positions_m[v as usize].y == 0.0));
        }
        assert_eq!(fine, refine(spike(), 6e-3, &|_, middle| middle));
    }

    #[test]
    fn middles_go_where_they_are_put() {
        let corners =
            [DVec3::ONE, DVec3::new(-1.0, -1.0, 1.0), DVec3::new(-1.0, 1.0, -1.0), DVec3::new(1.0, -1.0, -1.0)];
        let coarse = FineSurface {
            positions_m: corners.map(DVec3::normalize).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
            origins: vec![0; 4],
        };
        let ball = refine(coarse, 0.05, &|_, middle| middle.normalize());
        assert!(longest_m(&ball) < 0.0501);
        let skin = Skin::new(ball.positions_m, ball.triangles).unwrap();
        let sphere_m3 = 4.0 / 3.0 * std::f64::consts::PI;
        assert!((skin.volume_m3() / sphere_m3 - 1.0).abs() < 1e-3, "{}", skin.volume_m3() / sphere_m3);
    }
}
