//! The volume between two surfaces, filled with tetrahedra.
//!
//! The surfaces are cleaned, the outer one is triangulated anew with the wanted density, each of its vertices is
//! followed across the wall to the inner surface, and the prisms between are layered, split and optimised. Layers keep
//! whole elements through a thin wall even at few tets; docs/adr/filling-walls.md says why not a lattice.
mod bvh;
mod correspond;
mod error;
mod layered;
mod optimise;
pub(crate) mod prisms;
mod relation;
mod remesh;
mod repair;
mod report;
mod settle;
mod skin;
pub(crate) mod trimesh;
mod wall;

pub use error::FillError;
pub use repair::Repairs;
pub(crate) use repair::{Mended, mend};
pub use report::{FillReport, SurfaceReport};
pub(crate) use skin::around;

use crate::shapes::BoundaryRegion;
use glam::DVec3;
use layered::Layered;
use palpate_physics::TetMesh;
use remesh::remesh;
use repair::{CleanSurface, clean};
use wall::Wall;

/// Alternating rounds of choosing diagonals and moving nodes.
const OPTIMISING_ROUNDS: usize = 5;
/// Most layers.
const MOST_LAYERS: u32 = 64;

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
    /// Move the boundary so that the volume, not the position of the nodes, is the surfaces': a coarse mesh inscribed
    /// in a curved wall would lose up to a tenth of its mass.
    pub match_volume: bool,
}

impl FillOptions {
    /// This many tets, layers chosen, dihedral angles of at least 3°, volume matched.
    pub fn new(target_tets: u32) -> Self {
        Self { target_tets, layers: None, min_dihedral_deg: 3.0, match_volume: true }
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
    if options.match_volume {
        layered.match_volume(&wall);
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

#[cfg(test)]
mod samples;
#[cfg(test)]
mod tests;
