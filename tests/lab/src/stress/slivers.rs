//! Meshes no one should use: a sliver of 1°, edges in a ratio of 1000:1. The step comes from their spectrum.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::random::Random;
use miette::Result;
use palpate_physics::{TetMesh, material::Law, mesh::quality};

pub(super) const CRITERION: &str = "slivers of 1 degree, edge ratio 1000:1: finite, dt from the spectrum";

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let side = meshes::even(-0.02, 0.02, 4);
    // A layer as thick as a thousandth of the longest edge, the diagonal of a cell of 10 × 10 × 9.98 mm.
    let thin_m = 0.01 * 3.0_f64.sqrt() * 1e-3;
    let layered = meshes::bricks(&side, &side, &[-0.02, -0.01, -thin_m, 0.0])?;
    let mut outcome = Outcome::passing();
    ring(options, "1 degree", meshes::with_sliver(&meshes::block(4)?, 1.0)?, &mut outcome)?;
    ring(options, "1000:1", layered, &mut outcome)?;
    Ok(outcome)
}

/// A free body with this mesh rings; its energy stays.
fn ring(options: &Options, name: &str, mesh: TetMesh, outcome: &mut Outcome) -> Result<()> {
    let shape = quality::measure(&mesh);
    let mut rig = Rig::new(rig::body(options, mesh, material(Law::StableNeoHookean, 10e3, 0.4)?))?;
    let mut random = Random::new(options.seed);
    for (v, x) in rig.state.mechanical.v.iter_mut().zip(&rig.state.mechanical.x) {
        *v = *x * 1.0 + random.vector() * 1e-3;
    }
    let start_j = rig.energies().held_j();
    let drive = Drive::still(&rig.model);
    let mut most = 0.0_f64;
    for tick in 0..options.pick(20, 200, 5_000) {
        let report = rig.tick(&drive);
        outcome.demand(report.quarantined.is_none(), || format!("{name}: quarantined at tick {tick}"));
        most = most.max(rig.energies().held_j() / start_j);
    }
    outcome.demand(rig.is_finite(), || format!("{name}: not finite"));
    let settings = rig.model.settings();
    let dt_s = settings.tick_period_s / f64::from(rig.model.substeps());
    let limit_s = 2.0 / rig.model.body().max_natural_frequency_rad_per_s();
    outcome.push(Measured::value(format!("smallest dihedral angle, {name}"), shape.min_dihedral_deg, "deg"));
    outcome.push(Measured::value(
        format!("longest edge over shortest, {name}"),
        shape.edge_range_m.1 / shape.edge_range_m.0,
        "1",
    ));
    outcome.push(Measured::value(format!("substeps, {name}"), f64::from(rig.model.substeps()), "1/tick"));
    outcome.push(Measured::bounded(format!("dt over 2/omega_max, {name}"), dt_s / limit_s, "1", settings.step_safety));
    // Leapfrog's bound at the step it may take: E0/(1 − r²).
    let bound = 1.0 / (1.0 - (dt_s / limit_s).powi(2));
    outcome.push(Measured::bounded(format!("energy over start, {name}"), most, "1", bound));
    Ok(())
}
