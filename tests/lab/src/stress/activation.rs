//! Beside a sphere that presses a hybrid body, and trembles, a strained region wakes and falls asleep a hundred times a second.
use super::{Measured, Options, Outcome, rig};
use crate::random::Random;
use crate::{bodies, methods, problems::body::Body};
use glam::DQuat;
use miette::Result;
use palpate_physics::{
    BodySpec, Settings,
    bodies::hybrid::HybridSpec,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    material::Law,
    world::wake_only,
};
use std::f64::consts::TAU;

pub(super) const CRITERION: &str = "a strained region beside a tool switched at 100 Hz: ledger closed to 1e-9 of the elastic energy over each switch, \
                                    energy never up by more than that, force within 1 % from tick to tick";

const RADIUS_M: f64 = 10e-3;
const DEPTH_M: f64 = 4e-3;
/// The tool's tremor (m) and how many ticks a turn of it takes.
const TREMOR_M: f64 = 1e-4;
const TREMOR_TICKS: f64 = 300.0;
const RAMP_TICKS: u32 = 200;
const SPACING_M: f64 = 2.5e-3;

/// What is switched, and how often.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Switching {
    /// Ticks (ms) from one switch to the next.
    pub every_ms: u32,
    /// Of the body.
    pub poisson_ratio: f64,
}

impl Default for Switching {
    fn default() -> Self {
        Self { every_ms: 5, poisson_ratio: 0.45 }
    }
}

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let Switching { every_ms, poisson_ratio } = options.switching;
    let switches = options.pick(60, 400, 100_000);
    let (coarse, fine) = (Body::Block.tets(4)?, Body::Block.tets(32)?);
    let mut spec = rig::body(options, coarse.mesh, bodies::material(Law::StableNeoHookean, 10e3, poisson_ratio)?);
    spec.prescribed = coarse.prescribed;
    let particles = methods::particles(Body::Block, &fine, SPACING_M, 600)?;
    spec.body = BodySpec::Hybrid(HybridSpec { coarse: rig::solid(&spec).clone(), particles });
    spec.settings = Settings { mass_damping_per_s: 20.0, ..spec.settings };
    spec.tools = vec![ToolSpec {
        name: "sphere".into(),
        shape: ToolShape::Sphere,
        radius_m: RADIUS_M,
        coupling: Coupling::Rigid,
        friction_coefficient: 0.3,
        start_position_m: fine.first_touch_m(RADIUS_M),
    }];
    let mut rig = rig::Rig::new(spec)?;
    let turn = DQuat::from_axis_angle(fine.normal, TAU * Random::new(options.seed).unit());
    let across_m = turn * fine.normal.any_orthonormal_vector() * 9e-3;
    let touched = methods::nearest(&rig.model, fine.touch_m, 200);
    let beside: Vec<u32> =
        methods::nearest(&rig.model, fine.touch_m + across_m, 200).into_iter().chain(touched.iter().copied()).collect();
    let mut drive = rig::Drive::still(&rig.model);
    let start_m = fine.first_touch_m(RADIUS_M);
    let mut press = |rig: &mut rig::Rig, depth_m: f64| {
        drive.tools = vec![ToolTarget::at(start_m - fine.normal * depth_m)];
        rig.tick(&drive).quarantined
    };
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, touched.iter().copied());
    let mut outcome = Outcome::passing();
    for tick in 0..2 * RAMP_TICKS {
        press(&mut rig, DEPTH_M * f64::from(tick.min(RAMP_TICKS)) / f64::from(RAMP_TICKS));
    }
    let (mut residual, mut jump, mut force_step) = (0.0_f64, f64::NEG_INFINITY, 0.0_f64);
    for number in 0..switches {
        let awake = if number % 2 == 0 { &beside } else { &touched };
        let before = rig.energies();
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake.iter().copied());
        let after = rig.energies();
        residual = residual.max((after.balance_j() - before.balance_j()).abs() / before.elastic_j);
        jump = jump.max((after.held_j() - before.held_j()) / before.elastic_j);
        for tick in 0..every_ms {
            let force_n = rig.state.mechanical.tools[0].contact_force_n;
            let phase = TAU * f64::from(every_ms * number + tick) / TREMOR_TICKS;
            if let Some(quarantine) = press(&mut rig, DEPTH_M - TREMOR_M * phase.sin()) {
                outcome.broken.push(quarantine.to_string());
                return Ok(outcome);
            }
            let now_n = rig.state.mechanical.tools[0].contact_force_n;
            force_step = force_step.max(now_n.distance(force_n) / force_n.length());
        }
    }
    outcome.push(Measured::value("force at the end", rig.state.mechanical.tools[0].contact_force_n.length(), "N"));
    outcome.push(Measured::bounded("ledger over a switch, of the elastic energy", residual, "1", 1e-9));
    outcome.push(Measured::bounded("energy up at a switch, of the elastic energy", jump, "1", 1e-9));
    outcome.push(Measured::bounded("force from tick to tick", 100.0 * force_step, "%", 1.0));
    Ok(outcome)
}
