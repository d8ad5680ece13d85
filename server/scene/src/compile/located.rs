//! Where a point asked for lies in the body.
use glam::DVec3;
use palpate_physics::{contact::closest_weights, mesh::TetMesh};

/// A point of the body as weights of nodes: inside a tet, or the nearest on the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Located {
    /// Nodes; unused corners have weight 0.
    pub(crate) nodes: [u32; 4],
    /// Barycentric weights, sum 1.
    pub(crate) weights: [f64; 4],
    /// Distance (m) from the point asked for: 0 inside the body.
    pub(crate) distance_m: f64,
}

impl Located {
    /// Interpolates a nodal field.
    pub(crate) fn of(&self, field: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.weights).map(|(&node, weight)| field[node as usize] * weight).sum()
    }

    /// The nearest point of triangles.
    pub(crate) fn nearest(positions_m: &[DVec3], triangles: impl Iterator<Item = [u32; 3]>, point_m: DVec3) -> Self {
        let candidates = triangles.map(|triangle| Self::on_triangle(positions_m, triangle, point_m));
        candidates.fold(Self { nodes: [0; 4], weights: [1.0, 0.0, 0.0, 0.0], distance_m: f64::INFINITY }, |a, b| {
            if b.distance_m < a.distance_m { b } else { a }
        })
    }

    pub(crate) fn inside(mesh: &TetMesh, tet: usize, point_m: DVec3) -> Option<Self> {
        const ROUNDING: f64 = 1e-12;
        let corner = mesh.corners_m(tet)[0];
        let local = mesh.edge_matrix_m(tet).inverse() * (point_m - corner);
        let weights = [1.0 - local.x - local.y - local.z, local.x, local.y, local.z];
        let inside = weights.iter().all(|&w| w >= -ROUNDING);
        inside.then(|| Self { nodes: mesh.tets()[tet], weights, distance_m: 0.0 })
    }

    pub(crate) fn on_triangle(positions_m: &[DVec3], triangle: [u32; 3], point_m: DVec3) -> Self {
        let [a, b, c] = triangle.map(|node| positions_m[node as usize]);
        let w = closest_weights(point_m, [a, b, c]);
        let closest = a * w[0] + b * w[1] + c * w[2];
        let nodes = [triangle[0], triangle[1], triangle[2], triangle[2]];
        Self { nodes, weights: [w[0], w[1], w[2], 0.0], distance_m: closest.distance(point_m) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::body::BodyMesh;

    fn unit() -> BodyMesh {
        let corners = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        BodyMesh::Tets(TetMesh::new(corners, vec![[0, 1, 2, 3]]).unwrap())
    }

    const BOUNDARY: [[u32; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

    #[test]
    fn a_point_inside_is_reproduced_exactly() {
        let mesh = unit();
        let p = DVec3::new(0.2, 0.3, 0.1);
        let point = mesh.locate(BOUNDARY.into_iter(), p);
        assert_eq!(point.distance_m, 0.0);
        assert!((point.of(mesh.positions_m()) - p).length() < 1e-15);
    }

    #[test]
    fn a_point_outside_takes_the_nearest_of_face_edge_and_corner() {
        let mesh = unit();
        for (p, nearest) in [
            (DVec3::new(0.25, 0.25, -1.0), DVec3::new(0.25, 0.25, 0.0)),
            (DVec3::new(0.5, -1.0, -1.0), DVec3::new(0.5, 0.0, 0.0)),
            (DVec3::new(3.0, 0.0, 0.0), DVec3::X),
        ] {
            let point = mesh.locate(BOUNDARY.into_iter(), p);
            assert!((point.of(mesh.positions_m()) - nearest).length() < 1e-15, "{p}");
            assert!((point.distance_m - p.distance(nearest)).abs() < 1e-15);
            assert!((point.weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        }
    }
}
