//! Projection towards the mass centre (2006, section 6): the triangle of a star-shaped surface that a ray meets, and
//! the point there.
use super::SeedError;
use glam::{DMat3, DVec3};

/// An attachment point: where the ray from the mass centre through a point meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attachment {
    /// The triangle.
    pub triangle: u32,
    /// Barycentric weights of its corners; they sum to one and are not negative.
    pub weights: [f64; 3],
}

/// A closed surface seen from a centre.
#[derive(Debug, Clone)]
pub struct Radial {
    centre_m: DVec3,
    /// Inverse `[a, b, c]⁻¹` (1/m) of every triangle's corners, relative to the centre.
    inverse_per_m: Vec<DMat3>,
}

impl Radial {
    /// Returns a surface that every ray from `centre_m` (m) leaves once.
    ///
    /// # Errors
    /// [`SeedError::NotStarShaped`], where `surface` is the surface's name.
    pub fn new(
        surface: &'static str,
        centre_m: DVec3,
        positions_m: &[DVec3],
        triangles: &[[u32; 3]],
    ) -> Result<Self, SeedError> {
        let mut inverse_per_m = Vec::with_capacity(triangles.len());
        for (triangle, corners) in triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|n| positions_m[n as usize] - centre_m);
            let cone = DMat3::from_cols(a, b, c);
            // Six times the volume of the tet to the centre must exceed what rounding could make of a flat tet.
            let faces_away = cone.determinant() > 1e-12 * a.length() * b.length() * c.length();
            if !faces_away {
                return Err(SeedError::NotStarShaped { surface, triangle });
            }
            inverse_per_m.push(cone.inverse());
        }
        Ok(Self { centre_m, inverse_per_m })
    }

    /// Returns the attachment point of a point `p`. With `p − c = α a + β b + γ c`, the ray meets the triangle with α,
    /// β, γ ≥ 0, at `(α, β, γ)/(α + β + γ)`.
    ///
    /// Rounding may leave a point on an edge outside both of its triangles; then the triangle is taken that the point
    /// is least outside of.
    pub fn attachment(&self, point_m: DVec3) -> Attachment {
        let from = point_m - self.centre_m;
        let mut best = (f64::NEG_INFINITY, Attachment { triangle: 0, weights: [1.0, 0.0, 0.0] });
        for (triangle, inverse) in self.inverse_per_m.iter().enumerate() {
            let along = *inverse * from;
            let sum = along.element_sum();
            // A ray that leaves through the opposite side has all three negative.
            if sum > 0.0 {
                let weights = along / sum;
                let least = weights.min_element();
                if least > best.0 {
                    let kept = weights.max(DVec3::ZERO);
                    let weights = (kept / kept.element_sum()).to_array();
                    best = (least, Attachment { triangle: triangle as u32, weights });
                    if least >= 0.0 {
                        break;
                    }
                }
            }
        }
        best.1
    }
}

/// Returns the sum of the corners with these weights.
pub fn at(weights: [f64; 3], corners: [DVec3; 3]) -> DVec3 {
    corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bodies::seed::testing::sphere, testing::Random};

    #[test]
    fn an_attachment_lies_on_the_ray() {
        let centre = DVec3::new(0.1, -0.05, 0.02);
        let (positions, triangles) = sphere(DVec3::new(1.0, 0.8, 1.3), 2);
        let radial = Radial::new("skin", centre, &positions, &triangles).unwrap();
        let mut random = Random(5);
        for _ in 0..500 {
            let point = centre + random.vector() * 0.7;
            let attachment = radial.attachment(point);
            let met = at(attachment.weights, triangles[attachment.triangle as usize].map(|n| positions[n as usize]));
            let (ray, along) = ((met - centre).normalize(), (point - centre).normalize());
            assert!(ray.distance(along) < 1e-12 && attachment.weights.iter().all(|&w| w >= 0.0));
        }
        // A corner's attachment point is the corner itself.
        for (vertex, &position) in positions.iter().enumerate() {
            let attachment = radial.attachment(position);
            let corner = triangles[attachment.triangle as usize].iter().position(|&n| n as usize == vertex).unwrap();
            assert!((attachment.weights[corner] - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn a_surface_that_hides_itself_is_refused() {
        let (positions, triangles) = sphere(DVec3::ONE, 1);
        let error = Radial::new("skin", DVec3::X * 2.0, &positions, &triangles).unwrap_err().to_string();
        assert!(error.contains("of the skin does not face away from the mass centre"), "{error}");
    }
}
