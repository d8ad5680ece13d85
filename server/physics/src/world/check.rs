//! The specification's ranges.
use super::{ModelError, ModelSpec};
use crate::settings::{Integrator, LoadSpec, MAX_SUBSTEPS, Substeps};
use crate::{
    bodies::hybrid::HybridError,
    contact::{Coupling, LARGEST_TRIANGLE, ToolShape, ToolSpec, Turning},
    material::{Lame, Material, Viscosity},
    mesh::Surface,
};
use glam::DVec3;

/// `surface` is what tools and loads are at, its nodes at `rest_positions_m` (m).
pub(super) fn spec(spec: &ModelSpec, surface: &Surface, rest_positions_m: &[DVec3]) -> Result<(), ModelError> {
    regions(spec)?;
    let nodes = spec.mesh.positions_m().len();
    // Of springs they are checked where these are held.
    for set in spec.prescribed.iter().filter(|_| nodes > 0) {
        indices("node", set.nodes.iter().map(|&n| n as usize), nodes)?;
    }
    spec.loads.iter().try_for_each(|load| loaded(load, rest_positions_m.len(), surface.triangles.len()))?;
    spec.tools.iter().try_for_each(tool)?;
    shapes(spec)?;
    spec.tools.iter().try_for_each(|tool| fine_enough(surface, rest_positions_m, tool))?;
    settings(spec)
}

fn loaded(load: &LoadSpec, nodes: usize, triangles: usize) -> Result<(), ModelError> {
    let finite = |name, value: f64| setting(name, value, value.is_finite(), "must be finite");
    let on = |list: &[u32]| indices("surface triangle", list.iter().map(|&t| t as usize), triangles);
    match load {
        LoadSpec::NodalForces(forces) => {
            indices("node", forces.iter().map(|f| f.0 as usize), nodes)?;
            forces.iter().try_for_each(|(_, force_n)| finite("nodal force (N)", force_n.length()))
        }
        LoadSpec::Traction { triangles, traction_pa } => {
            on(triangles)?;
            finite("traction_pa", traction_pa.length())
        }
        LoadSpec::Pressure { triangles, pressure_pa, .. } => {
            on(triangles)?;
            finite("pressure_pa", *pressure_pa)
        }
    }
}

/// What presses bodies that are not plain elements, or steps that need the contact's stiffness, is a sphere.
fn shapes(spec: &ModelSpec) -> Result<(), ModelError> {
    let Some(tool) = spec.tools.iter().find(|tool| tool.shape.as_capsule().is_some()) else { return Ok(()) };
    let what = match () {
        () if spec.seed.is_some() => "a body of the papers' hybrid, which is touched at one triangle",
        () if spec.settings.integrator == Integrator::BackwardEuler => {
            "backward Euler, which knows no stiffness of a tool that turns"
        }
        () => return Ok(()),
    };
    Err(ModelError::SpheresOnly { tool: tool.name.clone(), what })
}

/// No triangle of the surface is too large for the tool's contact samples.
fn fine_enough(surface: &Surface, rest_positions_m: &[DVec3], tool: &ToolSpec) -> Result<(), ModelError> {
    let sizes_m = (0..surface.triangles.len()).map(|t| (t, surface.longest_edge_m(t, rest_positions_m)));
    let Some((triangle, size_m)) = sizes_m.max_by(|a, b| a.1.total_cmp(&b.1)) else {
        return Ok(());
    };
    let largest_m = LARGEST_TRIANGLE * tool.radius_m;
    if size_m <= largest_m * (1.0 + 1e-9) {
        return Ok(());
    }
    let [a, b, c] = surface.triangle_nodes(triangle).map(|n| rest_positions_m[n as usize]);
    let (tool, radius_m, centre_m) = (tool.name.clone(), tool.radius_m, (a + b + c) / 3.0);
    Err(ModelError::SurfaceTooCoarse { tool, radius_m, triangle, centre_m, size_m, largest_m })
}

