//! The fine surface of a shell: triangulated anew on the true ellipsoids, however coarse the tets are. Its triangles come from the regions
//! `inner`, `outer` and `base`, in this order.
use super::{ShapeError, Wall};
use crate::{
    fill::prisms::{Layers, split},
    skin::{FineSurface, refine},
};
use glam::DVec3;
use std::iter::repeat_n;

/// Edges aimed at, over the longest allowed: rings vary by about as much, and few edges are left to halve.
const EDGE: f64 = 0.75;
/// Origins of triangles.
const INNER: u32 = 0;
const OUTER: u32 = 1;
const BASE: u32 = 2;

/// The surface of a [`super::sphere_shell`] with edges of at most `longest_m`.
///
/// # Errors
/// As there.
pub(crate) fn sphere_shell_skin(inner_m: f64, outer_m: f64, longest_m: f64) -> Result<FineSurface, ShapeError> {
    Ok(Wall::between_spheres(inner_m, outer_m)?.skin(longest_m))
}

/// The surface of an [`super::ellipsoid_shell`] with edges of at most `longest_m`.
///
/// # Errors
/// As there.
pub(crate) fn ellipsoid_shell_skin(inner_m: DVec3, outer_m: DVec3, longest_m: f64) -> Result<FineSurface, ShapeError> {
    Ok(Wall::between_ellipsoids(inner_m, outer_m)?.skin(longest_m))
}

/// The surface of a [`super::ventricle`] with edges of at most `longest_m`.
///
/// # Errors
/// As there.
pub(crate) fn ventricle_skin(
    outer_m: (f64, f64),
    inner_m: (f64, f64),
    cut_z_m: f64,
    longest_m: f64,
) -> Result<FineSurface, ShapeError> {
    Ok(Wall::of_ventricle(outer_m, inner_m, cut_z_m)?.skin(longest_m))
}

impl Wall {
    fn skin(&self, longest_m: f64) -> FineSurface {
        let cap = self.cap(self.middle_m());
        let shrunk = (cap.area_m2() / self.cap(self.outer_m).area_m2()).sqrt();
        let sphere = cap.triangulate(&cap.rings_of(EDGE * longest_m * shrunk));
        let placed = |axes| sphere.directions.iter().map(|&d| self.place(axes, d)).collect::<Vec<_>>();
        let (inner, outer) = (placed(self.inner_m), placed(self.outer_m));
        // Levels between give the base triangles as good as the others.
        let thickness_m = (self.outer_m - self.inner_m).max_element();
        let layers = if self.cut_z_m.is_some() { (thickness_m / (EDGE * longest_m)).ceil().max(1.0) } else { 1.0 };
        let level = |k: usize| inner.iter().zip(&outer).map(|(a, b)| a.lerp(*b, k as f64 / layers)).collect();
        let levels: Vec<Vec<DVec3>> = (0..=layers as usize).map(level).collect();
        let parts = split(&Layers { triangles: &sphere.triangles, levels: &levels });
        let of_parts = [(parts.inner, INNER), (parts.outer, OUTER), (parts.base, BASE)];
        let origins = of_parts.iter().flat_map(|(triangles, origin)| repeat_n(*origin, triangles.len())).collect();
        let triangles = of_parts.into_iter().flat_map(|(triangles, _)| triangles).collect();
        let surface = FineSurface { positions_m: levels.concat(), triangles, origins }.compact();
        refine(surface, longest_m, &|sides, middle| self.onto(sides, middle))
    }

    /// The point of the surface nearest to the middle of an edge, about: along the ray from the origin, on a rim in its plane.
    fn onto(&self, sides: [u32; 2], middle: DVec3) -> DVec3 {
        let axes = if sides.contains(&INNER) { self.inner_m } else { self.outer_m };
        match sides {
            [BASE, BASE] => middle,
            [BASE, _] | [_, BASE] => {
                // x²/a² + y²/b² = 1 − z²/c²
                let across = (middle.truncate() / axes.truncate()).length();
                let radius = (1.0 - (middle.z / axes.z).powi(2)).sqrt();
                (middle.truncate() * (radius / across)).extend(middle.z)
            }
            _ => axes * (middle / axes).normalize_or(DVec3::NEG_Z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_physics::bodies::hybrid::Skin;
    use std::f64::consts::PI;

    fn check(surface: &FineSurface, longest_m: f64, volume_m3: f64) {
        let edges = surface.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let lengths = edges.map(|[a, b]| surface.positions_m[a as usize].distance(surface.positions_m[b as usize]));
        let longest = lengths.fold(0.0, f64::max);
        assert!(longest <= longest_m * 1.000_001, "{longest} {longest_m}");
        let skin = Skin::new(surface.positions_m.clone(), surface.triangles.clone()).unwrap();
        let error = skin.volume_m3() / volume_m3 - 1.0;
        println!("{} triangles, volume {error:.1e} off", surface.triangles.len());
        assert!(error.abs() < 1e-3, "{error}");
    }

    #[test]
    fn skins_are_closed_fine_and_have_the_shapes_volume() {
        let ball = |radius: f64| 4.0 / 3.0 * PI * radius.powi(3);
        check(&sphere_shell_skin(0.05, 0.08, 4e-3).unwrap(), 4e-3, ball(0.08) - ball(0.05));
        let (inner, outer) = (DVec3::new(0.05, 0.06, 0.09), DVec3::new(0.06, 0.075, 0.1));
        let volume = 4.0 / 3.0 * PI * (outer.element_product() - inner.element_product());
        check(&ellipsoid_shell_skin(inner, outer, 3e-3).unwrap(), 3e-3, volume);
    }

    #[test]
    fn the_ventricles_skin_lies_on_its_ellipsoids_and_its_cut() {
        let cut = |short: f64, long: f64, z: f64| {
            // ∫ π short² (1 − ζ²/long²) dζ from −long to z
            PI * short * short * ((z + long) - (z.powi(3) + long.powi(3)) / (3.0 * long * long))
        };
        let volume = cut(0.045, 0.09, 0.0225) - cut(0.0315, 0.0765, 0.0225);
        let skin = ventricle_skin((0.045, 0.09), (0.0315, 0.0765), 0.0225, 3.2e-3).unwrap();
        check(&skin, 3.2e-3, volume);
        for (origin, axes) in [(INNER, [0.0315, 0.0765]), (OUTER, [0.045, 0.09])] {
            let axes = DVec3::new(axes[0], axes[0], axes[1]);
            for triangle in skin.triangles_from(|from| from == origin) {
                for vertex in skin.triangles[triangle as usize] {
                    assert!(((skin.positions_m[vertex as usize] / axes).length() - 1.0).abs() < 1e-12);
                }
            }
        }
        for triangle in skin.triangles_from(|from| from == BASE) {
            assert!(skin.triangles[triangle as usize].iter().all(|&v| skin.positions_m[v as usize].z == 0.0225));
        }
    }
}
