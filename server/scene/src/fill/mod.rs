//! The volume between two surfaces, filled with tetrahedra.
//!
//! The surfaces are cleaned, the outer one is triangulated anew with the wanted density, each of its vertices is
//! followed across the wall to the inner surface, and the prisms between are layered, split and optimised. Layers keep
//! whole elements through a thin wall even at few tets; docs/adr/0010-filling-walls.md says why not a lattice.
mod bvh;
mod correspond;
mod error;
mod optimise;
pub(crate) mod prisms;
mod relation;
mod remesh;
mod repair;
mod report;
pub(crate) mod trimesh;

pub use error::FillError;
pub use repair::Repairs;
pub use report::{FillReport, SurfaceReport};

use crate::shapes::{BoundaryRegion, graded, layers_for};
use glam::DVec3;
use palpate_physics::TetMesh;
use palpate_physics::mesh::quality::{dihedral_angles_deg, volume_length_ratio};
use remesh::{Target, remesh};
use repair::{CleanSurface, clean};
use trimesh::TriMesh;

/// Counts are met within this part of the wanted one, or it is an error.
const COUNT_TOLERANCE: f64 = 0.15;
/// Longest edges that still give usable tets, in wall thicknesses; sets the fewest tets.
const LONGEST_EDGE: f64 = 5.0;
/// Fewest triangles that follow a closed or cup-like surface at all.
const FEWEST_TRIANGLES: f64 = 20.0;
/// Most tets made.
const MOST_TETS: u32 = 5_000_000;
/// Most layers.
const MOST_LAYERS: u32 = 64;
/// Sizes differ by more than this: mixed units. Real cavities are not 20 times smaller than their hearts.
const UNIT_RATIO: f64 = 20.0;
/// Thinnest wall, as part of the mean thickness.
const THINNEST: f64 = 0.01;
/// Alternating rounds of optimising nodes and diagonals, and passes over the nodes in each.
const OPTIMISING_ROUNDS: usize = 3;
const SWEEPS: usize = 6;
/// Points of the inner surface tested to lie inside the outer one.
const INSIDE_SAMPLES: usize = 64;

/// A triangulated surface as read from a file.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceInput<'a> {
    /// Vertices in the file's unit.
    pub vertices: &'a [DVec3],
    /// Triangles as vertex indices; orientation may be mixed.
    pub triangles: &'a [[u32; 3]],
    /// The file's unit in metres: 0.001 for millimetres.
    pub metres_per_unit: f64,
}

/// What to make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FillOptions {
    /// Tets wanted; met within 15 %, usually within 2 %.
    pub target_tets: u32,
    /// Layers through the wall; None chooses them from thickness, area and count.
    pub layers: Option<u32>,
    /// Smallest dihedral angle (degrees) accepted.
    pub min_dihedral_deg: f64,
}

impl FillOptions {
    /// This many tets, layers chosen, dihedral angles of at least 3°.
    pub fn new(target_tets: u32) -> Self {
        Self { target_tets, layers: None, min_dihedral_deg: 3.0 }
    }
}

/// A filled wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Fill {
    /// The tetrahedra (m).
    pub mesh: TetMesh,
    /// `inner`, `outer` and, for open surfaces, `base`: triangles counter-clockwise seen from outside the wall.
    pub regions: Vec<BoundaryRegion>,
    /// What came out.
    pub report: FillReport,
}

/// Fills the wall between two surfaces. `progress` is told the part done (0 to 1) and what is being done. The same
/// input gives the same bits.
///
/// # Errors
/// A [`FillError`] that says what is wrong with the surfaces, or which counts are possible.
pub fn fill(
    inner: SurfaceInput<'_>,
    outer: SurfaceInput<'_>,
    options: FillOptions,
    progress: &mut dyn FnMut(f64, &str),
) -> Result<Fill, FillError> {
    check_options(inner, outer, options)?;
    progress(0.0, "cleaning the surfaces");
    let inner = cleaned("inner", inner)?;
    let outer = cleaned("outer", outer)?;
    let wall = Wall::between(inner, outer)?;
    let plan = wall.plan(options)?;
    let base = remesh(&wall.outer, &wall.outer_target, plan.triangles, |part| {
        progress(0.1 + 0.5 * part.clamp(0.0, 1.0), "triangulating the outer surface");
    });
    progress(0.6, "mapping it to the inner surface");
    let on_inner = correspond::onto_inner(&base, &wall.inner_target, &wall.outer_target, wall.thickness_m);
    let mut layered = Layered::new(&base, &on_inner, plan.layers);
    for round in 0..OPTIMISING_ROUNDS {
        progress(0.65 + 0.25 * round as f64 / OPTIMISING_ROUNDS as f64, "improving the tetrahedra");
        layered.optimise(&wall);
    }
    progress(0.9, "measuring");
    let fill = layered.finish(&wall, options)?;
    progress(1.0, "filled");
    Ok(fill)
}

