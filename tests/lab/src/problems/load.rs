//! Loads as nodal forces: integrated over the rest surface with so much quadrature that the mesh alone is to blame for errors.
use super::{Action, body::TetBody};
use crate::reference::{bodies::Body as HexBody, grid::HexGrid, solid::surface_points};
use glam::DVec3;

/// Parts of a hexahedron's face each way, and of the patch's radius along a triangle's longest edge.
const PARTS: usize = 8;

/// A dead load on nodes.
#[derive(Debug, Clone)]
pub struct NodalLoad {
    /// Forces (N) on nodes.
    pub forces_n: Vec<(u32, DVec3)>,
    /// Its sum (N) along the direction that the problem's answer is measured in.
    pub sum_n: f64,
}

impl NodalLoad {
    /// The displacement (m) conjugate to it: its work on the displacements `x − X` over its sum.
    pub fn displacement_m(&self, rest_m: &[DVec3], x: &[DVec3]) -> f64 {
        let work: f64 = self.forces_n.iter().map(|&(n, f)| f.dot(x[n as usize] - rest_m[n as usize])).sum();
        work / self.sum_n
    }

    /// One force per node.
    pub fn dense(&self, nodes: usize) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; nodes];
        for &(node, force) in &self.forces_n {
            forces[node as usize] += force;
        }
        forces
    }

    fn new(dense: Vec<DVec3>, direction: impl Fn(usize) -> DVec3) -> Self {
        let nodes = dense.into_iter().enumerate().filter(|(_, f)| *f != DVec3::ZERO);
        let forces_n: Vec<(u32, DVec3)> = nodes.map(|(n, f)| (n as u32, f)).collect();
        let sum_n = forces_n.iter().map(|&(n, f)| f.dot(direction(n as usize))).sum();
        Self { forces_n, sum_n }
    }

    /// Makes the sum what it should be: what quadrature missed.
    fn with_sum(mut self, sum_n: f64) -> Self {
        let factor = sum_n / self.sum_n;
        for (_, force) in &mut self.forces_n {
            *force *= factor;
        }
        self.sum_n = sum_n;
        self
    }
}

/// `(1 − r²/a²)²` at the distance r of a point from a line.
fn patch_shape(point: DVec3, (on_line, along): (DVec3, DVec3), radius_m: f64) -> f64 {
    let from_line = (point - on_line).reject_from_normalized(along);
    // The line leaves the body on its other side, too.
    let facing = (point - on_line).dot(along) > -radius_m;
    let inside = 1.0 - from_line.length_squared() / (radius_m * radius_m);
    if facing && inside > 0.0 { inside * inside } else { 0.0 }
}

/// The load of a problem on tetrahedra; `None` where a tool acts.
pub fn on_tets(action: Action, body: &TetBody) -> Option<NodalLoad> {
    let positions = body.mesh.positions_m();
    let mut dense = vec![DVec3::ZERO; positions.len()];
    let line = (body.touch_m, body.normal);
    for (triangle, corners) in body.touched.iter().zip(body.touched_corners_m()) {
        let [a, b, c] = corners;
        // Outwards, twice the area long.
        let area = (b - a).cross(c - a);
        match action {
            Action::Sphere { .. } => return None,
            Action::Patch { radius_m, .. } => {
                let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
                let parts = (longest / radius_m * PARTS as f64).ceil() as usize;
                for weights in centroids(parts) {
                    let point = a * weights[0] + b * weights[1] + c * weights[2];
                    let pressure = patch_shape(point, line, radius_m) / (parts * parts) as f64;
                    for (&node, weight) in triangle.iter().zip(weights) {
                        dense[node as usize] -= area * (0.5 * pressure * weight);
                    }
                }
            }
            Action::Pressure { pressure_pa } => {
                for &node in triangle {
                    dense[node as usize] -= area * (pressure_pa / 6.0);
                }
            }
            Action::Shear { .. } => {
                for &node in triangle {
                    dense[node as usize] += DVec3::Z * (area.length() / 6.0);
                }
            }
        }
    }
    Some(match action {
        Action::Patch { force_n, .. } => NodalLoad::new(dense, |_| -body.normal).with_sum(force_n),
        Action::Shear { force_n } => NodalLoad::new(dense, |_| DVec3::Z).with_sum(force_n),
        Action::Pressure { .. } | Action::Sphere { .. } => NodalLoad::new(dense, |n| positions[n].normalize_or_zero()),
    })
}