fn tool(tool: &ToolSpec) -> Result<(), ModelError> {
    let positive =
        |name, value: f64| setting(name, value, value > 0.0 && value.is_finite(), "must be finite and larger than 0");
    let not_negative =
        |name, value: f64| setting(name, value, value >= 0.0 && value.is_finite(), "must be finite and not negative");
    positive("tool radius_m", tool.radius_m)?;
    not_negative("friction_coefficient", tool.friction_coefficient)?;
    if let Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg } = tool.coupling {
        positive("coupling_stiffness_n_per_m", stiffness_n_per_m)?;
        not_negative("coupling_damping_n_s_per_m", damping_n_s_per_m)?;
        positive("tool mass_kg", mass_kg)?;
    }
    if let ToolShape::Capsule(capsule) = &tool.shape {
        positive("tool half_length_m", capsule.half_length_m)?;
        let orientation = capsule.start_orientation;
        let is_rotation = orientation.is_finite() && orientation.is_normalized();
        setting("tool start_orientation", orientation.length(), is_rotation, "must be of length 1")?;
        if let Coupling::Spring { .. } = tool.coupling {
            let Turning { stiffness_nm_per_rad, damping_nm_s_per_rad, inertia_kg_m2 } = capsule.turning;
            positive("turning stiffness_nm_per_rad", stiffness_nm_per_rad)?;
            not_negative("turning damping_nm_s_per_rad", damping_nm_s_per_rad)?;
            positive("turning inertia_kg_m2", inertia_kg_m2)?;
        }
    }
    let start = tool.start_position_m.length();
    setting("tool start_position_m", start, start.is_finite(), "must be finite")
}

fn regions(spec: &ModelSpec) -> Result<(), ModelError> {
    let (found, expected) = (spec.tet_region.len(), spec.mesh.tets().len());
    if found != expected {
        return Err(ModelError::RegionCount { found, expected });
    }
    indices("region", spec.tet_region.iter().map(|&r| r as usize), spec.regions.len())?;
    for region in &spec.regions {
        let Material { lame, viscosity, law: _ } = region.material;
        let constants =
            Lame::new(lame.lambda_pa, lame.mu_pa).and(Viscosity::new(viscosity.phi_pa_s, viscosity.psi_pa_s));
        constants.map_err(|source| ModelError::Material { region: region.name.clone(), source })?;
        let density = region.density_kg_per_m3;
        let ok = density > 0.0 && density.is_finite();
        setting("density_kg_per_m3", density, ok, "must be finite and larger than 0")?;
    }
    Ok(())
}

fn settings(spec: &ModelSpec) -> Result<(), ModelError> {
    let s = &spec.settings;
    let period = s.tick_period_s;
    setting("tick_period_s", period, period > 0.0 && period.is_finite(), "must be finite and larger than 0")?;
    let safety = s.step_safety;
    setting("step_safety", safety, safety > 0.0 && safety <= 1.0, "must be in (0, 1]")?;
    let stretch = s.stretch_allowance;
    setting("stretch_allowance", stretch, stretch >= 1.0 && stretch.is_finite(), "must be 1 or larger")?;
    let damping = s.mass_damping_per_s;
    setting("mass_damping_per_s", damping, damping >= 0.0 && damping.is_finite(), "must not be negative")?;
    setting("solver_iterations", f64::from(s.solver_iterations), s.solver_iterations >= 1, "must be 1 or more")?;
    let tolerance = s.solver_tolerance;
    setting("solver_tolerance", tolerance, tolerance > 0.0 && tolerance < 1.0, "must be in (0, 1)")?;
    let sleep = s.sleep_tolerance_m;
    setting("sleep_tolerance_m", sleep, sleep >= 0.0 && sleep.is_finite(), "must not be negative")?;
    let sleeps = matches!(s.integrator, Integrator::Leapfrog | Integrator::BackwardEuler);
    setting(
        "sleep_tolerance_m",
        sleep,
        sleep == 0.0 || sleeps,
        "must be 0 with the seeds' schemes, which never sleep",
    )?;
    if let Substeps::Fixed(n) = s.substeps {
        setting("substeps", f64::from(n), (1..=MAX_SUBSTEPS).contains(&n), "must be 1 to 100000")?;
    }
    let gravity = spec.gravity_m_per_s2.length();
    setting("gravity_m_per_s2", gravity, gravity.is_finite(), "must be finite")
}

fn setting(name: &'static str, value: f64, ok: bool, rule: &'static str) -> Result<(), ModelError> {
    if ok { Ok(()) } else { Err(ModelError::Setting { name, value, rule }) }
}

fn indices(what: &'static str, mut indices: impl Iterator<Item = usize>, count: usize) -> Result<(), ModelError> {
    match indices.find(|&index| index >= count) {
        Some(index) => Err(ModelError::OutOfRange { what, index, count }),
        None => Ok(()),
    }
}

/// What a body with particles cannot have.
pub(super) fn particles(spec: &ModelSpec) -> Result<(), ModelError> {
    let settings = &spec.settings;
    let refused = |what, instead| Err(HybridError::NotForParticles { what, instead }.into());
    if settings.integrator != Integrator::Leapfrog {
        return refused("this integrator", "take leapfrog");
    }
    if settings.sleep_tolerance_m > 0.0 {
        return refused(
            "a body that sleeps as a whole",
            "leave sleep_tolerance at 0: its particles sleep where nothing touches them",
        );
    }
    Ok(())
}
