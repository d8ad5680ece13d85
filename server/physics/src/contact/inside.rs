//! Whether a point is in the body.
use glam::DVec3;
use std::f64::consts::TAU;

/// Returns whether `point_m` (m) is enclosed by the closed surface `triangles` with corners `x` (m), by its winding
/// number `Σ Ω_t / 4π`: an integer away from the surface, and insensitive to the rounding of a single triangle.
///
/// It looks at every triangle, so it is not for every substep. Allocates nothing.
pub fn is_inside(point_m: DVec3, triangles: &[[u32; 3]], x: &[DVec3]) -> bool {
    let half_solid_angles: f64 =
        triangles.iter().map(|corners| half_solid_angle(corners.map(|corner| x[corner as usize] - point_m))).sum();
    (half_solid_angles / TAU).abs() > 0.5
}

/// Returns half the signed solid angle of a triangle as seen from the origin (van Oosterom and Strackee, 1983).
fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron, its faces looking outwards.
    const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    #[test]
    fn a_tetrahedron_encloses_what_its_barycentric_coordinates_say() {
        let x = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        for i in 0..1000 {
            // No point of this lattice lies on a face.
            let p = DVec3::new(f64::from(i % 10), f64::from(i / 10 % 10), f64::from(i / 100)) * 0.17 - 0.3137;
            let inside = p.min_element() > 0.0 && p.element_sum() < 1.0;
            assert_eq!(is_inside(p, &FACES, &x), inside, "{p}");
            let turned = FACES.map(|[a, b, c]| [a, c, b]);
            assert_eq!(is_inside(p, &turned, &x), inside, "whichever way the faces look: {p}");
        }
    }
}
