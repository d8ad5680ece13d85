//! Shells between two ellipsoids, closed or cut.
use super::rings::{Cap, triangles_between};
use super::{BoundaryRegion, Shape, ShapeError, check};
use crate::fill::prisms::{Layers, split};
use crate::limits::MOST_TETS;
use glam::DVec3;
use palpate_physics::TetMesh;
use std::f64::consts::FRAC_PI_2;

/// Edge over layer thickness that a mesh aims at; 1 to 2 gives good tets, and more layers bend better than one.
const EDGE_PER_LAYER: f64 = 1.4;
/// A count is met when it is off by no more than this.
const COUNT_TOLERANCE: f64 = 0.10;
/// Most layers through a wall.
const MOST_LAYERS: u32 = 64;
/// A cut must keep the caps' rims away from the poles: sine of the steepest latitude.
const LARGEST_CUT: f64 = 0.95;

/// An ellipsoid's part below a latitude, on which a point is named by direction as seen on the middle surface.
pub(super) struct Wall {
    shape: &'static str,
    inner_m: DVec3,
    outer_m: DVec3,
    /// Height of the cut (m), if any.
    cut_z_m: Option<f64>,
}

/// A sphere shell about the origin with radii in metres. `target_tets` is met within 10 %. Regions `inner`, `outer`.
///
/// # Errors
/// Radii that are not 0 < inner < outer, or a count no shell has.
pub fn sphere_shell(inner_m: f64, outer_m: f64, target_tets: u32) -> Result<Shape, ShapeError> {
    Wall::between_spheres(inner_m, outer_m)?.mesh(target_tets)
}

/// A closed shell between two ellipsoids about the origin with semi-axes in metres. `target_tets` is met within 10 %.
/// Regions `inner`, `outer`.
///
/// # Errors
/// Axes that are not 0 < inner < outer, or a count no shell has.
pub fn ellipsoid_shell(inner_axes_m: DVec3, outer_axes_m: DVec3, target_tets: u32) -> Result<Shape, ShapeError> {
    Wall::between_ellipsoids(inner_axes_m, outer_axes_m)?.mesh(target_tets)
}

/// The truncated-ellipsoid ventricle: a shell between two ellipsoids of revolution with semi-axes (short, long) in
/// metres about z, apex at −z, cut by the plane z = `cut_z_m`. `target_tets` is met within 10 %. Regions `inner`,
/// `outer`, and `base` in the plane of the cut.
///
/// # Errors
/// Axes that are not 0 < inner < outer, a cut near or beyond a pole, or a count no such mesh has.
pub fn ventricle(
    outer_m: (f64, f64),
    inner_m: (f64, f64),
    cut_z_m: f64,
    target_tets: u32,
) -> Result<Shape, ShapeError> {
    Wall::of_ventricle(outer_m, inner_m, cut_z_m)?.mesh(target_tets)
}

/// A closed ellipsoid about the origin with these semi-axes (m), of about so many triangles: vertices (m) and triangles,
/// counter-clockwise seen from outside.
pub(crate) fn ellipsoid_surface(axes_m: DVec3, target_triangles: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let cap = Cap { axes_m, top_latitude: FRAC_PI_2 };
    let sphere = cap.triangulate(&cap.rings(f64::from(target_triangles)));
    (sphere.directions.iter().map(|&d| d * axes_m).collect(), sphere.triangles)
}

impl Wall {
    pub(super) fn between_spheres(inner_m: f64, outer_m: f64) -> Result<Self, ShapeError> {
        check("inner_m", inner_m, inner_m > 0.0, "must be finite and larger than 0")?;
        check("outer_m", outer_m, outer_m > inner_m, format!("must be larger than the inner radius {inner_m}"))?;
        let [inner_m, outer_m] = [inner_m, outer_m].map(DVec3::splat);
        Ok(Self { shape: "sphere shell", inner_m, outer_m, cut_z_m: None })
    }

    pub(super) fn between_ellipsoids(inner_m: DVec3, outer_m: DVec3) -> Result<Self, ShapeError> {
        const INNER: [&str; 3] = ["inner_axes_m.x", "inner_axes_m.y", "inner_axes_m.z"];
        const OUTER: [&str; 3] = ["outer_axes_m.x", "outer_axes_m.y", "outer_axes_m.z"];
        for axis in 0..3 {
            let (inner, outer) = (inner_m[axis], outer_m[axis]);
            check(INNER[axis], inner, inner > 0.0, "must be finite and larger than 0")?;
            check(OUTER[axis], outer, outer > inner, format!("must be larger than the inner one, {inner}"))?;
        }
        Ok(Self { shape: "ellipsoid shell", inner_m, outer_m, cut_z_m: None })
    }

    pub(super) fn of_ventricle(outer_m: (f64, f64), inner_m: (f64, f64), cut_z_m: f64) -> Result<Self, ShapeError> {
        check("inner_m.short", inner_m.0, inner_m.0 > 0.0, "must be finite and larger than 0")?;
        check("inner_m.long", inner_m.1, inner_m.1 > 0.0, "must be finite and larger than 0")?;
        check(
            "outer_m.short",
            outer_m.0,
            outer_m.0 > inner_m.0,
            format!("must be larger than the inner {}", inner_m.0),
        )?;
        check(
            "outer_m.long",
            outer_m.1,
            outer_m.1 > inner_m.1,
            format!("must be larger than the inner {}", inner_m.1),
        )?;
        let limit = LARGEST_CUT * inner_m.1;
        check("cut_z_m", cut_z_m, cut_z_m.abs() <= limit, format!("must lie between {} and {limit}", -limit))?;
        let revolve = |(short, long): (f64, f64)| DVec3::new(short, short, long);
        Ok(Self { shape: "ventricle", inner_m: revolve(inner_m), outer_m: revolve(outer_m), cut_z_m: Some(cut_z_m) })
    }

