//! Starts from which no body should come: flattened, all in one point, thrown about at random, mirrored.
//!
//! A block held on its floor with mass damping, at the default step, which stretches beyond its allowance make unstable: ticks must be
//! repeated in more substeps. Its free nodes are put wrong at rest and let go for five seconds.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::methods::tet_body;
use crate::random::Random;
use glam::DVec3;
use miette::Result;
use palpate_physics::material::Law;

pub(super) const CRITERION: &str = "stable neo-Hookean from a flattened, point, random and mirrored start: back at rest within 1e-3 L in 5 s, \
     min J > 0; StVK mirrored: inversion is reported";

const SIZE_M: f64 = 0.04;
/// Critical for the block's slowest motion, so that five seconds are many times what return takes.
const DAMPING_PER_S: f64 = 40.0;
#[derive(Debug, Clone, Copy, PartialEq)]
enum Start {
    Flattened,
    Point,
    Random,
    Mirrored,
}

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let mut outcome = Outcome::passing();
    for start in [Start::Flattened, Start::Point, Start::Random, Start::Mirrored] {
        let name = |what: &str| format!("{what}, {}", format!("{start:?}").to_lowercase());
        let mut rig = held(options, Law::StableNeoHookean)?;
        put(&mut rig, start, options.seed);
        outcome.push(Measured::value(name("min J at the start"), rig.min_volume_ratio(), "1"));
        let run = let_go(&mut rig);
        outcome
            .demand(run.refused.is_none(), || format!("{start:?}: quarantined at tick {}", run.refused.unwrap_or(0)));
        outcome.push(Measured::value(name("ticks taken back"), f64::from(run.repeated), "ticks"));
        outcome.push(Measured::value(name("most substeps"), f64::from(run.most_substeps), "1/tick"));
        let apart = rig.largest_displacement_m() / SIZE_M;
        outcome.push(Measured::bounded(name("distance from rest / L after 5 s"), apart, "1", 1e-3));
        outcome.push(Measured::bounded(name("1 - min J after 5 s"), 1.0 - rig.min_volume_ratio(), "1", 1.0 - 1e-9));
    }
    let mut rig = held(options, Law::StVenantKirchhoff)?;
    put(&mut rig, Start::Mirrored, options.seed);
    let run = let_go(&mut rig);
    let reported = rig.min_volume_ratio();
    outcome.demand(run.refused.is_none(), || "StVK was quarantined".to_owned());
    outcome.push(Measured::bounded("StVK: min J reported after 5 s", reported, "1", 0.0));
    Ok(outcome)
}

fn held(options: &Options, law: Law) -> Result<Rig> {
    let mesh = meshes::block(4)?;
    let floor = meshes::nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = rig::body(options, mesh, material(law, 10e3, 0.4)?);
    spec.prescribed = vec![rig::hold("floor", floor)];
    spec.settings.mass_damping_per_s = DAMPING_PER_S;
    Rig::new(spec)
}

fn put(rig: &mut Rig, start: Start, seed: u64) {
    let mut random = Random::new(seed);
    let free = tet_body(&rig.model).inverse_mass_per_kg().to_vec();
    for (x, _) in rig.state.mechanical.x.iter_mut().zip(&free).filter(|(_, inverse)| inverse.x > 0.0) {
        let anywhere = DVec3::new(0.02, 0.02, 0.01) * random.vector() - DVec3::Z * 0.01;
        *x = match start {
            Start::Flattened => DVec3::new(x.x, x.y, -0.02),
            Start::Point => DVec3::new(0.0, 0.0, -0.01),
            Start::Random => anywhere,
            Start::Mirrored => DVec3::new(x.x, x.y, -0.04 - x.z),
        };
    }
    rig.state.mechanical.force_is_current = false;
}

/// How a body came back.
#[derive(Debug, Clone, Copy, Default)]
struct Run {
    /// Tick that was refused.
    refused: Option<u32>,
    /// Ticks that were taken back and repeated.
    repeated: u32,
    most_substeps: u32,
}

/// Five seconds without input.
fn let_go(rig: &mut Rig) -> Run {
    let drive = Drive::still(&rig.model);
    let mut run = Run::default();
    for tick in 0..5000 {
        let report = rig.tick(&drive);
        run.repeated += u32::from(report.repeated > 0);
        run.most_substeps = run.most_substeps.max(report.substeps);
        if report.quarantined.is_some() {
            run.refused = Some(tick);
            break;
        }
    }
    run
}
