//! Two clean surfaces with a wall between them, and how many layers and triangles it gets.
use super::FillOptions;
use super::error::FillError;
use super::relation;
use super::remesh::Target;
use super::repair::CleanSurface;
use super::trimesh::TriMesh;
use crate::limits::MOST_TETS;
use crate::shapes::layers_for;
use glam::DVec3;

/// Longest edges that still give usable tets, in wall thicknesses; sets the fewest tets.
const LONGEST_EDGE: f64 = 5.0;
/// Fewest triangles that follow a closed or cup-like surface at all.
const FEWEST_TRIANGLES: f64 = 20.0;
/// Sizes differ by more than this: mixed units. Real cavities are not 20 times smaller than their hearts.
const UNIT_RATIO: f64 = 20.0;
/// Thinnest wall, as part of the mean thickness.
const THINNEST: f64 = 0.01;
/// Points of the inner surface tested to lie inside the outer one.
const INSIDE_SAMPLES: usize = 24;

/// Two clean surfaces that lie as they should.
pub(super) struct Wall {
    pub(super) inner: CleanSurface,
    pub(super) outer: CleanSurface,
    pub(super) inner_target: Target,
    pub(super) outer_target: Target,
    /// Mean distance from the outer surface to the inner (m).
    pub(super) thickness_m: f64,
    /// Harmonic mean (m): what the number of layers is chosen by, so that thin parts do not get flat tets.
    layering_thickness_m: f64,
}

pub(super) struct Plan {
    pub(super) layers: u32,
    pub(super) triangles: usize,
}

impl Wall {
    pub(super) fn between(inner: CleanSurface, outer: CleanSurface) -> Result<Self, FillError> {
        match (inner.rim.is_empty(), outer.rim.is_empty()) {
            (false, true) => return Err(FillError::OpenAndClosed { open: "inner", closed: "outer" }),
            (true, false) => return Err(FillError::OpenAndClosed { open: "outer", closed: "inner" }),
            _ => {}
        }
        let (inner_m, outer_m) = (diagonal(&inner.mesh), diagonal(&outer.mesh));
        if inner_m > UNIT_RATIO * outer_m || outer_m > UNIT_RATIO * inner_m {
            return Err(FillError::Units { inner_m, outer_m });
        }
        let (inner_target, outer_target) = (Target::of(&inner), Target::of(&outer));
        if let Some(found) = relation::crossing(&inner.mesh, &outer.mesh, &outer_target.surface) {
            return Err(FillError::Crossing { at_m: found.at_m, pairs: found.pairs });
        }
        if let Some(at_m) = first_outside(&inner, &outer) {
            return Err(FillError::NotInside { at_m, swapped: first_outside(&outer, &inner).is_none() });
        }
        let (thickness_m, layering_thickness_m) = mean_distances(&outer.mesh, &inner_target);
        let (nearest_m, at_m) = least_distance(&inner.mesh, &outer_target);
        let least_m = THINNEST * thickness_m;
        if nearest_m < least_m {
            return Err(FillError::TooThin { at_m, thickness_m: nearest_m, least_m });
        }
        Ok(Self { inner, outer, inner_target, outer_target, thickness_m, layering_thickness_m })
    }

    /// Layers and triangles for the wanted count, or the counts that are possible.
    pub(super) fn plan(&self, options: FillOptions) -> Result<Plan, FillError> {
        let wanted = options.target_tets;
        let area = 0.5 * (self.inner.mesh.area() + self.outer.mesh.area());
        let layers =
            options.layers.unwrap_or_else(|| layers_for(area, self.layering_thickness_m, f64::from(wanted.max(1))));
        let longest = LONGEST_EDGE * self.thickness_m;
        let fewest = (area / (3f64.sqrt() / 4.0 * longest * longest)).max(FEWEST_TRIANGLES);
        let at_least = |layers: u32| (fewest * f64::from(3 * layers)).min(f64::from(MOST_TETS)).ceil() as u32;
        let lowest = at_least(options.layers.unwrap_or(1));
        if !(lowest..=MOST_TETS).contains(&wanted) {
            return Err(FillError::Count { wanted, lowest, highest: MOST_TETS });
        }
        Ok(Plan { layers, triangles: (f64::from(wanted) / f64::from(3 * layers)).round() as usize })
    }
}

fn diagonal(mesh: &TriMesh) -> f64 {
    let low = mesh.positions.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
    let high = mesh.positions.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
    low.distance(high)
}

/// A sampled point of `a` that does not lie inside `b`, rims closed by cones. Points on the rim are not asked: rims
/// need not be plane.
fn first_outside(a: &CleanSurface, b: &CleanSurface) -> Option<DVec3> {
    let rim = |v: &u32| b.mesh.positions[*v as usize];
    let apex = b.rim.iter().map(rim).sum::<DVec3>() / b.rim.len().max(1) as f64;
    let away_from_rim = |p: &DVec3| {
        let rims = a.rim.iter().map(|&v| a.mesh.positions[v as usize].distance(*p)).fold(f64::INFINITY, f64::min);
        rims > 0.1 * diagonal(&a.mesh)
    };
    let stride = (a.mesh.positions.len() / INSIDE_SAMPLES).max(1);
    let mut samples = a.mesh.positions.iter().step_by(stride).filter(|p| a.rim.is_empty() || away_from_rim(p));
    samples.find(|p| relation::winding_number(relation::closed_triangles(&b.mesh, &b.rim, apex), **p) < 0.5).copied()
}

/// Area-weighted arithmetic and harmonic means of the distance from a surface to another.
fn mean_distances(from: &TriMesh, to: &Target) -> (f64, f64) {
    let (mut sum, mut area_sum, mut inverse_sum) = (0.0, 0.0, 0.0);
    for &triangle in &from.triangles {
        let area = from.area_vector(triangle).length();
        let centre = triangle.iter().map(|&v| from.positions[v as usize]).sum::<DVec3>() / 3.0;
        let distance = to.surface.nearest(centre).distance_squared.sqrt();
        sum += area * distance;
        inverse_sum += area / distance.max(f64::MIN_POSITIVE);
        area_sum += area;
    }
    (sum / area_sum.max(f64::MIN_POSITIVE), area_sum / inverse_sum.max(f64::MIN_POSITIVE))
}

fn least_distance(from: &TriMesh, to: &Target) -> (f64, DVec3) {
    let distances = from.positions.iter().map(|p| (to.surface.nearest(*p).distance_squared.sqrt(), *p));
    distances.fold((f64::INFINITY, DVec3::ZERO), |least, next| if next.0 < least.0 { next } else { least })
}