fn check_options(inner: SurfaceInput<'_>, outer: SurfaceInput<'_>, options: FillOptions) -> Result<(), FillError> {
    let check = |name, value: f64, ok: bool, rule| {
        if ok { Ok(()) } else { Err(FillError::Option { name, value, rule }) }
    };
    let layers = options.layers.unwrap_or(1);
    check("layers", f64::from(layers), (1..=MOST_LAYERS).contains(&layers), "must be 1 to 64")?;
    let angle = options.min_dihedral_deg;
    check("min_dihedral_deg", angle, (0.0..60.0).contains(&angle), "must be at least 0 and below 60")?;
    for unit in [inner.metres_per_unit, outer.metres_per_unit] {
        check("metres_per_unit", unit, unit > 0.0 && unit.is_finite(), "must be finite and larger than 0")?;
    }
    Ok(())
}

fn cleaned(which: &'static str, input: SurfaceInput<'_>) -> Result<CleanSurface, FillError> {
    let points: Vec<DVec3> = input.vertices.iter().map(|v| *v * input.metres_per_unit).collect();
    clean(which, &points, input.triangles)
}

/// Two clean surfaces that lie as they should.
struct Wall {
    inner: CleanSurface,
    outer: CleanSurface,
    inner_target: Target,
    outer_target: Target,
    /// Mean distance from the outer surface to the inner (m).
    thickness_m: f64,
}

struct Plan {
    layers: u32,
    triangles: usize,
}

impl Wall {
    fn between(inner: CleanSurface, outer: CleanSurface) -> Result<Self, FillError> {
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
        let thickness_m = mean_distance(&outer.mesh, &inner_target);
        let (nearest_m, at_m) = least_distance(&inner.mesh, &outer_target);
        let least_m = THINNEST * thickness_m;
        if nearest_m < least_m {
            return Err(FillError::TooThin { at_m, thickness_m: nearest_m, least_m });
        }
        Ok(Self { inner, outer, inner_target, outer_target, thickness_m })
    }

    /// Layers and triangles for the wanted count, or the counts that are possible.
    fn plan(&self, options: FillOptions) -> Result<Plan, FillError> {
        let wanted = options.target_tets;
        let area = 0.5 * (self.inner.mesh.area() + self.outer.mesh.area());
        let layers = options.layers.unwrap_or_else(|| layers_for(area, self.thickness_m, f64::from(wanted.max(1))));
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

/// Area-weighted mean distance from a surface to another.
fn mean_distance(from: &TriMesh, to: &Target) -> f64 {
    let (mut sum, mut area_sum) = (0.0, 0.0);
    for &triangle in &from.triangles {
        let area = from.area_vector(triangle).length();
        let centre = triangle.iter().map(|&v| from.positions[v as usize]).sum::<DVec3>() / 3.0;
        sum += area * to.surface.nearest(centre).distance_squared.sqrt();
        area_sum += area;
    }
    sum / area_sum.max(f64::MIN_POSITIVE)
}

fn least_distance(from: &TriMesh, to: &Target) -> (f64, DVec3) {
    let distances = from.positions.iter().map(|p| (to.surface.nearest(*p).distance_squared.sqrt(), *p));
    distances.fold((f64::INFINITY, DVec3::ZERO), |least, next| if next.0 < least.0 { next } else { least })
}

/// The layers between the outer triangulation and its image on the inner surface.
struct Layered<'a> {
    base: &'a TriMesh,
    on_rim: Vec<bool>,
    levels: Vec<Vec<DVec3>>,
}

impl<'a> Layered<'a> {
    fn new(base: &'a TriMesh, on_inner: &[DVec3], layers: u32) -> Self {
        let area = |positions: &[DVec3]| TriMesh::area_of(positions, &base.triangles);
        let growth = (area(&base.positions) / area(on_inner).max(f64::MIN_POSITIVE)).sqrt();
        let levels = (0..=layers)
            .map(|k| {
                let fraction = graded(growth, f64::from(k) / f64::from(layers));
                on_inner.iter().zip(&base.positions).map(|(a, b)| a.lerp(*b, fraction)).collect()
            })
            .collect();
        Self { base, on_rim: base.on_boundary(), levels }
    }

