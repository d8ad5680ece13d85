//! What a seed body needs of a specification, and what it cannot have.
use super::{ModelError, ModelSpec};
use crate::settings::{Integrator, MAX_SUBSTEPS, Substeps};
use crate::{
    bodies::seed::{SeedBodySpec, SeedModel, SeedParameters, SeedSpec},
    contact::{ContactModel, SurfaceModuli},
    material::{Law, Material},
};
use glam::DVec3;

/// Part of its longest step that contact and couplings may take.
const STEP_SAFETY: f64 = 0.9;

/// The papers' model and its steps per tick.
pub(super) fn build(spec: &ModelSpec, wanted: SeedBodySpec) -> Result<(SeedModel, u32), ModelError> {
    let SeedBodySpec { layer, parameters } = wanted;
    demand(spec, &parameters)?;
    let steps = steps_per_tick(spec.settings.tick_period_s, parameters.dt_s)?;
    let model = SeedModel::build(SeedSpec {
        core: spec.mesh.clone(),
        held_nodes: spec.prescribed.iter().flat_map(|set| set.nodes.iter().copied()).collect(),
        layer,
        parameters: SeedParameters { dt_s: spec.settings.tick_period_s / f64::from(steps), ..parameters },
    })?;
    Ok((model, steps))
}

/// As few as are no longer than `dt_s`.
fn steps_per_tick(tick_period_s: f64, dt_s: f64) -> Result<u32, ModelError> {
    // A tick that is whole steps is not one more for its last digit.
    const ROUNDING: f64 = 1e-9;
    let steps = (tick_period_s / dt_s * (1.0 - ROUNDING)).ceil().max(1.0);
    if steps <= f64::from(MAX_SUBSTEPS) {
        return Ok(steps as u32);
    }
    Err(ModelError::Setting { name: "dt_s", value: dt_s, rule: "must leave 100000 steps or fewer to a tick" })
}

fn demand(spec: &ModelSpec, parameters: &SeedParameters) -> Result<(), ModelError> {
    let SeedParameters { lame, viscosity, convention, density_kg_per_m3, .. } = *parameters;
    let material = Material::new(Law::StVenantKirchhoff, lame, viscosity, convention);
    let is_its = spec.regions.len() == 1
        && spec.regions.iter().all(|r| r.material == material && r.density_kg_per_m3 == density_kg_per_m3);
    let settings = &spec.settings;
    let demands = [
        (is_its, "other materials than the one of its parameters", "give it one St. Venant-Kirchhoff material"),
        (spec.gravity_m_per_s2 == DVec3::ZERO, "gravity", "its particles have none; leave it out"),
        (spec.prescribed.iter().all(|set| set.axes == [true; 3]), "nodes held along some axes", "hold all three"),
        (
            settings.integrator == Integrator::Leapfrog,
            "another integrator",
            "it has its own two; leave this at leapfrog",
        ),
        (settings.substeps == Substeps::Measured, "a number of substeps", "give its step dt_s"),
        (settings.mass_damping_per_s == 0.0, "mass damping", "its viscosities damp it; leave it at 0"),
        (settings.sleep_tolerance_m == 0.0, "sleep of the whole body", "leave sleep_tolerance_m at 0"),
    ];
    match demands.into_iter().find(|(kept, ..)| !kept) {
        Some((_, what, instead)) => Err(ModelError::NotForSeeds { what, instead }),
        None => Ok(()),
    }
}

/// Of every triangle of the surface: of the layer's stiffness, where there is one.
pub(super) fn moduli(seed: &SeedModel) -> Vec<SurfaceModuli> {
    let lame = seed.core().material().lame;
    let factor = if seed.layer().is_some() { seed.parameters().layer_factor() } else { 1.0 };
    let moduli = SurfaceModuli {
        p_wave_pa: factor * lame.p_wave_modulus_pa(),
        indentation_pa: factor * lame.young_modulus_pa() / (1.0 - lame.poisson_ratio().powi(2)),
    };
    vec![moduli; seed.surface_triangles().len()]
}

/// The natural frequency (rad/s) that contact is made not to exceed by much: a quarter of what the explicit step bears, `(ω dt)² ≤ 4`.
pub(super) fn contact_frequency_rad_per_s(seed: &SeedModel) -> f64 {
    seed.parameters().dt_s.recip()
}

/// Tools on couplings, too, are stepped with the body.
pub(super) fn demand_soft_couplings(contact: &ContactModel, seed: &SeedModel) -> Result<(), ModelError> {
    let dt_s = seed.parameters().dt_s;
    let longest_s = STEP_SAFETY * 2.0 / contact.tool_frequency_sq.sqrt();
    if dt_s <= longest_s { Ok(()) } else { Err(ModelError::CouplingTooStiff { dt_s, longest_s }) }
}
