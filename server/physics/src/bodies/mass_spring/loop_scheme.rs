//! Loop's scheme: the positions of the refined surface's vertices.
//!
//! A vertex of type 1 has `k` neighbours `p_j`, or on the boundary its two neighbours `b_1, b_2` there; a vertex of
//! type 2 lies on the edge `a b` with the corners `c, d` across:
//! ```text
//! p′ = (1 − k β) p + β Σ_j p_j,   β = (5/8 − (3/8 + ¼ cos 2π/k)²)/k        on a boundary p′ = ¾ p + ⅛ (b_1 + b_2)
//! e  = ⅜ (a + b) + ⅛ (c + d)                                               on a boundary e  = ½ (a + b)
//! ```
//! The curvature of the limit surface is continuous, except at *extraordinary* vertices inside, whose `k` is not 6;
//! there its tangent plane is continuous.
use super::triangulation::{Edge, NONE, Triangulation};
use glam::DVec3;
use std::f64::consts::TAU;

/// Coarse vertices with their weights in a vertex of the refined surface; the weights sum to 1.
pub type Mask = Vec<(u32, f64)>;

/// Returns `β` of a vertex with `k` neighbours.
pub fn beta(k: usize) -> f64 {
    let k = k as f64;
    (0.625 - (0.375 + 0.25 * (TAU / k).cos()).powi(2)) / k
}

/// Returns the mask of the vertex of type 1 that belongs to a coarse vertex.
pub fn vertex_mask(surface: &Triangulation, vertex: u32) -> Mask {
    let on_boundary = |edge: &&u32| surface.edges()[**edge as usize].is_boundary();
    let boundary_edges: Vec<u32> = surface.edges_at(vertex).iter().filter(on_boundary).copied().collect();
    if !boundary_edges.is_empty() {
        let ends = boundary_edges.into_iter().map(|edge| (surface.other_end(edge, vertex), 0.125));
        return std::iter::once((vertex, 0.75)).chain(ends).collect();
    }
    let k = surface.edges_at(vertex).len();
    let beta = beta(k);
    std::iter::once((vertex, 1.0 - k as f64 * beta)).chain(surface.neighbours(vertex).map(|n| (n, beta))).collect()
}

/// Returns the mask of the vertex of type 2 that belongs to a coarse edge.
pub fn edge_mask(edge: &Edge) -> Mask {
    let [a, b] = edge.nodes;
    match edge.opposite {
        [_, NONE] => vec![(a, 0.5), (b, 0.5)],
        [c, d] => vec![(a, 0.375), (b, 0.375), (c, 0.125), (d, 0.125)],
    }
}

/// Returns the weighted sum of a mask's points.
pub fn apply(mask: &[(u32, f64)], of: &[DVec3]) -> DVec3 {
    mask.iter().map(|&(vertex, weight)| of[vertex as usize] * weight).sum()
}

/// Returns positions and triangles of the whole surface refined once. Vertices of type 1 come in their order, then
/// those of type 2 in that of edges; each triangle gives those at its three corners, then the middle one.
pub fn refined(surface: &Triangulation) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (vertices, p) = (surface.positions_m().len() as u32, surface.positions_m());
    let of_vertices = (0..vertices).map(|vertex| apply(&vertex_mask(surface, vertex), p));
    let of_edges = surface.edges().iter().map(|edge| apply(&edge_mask(edge), p));
    let of_triangle = |triangle: u32| {
        let [a, b, c] = surface.triangles()[triangle as usize];
        let [ab, bc, ca] = surface.edges_of(triangle).map(|edge| vertices + edge);
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    (of_vertices.chain(of_edges).collect(), (0..surface.triangles().len() as u32).flat_map(of_triangle).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::testing::{hexagon, sphere};

    #[test]
    fn masks_sum_to_one_and_are_the_schemes() {
        assert!((beta(6) - 1.0 / 16.0).abs() < 1e-15);
        assert!((beta(3) - 3.0 / 16.0).abs() < 1e-15);
        let (ball, patch) = (sphere(1, 1.0), hexagon(3, 1.0));
        for surface in [&ball, &patch] {
            let of_vertices = (0..surface.positions_m().len() as u32).map(|v| vertex_mask(surface, v));
            for mask in of_vertices.chain(surface.edges().iter().map(edge_mask)) {
                assert!((mask.iter().map(|(_, weight)| weight).sum::<f64>() - 1.0).abs() < 1e-15);
                assert!(mask.iter().all(|(_, weight)| *weight > 0.0));
            }
        }
        // Four neighbours at the ball's first vertices, six at the others.
        assert_eq!(vertex_mask(&ball, 0).len(), 5);
        assert_eq!(vertex_mask(&ball, 6).len(), 7);
        // The patch's corner is on a boundary.
        assert_eq!(vertex_mask(&patch, 36).len(), 3);
    }

    #[test]
    fn a_flat_regular_patch_stays_where_it_is_and_new_vertices_lie_between() {
        let patch = hexagon(4, 0.03);
        let (fine, triangles) = refined(&patch);
        assert_eq!(triangles.len(), 4 * patch.triangles().len());
        for vertex in (0..patch.positions_m().len() as u32).filter(|&v| !patch.is_boundary(v)) {
            assert!(fine[vertex as usize].distance(patch.positions_m()[vertex as usize]) < 1e-15);
        }
        for (edge, at) in patch.edges().iter().zip(&fine[patch.positions_m().len()..]) {
            let [a, b] = edge.nodes.map(|n| patch.positions_m()[n as usize]);
            assert!(at.distance((a + b) * 0.5) < 1e-15);
        }
        let again = Triangulation::new(fine, triangles).unwrap();
        assert_eq!(again.edges().len(), 2 * patch.edges().len() + 3 * patch.triangles().len());
    }

    /// The limit of an octahedron is a smooth ball: when it is refined again and again, angles between neighbours tend
    /// to zero, at extraordinary vertices too.
    #[test]
    fn refining_again_and_again_leads_to_a_smooth_surface() {
        let mut surface = sphere(0, 1.0);
        let mut sharpest = Vec::new();
        for _ in 0..4 {
            let (p, t) = refined(&surface);
            surface = Triangulation::new(p, t).unwrap();
            let normal = |t: u32| {
                let [a, b, c] = surface.triangles()[t as usize].map(|v| surface.positions_m()[v as usize]);
                (b - a).cross(c - a).normalize()
            };
            let bend = |edge: &Edge| normal(edge.triangles[0]).angle_between(normal(edge.triangles[1]));
            sharpest.push(surface.edges().iter().map(bend).fold(0.0, f64::max));
        }
        // Angles are halved each time, once the first corners are gone.
        assert!(
            sharpest.windows(2).all(|pair| pair[1] < 0.7 * pair[0]) && sharpest[3] < 0.52 * sharpest[2],
            "{sharpest:?}"
        );
    }
}