/// Barycentric weights of the centroids of `parts²` equal parts of a triangle.
fn centroids(parts: usize) -> impl Iterator<Item = [f64; 3]> {
    let at = move |i: usize, j: usize, third: f64| {
        let (a, b) = ((i as f64 + third) / parts as f64, (j as f64 + third) / parts as f64);
        [1.0 - a - b, a, b]
    };
    (0..parts).flat_map(move |i| {
        (0..parts - i).flat_map(move |j| {
            let upper = (i + j + 1 < parts).then(|| at(i, j, 2.0 / 3.0));
            std::iter::once(at(i, j, 1.0 / 3.0)).chain(upper)
        })
    })
}

/// The patch on a reference grid: its part of the force.
pub fn patch_on_hexahedra(grid: &HexGrid, body: &HexBody, radius_m: f64, force_n: f64) -> NodalLoad {
    let mut dense = vec![DVec3::ZERO; grid.positions_m.len()];
    let line = (body.touch_m, body.normal);
    for face in grid.faces(body.touched) {
        let nodes = face.map(|n| grid.positions_m[n as usize]);
        for point in surface_points(grid, &face, PARTS) {
            let at: DVec3 = nodes.iter().zip(&point.weights).map(|(x, w)| *x * *w).sum();
            let pressure = patch_shape(at, line, radius_m);
            for (&node, weight) in face.iter().zip(point.weights) {
                dense[node as usize] -= point.normal * (pressure * point.area_m2 * weight);
            }
        }
    }
    NodalLoad::new(dense, |_| -body.normal).with_sum(force_n / body.multiplicity)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problems::{body::Body, place::Place};
    use std::f64::consts::PI;

    #[test]
    fn parts_of_a_triangle_cover_it() {
        let points: Vec<_> = centroids(7).collect();
        assert_eq!(points.len(), 49);
        let mean = points.iter().map(|w| w[1]).sum::<f64>() / 49.0;
        assert!((mean - 1.0 / 3.0).abs() < 1e-14);
    }

    /// The sum is ∫ p dA of the projected disc on any mesh, before it is made so: π a² / 3 for p₀ = 1.
    #[test]
    fn the_patch_is_integrated_on_any_mesh() {
        for (body, resolution) in [(Body::Block, 4), (Body::Block, 8), (Body::Ventricle(Place::NearTip), 1_352)] {
            let body = body.tets(resolution).unwrap();
            let a = 7.5e-3;
            let load = on_tets(Action::Patch { radius_m: a, force_n: 1.0 }, &body).unwrap();
            let sum: DVec3 = load.forces_n.iter().map(|(_, f)| *f).sum();
            assert!((sum.dot(-body.normal) - 1.0).abs() < 1e-12);
            // Undo the normalisation by the largest pressure: a node's share is known through the sum of squares only, so
            // check the integral itself.
            let line = (body.touch_m, body.normal);
            let mut integral = 0.0;
            for [p, q, r] in body.touched_corners_m() {
                let area = 0.5 * (q - p).cross(r - p).dot(body.normal);
                let values = centroids(60).map(|w| patch_shape(p * w[0] + q * w[1] + r * w[2], line, a));
                integral += area * values.sum::<f64>() / 3600.0;
            }
            assert!((integral / (PI * a * a / 3.0) - 1.0).abs() < 2e-3, "{integral}");
        }
    }

    #[test]
    fn pressure_in_the_octant_is_conjugate_to_the_mean_radial_displacement() {
        let missing = [8, 16].map(|cells| {
            let body = Body::Octant.tets(cells).unwrap();
            let load = on_tets(Action::Pressure { pressure_pa: 1.0 }, &body).unwrap();
            let rest = body.mesh.positions_m();
            let grown: Vec<DVec3> = rest.iter().map(|p| *p + p.normalize() * 1e-3).collect();
            assert!((load.displacement_m(rest, &grown) - 1e-3).abs() < 1e-12);
            1.0 - load.sum_n / (0.5 * PI * 0.05 * 0.05)
        });
        // Facets lie inside the sphere: less area, by the square of their size.
        assert!(missing[0] < 0.03 && (missing[0] / missing[1] - 4.0).abs() < 0.2, "{missing:?}");
    }
}