    fn split(&self) -> prisms::Split {
        prisms::split(&prisms::Layers { triangles: &self.base.triangles, levels: &self.levels })
    }

    /// Chooses diagonals, then moves nodes: surface nodes on their surface, rim nodes on their rim; the base's inner
    /// nodes stay on the lines between the rims.
    fn optimise(&mut self, wall: &Wall) {
        let tets = self.split().tets;
        let vertices = self.base.positions.len();
        let top = self.levels.len() - 1;
        let mut positions = self.levels.concat();
        optimise::improve(&mut positions, &tets, SWEEPS, |node, p| {
            let on_rim = self.on_rim[node % vertices];
            match node / vertices {
                0 => Some(wall.inner_target.project(p, on_rim)),
                level if level == top => Some(wall.outer_target.project(p, on_rim)),
                _ if on_rim => None,
                _ => Some(p),
            }
        });
        self.levels = positions.chunks(vertices).map(<[DVec3]>::to_vec).collect();
        self.straighten_base();
    }

    /// Base nodes between the rims go back on the straight lines, at their parts of them.
    fn straighten_base(&mut self) {
        let top = self.levels.len() - 1;
        for v in (0..self.on_rim.len()).filter(|&v| self.on_rim[v]) {
            let (a, b) = (self.levels[0][v], self.levels[top][v]);
            for level in 1..top {
                let part = (self.levels[level][v] - a).dot(b - a) / (b - a).length_squared();
                if part > 0.0 && part < 1.0 {
                    self.levels[level][v] = a.lerp(b, part);
                }
            }
        }
    }

    fn finish(self, wall: &Wall, options: FillOptions) -> Result<Fill, FillError> {
        let parts = self.split();
        let positions = self.levels.concat();
        check_quality(&positions, &parts.tets, options.min_dihedral_deg)?;
        let mesh = TetMesh::new(positions, parts.tets)?;
        let found = mesh.tets().len() as u32;
        if (f64::from(found) / f64::from(options.target_tets) - 1.0).abs() > COUNT_TOLERANCE {
            return Err(FillError::CountMissed { wanted: options.target_tets, found });
        }
        let layers = self.levels.len() as u32 - 1;
        let report = report::measure(&mesh, &parts.inner, &parts.outer, wall, layers);
        let mut regions = vec![
            BoundaryRegion { name: "inner", triangles: parts.inner },
            BoundaryRegion { name: "outer", triangles: parts.outer },
        ];
        if !parts.base.is_empty() {
            regions.push(BoundaryRegion { name: "base", triangles: parts.base });
        }
        Ok(Fill { mesh, regions, report })
    }
}

/// Refuses inverted tets and dihedral angles below the wanted one, and says where.
fn check_quality(positions: &[DVec3], tets: &[[u32; 4]], wanted_deg: f64) -> Result<(), FillError> {
    let mut worst = (f64::INFINITY, DVec3::ZERO);
    for tet in tets {
        let corners = tet.map(|n| positions[n as usize]);
        let inverted = volume_length_ratio(corners) <= 1e-6;
        let angle = if inverted { 0.0 } else { dihedral_angles_deg(corners).into_iter().fold(180.0, f64::min) };
        if angle < worst.0 {
            worst = (angle, corners.iter().sum::<DVec3>() / 4.0);
        }
    }
    if worst.0 > 0.0 && worst.0 >= wanted_deg {
        return Ok(());
    }
    Err(FillError::Quality { at_m: worst.1, angle_deg: worst.0, wanted_deg })
}

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;
