//! The step swept over the limit of linear stability, `r = ω_max dt/2` from 0.5 to 1.05.
//!
//! Up to the limit velocity Verlet conserves `½v² + ½ω²(1 − r²)x²` of every mode, so its energy never exceeds `E₀/(1 − r²)`: the
//! bound asked for, sharp, at any number of steps. The body moves by about 1e-6 of its size, so that it is linear. Above it the
//! physics must notice, and the energy stays what it is then.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::random::Random;
use miette::Result;
use palpate_physics::{Substeps, material::Law};

pub(super) const CRITERION: &str = "up to 0.95 of the limit the energy stays below E0/(1 - r^2), as given; above it: detected within 10 steps and subcycled, never a NaN";

const BELOW: [f64; 6] = [0.5, 0.6, 0.7, 0.8, 0.9, 0.95];
const ABOVE: [f64; 3] = [1.01, 1.02, 1.05];
/// Steps allowed until the motion of an unstable step is noticed.
const STEPS_TO_NOTICE: u32 = 10;

/// What ticks of one step each at a multiple of the limit did.
struct Sweep {
    /// Largest energy over that at the start.
    growth: f64,
    /// Energy over that at the start after [`STEPS_TO_NOTICE`] steps.
    early_growth: f64,
    /// Ticks that were taken back and repeated.
    repeated: u32,
    /// First step that was taken in more parts than asked for.
    noticed: Option<u32>,
    /// First step whose result was refused.
    refused: Option<u32>,
    finite: bool,
}

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let steps = options.pick(2_000, 20_000, 500_000);
    let mut outcome = Outcome::passing();
    for ratio in BELOW {
        let sweep = sweep(options, ratio, steps)?;
        let bound = 1.0 / (1.0 - ratio * ratio);
        outcome.push(Measured::bounded(format!("energy over start, r = {ratio}"), sweep.growth, "1", 1.001 * bound));
        outcome.demand(sweep.finite && sweep.refused.is_none(), || format!("r = {ratio}: not finite"));
        outcome.demand(sweep.noticed.is_none(), || format!("r = {ratio}: subcycled, though stable"));
    }
    for ratio in ABOVE {
        let sweep = sweep(options, ratio, steps)?;
        outcome.push(Measured::value(
            format!("energy over start after 10 steps, r = {ratio}"),
            sweep.early_growth,
            "1",
        ));
        let step = |step: Option<u32>| step.map_or(f64::INFINITY, f64::from);
        let (name, limit) = (format!("first step subcycled, r = {ratio}"), f64::from(STEPS_TO_NOTICE));
        outcome.push(Measured::bounded(name, step(sweep.noticed), "steps", limit));
        outcome.push(Measured::value(format!("steps taken back, r = {ratio}"), f64::from(sweep.repeated), "steps"));
        // What the steps until then may add, and twice that for where the energy of the moment stands.
        let (name, limit) = (format!("energy over start, r = {ratio}"), 2.0 * sweep.early_growth);
        outcome.push(Measured::bounded(name, sweep.growth, "1", limit));
        outcome.demand(sweep.finite && sweep.refused.is_none(), || format!("r = {ratio}: not finite"));
    }
    Ok(outcome)
}

fn sweep(options: &Options, ratio: f64, steps: u32) -> Result<Sweep> {
    let mut spec = rig::body(options, meshes::block(4)?, material(Law::StableNeoHookean, 10e3, 0.4)?);
    spec.settings.substeps = Substeps::Fixed(1);
    let omega = Rig::new(spec.clone())?.model.body().max_natural_frequency_rad_per_s();
    spec.settings.tick_period_s = 2.0 * ratio / omega;
    let mut rig = Rig::new(spec)?;
    let mut random = Random::new(options.seed);
    for v in &mut rig.state.mechanical.v {
        *v = random.vector() * 1e-6 * 0.02 * omega;
    }
    let drive = Drive::still(&rig.model);
    let start_j = rig.energies().held_j();
    let mut sweep = Sweep { growth: 1.0, early_growth: 1.0, repeated: 0, noticed: None, refused: None, finite: true };
    for step in 1..=steps {
        let report = rig.tick(&drive);
        let growth = rig.energies().held_j() / start_j;
        sweep.finite &= rig.is_finite();
        if report.quarantined.is_some() {
            sweep.refused = Some(step);
            break;
        }
        // The energy itself may overflow: NaN is larger than any bound.
        sweep.growth = if growth.is_nan() { growth } else { sweep.growth.max(growth) };
        if step <= STEPS_TO_NOTICE {
            sweep.early_growth = growth;
        }
        sweep.repeated += report.repeated;
        if report.substeps > rig.model.substeps() {
            sweep.noticed.get_or_insert(step);
        }
    }
    Ok(sweep)
}