    fn top_latitude(&self, axes_m: DVec3) -> f64 {
        self.cut_z_m.map_or(FRAC_PI_2, |z| (z / axes_m.z).asin())
    }

    fn cap(&self, axes_m: DVec3) -> Cap {
        Cap { axes_m, top_latitude: self.top_latitude(axes_m) }
    }

    fn middle_m(&self) -> DVec3 {
        0.5 * (self.inner_m + self.outer_m)
    }

    /// The number of layers whose prisms are nearest to the wanted proportions.
    fn layers(&self, target_tets: u32) -> u32 {
        let thickness = (self.outer_m - self.inner_m).element_sum() / 3.0;
        layers_for(self.cap(self.middle_m()).area_m2(), thickness, f64::from(target_tets))
    }

    /// A point on the ellipsoid with these semi-axes, named by its direction on the middle one: latitudes are
    /// stretched so that the rims correspond.
    fn place(&self, axes_m: DVec3, direction: DVec3) -> DVec3 {
        let Some(cut) = self.cut_z_m else { return direction * axes_m };
        let (from, to) = (self.top_latitude(self.middle_m()), self.top_latitude(axes_m));
        let latitude = direction.z.clamp(-1.0, 1.0).asin();
        let stretched = (latitude + FRAC_PI_2) * (to + FRAC_PI_2) / (from + FRAC_PI_2) - FRAC_PI_2;
        let (sin, cos) = stretched.sin_cos();
        let flat = direction.truncate().normalize_or_zero() * cos;
        let on_rim = (latitude - from).abs() < 1e-12;
        DVec3::new(flat.x * axes_m.x, flat.y * axes_m.y, if on_rim { cut } else { sin * axes_m.z })
    }

    fn mesh(&self, target_tets: u32) -> Result<Shape, ShapeError> {
        let count = f64::from(target_tets);
        let possible = (1..=MOST_TETS).contains(&target_tets);
        check("target_tets", count, possible, format!("must be 1 to {MOST_TETS}"))?;
        let cap = self.cap(self.middle_m());
        let layers = self.layers(target_tets);
        let sizes = cap.rings(f64::from(target_tets) / f64::from(3 * layers));
        let nearest = 3 * layers * triangles_between(&sizes);
        if (f64::from(nearest) / f64::from(target_tets) - 1.0).abs() > COUNT_TOLERANCE {
            return Err(ShapeError::Count { shape: self.shape, wanted: target_tets, nearest });
        }
        let sphere = cap.triangulate(&sizes);
        let placed = |axes| sphere.directions.iter().map(|&d| self.place(axes, d)).collect::<Vec<_>>();
        let (inner, outer) = (placed(self.inner_m), placed(self.outer_m));
        let growth = (self.cap(self.outer_m).area_m2() / self.cap(self.inner_m).area_m2()).sqrt();
        let levels: Vec<Vec<DVec3>> = (0..=layers)
            .map(|k| {
                let fraction = graded(growth, f64::from(k) / f64::from(layers));
                inner.iter().zip(&outer).map(|(a, b)| a.lerp(*b, fraction)).collect()
            })
            .collect();
        let parts = split(&Layers { triangles: &sphere.triangles, levels: &levels });
        let mesh = TetMesh::new(levels.concat(), parts.tets)
            .map_err(|source| ShapeError::Mesh { shape: self.shape, source })?;
        let mut regions = vec![
            BoundaryRegion { name: "inner", triangles: parts.inner },
            BoundaryRegion { name: "outer", triangles: parts.outer },
        ];
        if self.cut_z_m.is_some() {
            regions.push(BoundaryRegion { name: "base", triangles: parts.base });
        }
        Ok(Shape { mesh, regions, layers })
    }
}

/// The number of layers that makes edges nearest to [`EDGE_PER_LAYER`] layer thicknesses, for this many tets in a wall
/// of this middle area (m²) and thickness (m). With L layers of A/(√3/4·h²) triangles, three tets a prism.
pub(crate) fn layers_for(area_m2: f64, thickness_m: f64, tets: f64) -> u32 {
    let misfit = |layers: u32| {
        let triangles = tets / f64::from(3 * layers);
        let edge = (area_m2 / triangles / (3f64.sqrt() / 4.0)).sqrt();
        (edge * f64::from(layers) / thickness_m / EDGE_PER_LAYER).ln().abs()
    };
    (1..=MOST_LAYERS).min_by(|&a, &b| misfit(a).total_cmp(&misfit(b))).unwrap_or(1)
}

/// Position of a level in the wall, 0 inner to 1 outer: layers grow in thickness as the surface does in length, by the
/// factor `growth` from the inner to the outer surface: (gᵏ − 1)/(g − 1).
pub(crate) fn graded(growth: f64, fraction: f64) -> f64 {
    if (growth - 1.0).abs() < 1e-6 {
        fraction
    } else if fraction == 1.0 {
        1.0
    } else {
        (growth.powf(fraction) - 1.0) / (growth - 1.0)
    }
}

mod skin;
#[cfg(test)]
mod tests;

pub(crate) use skin::{ellipsoid_shell_skin, sphere_shell_skin, ventricle_skin};
