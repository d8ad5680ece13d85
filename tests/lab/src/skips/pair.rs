//! One scene twice, with a skip and without: tick by tick in turns, then compared bit for bit.
use super::Found;
use crate::{bodies, press::Press, timing::interleaved};
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{Model, ModelSpec, SelfContactChoice, Skips, State, material::Law};

const TOOL_RADIUS_M: f64 = 10e-3;
const DEPTH_M: f64 = 2e-3;
const AWAY_M: f64 = 20e-3;
const APPROACH_TICKS: usize = 50;
/// Ventricles are of human size: 4.5 times the tables' small one.
const SCALE: f64 = 4.5;

pub(super) fn viscous_terms(rounds: usize) -> Result<Found> {
    compare(1_352, 0.0, Skips { viscous_terms: false, ..Skips::default() }, rounds)
}

pub(super) fn distant_contact_away(rounds: usize) -> Result<Found> {
    compare(10_000, AWAY_M, Skips { distant_contact: false, ..Skips::default() }, rounds)
}

pub(super) fn distant_contact_pressed(rounds: usize) -> Result<Found> {
    compare(10_000, 0.0, Skips { distant_contact: false, ..Skips::default() }, rounds)
}

/// A ventricle of so many tets that rings, with a tool so far away (m) or, at 0, pressed in.
pub(super) fn scene(tets: u32, away_m: f64, skips: Skips) -> Result<ModelSpec> {
    let shape = bodies::ventricle(SCALE, tets)?;
    let mut tool = bodies::tool_beside(&shape, TOOL_RADIUS_M);
    tool.start_position_m += DVec3::X * away_m;
    let mut spec = bodies::spec(&shape, bodies::material(Law::StableNeoHookean, 10e3, 0.45)?, Some(tool));
    spec.settings.skips = skips;
    // Without the skip of what is distant every vertex would be looked at with every triangle in every substep.
    spec.settings.self_contact = SelfContactChoice::Off;
    Ok(spec)
}

/// The largest distance (m) between the places of a node in two states.
pub(super) fn farthest_m(a: &State, b: &State) -> f64 {
    a.mechanical.x.iter().zip(&b.mechanical.x).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

fn compare(tets: u32, away_m: f64, off: Skips, rounds: usize) -> Result<Found> {
    let model = |skips| Model::build(scene(tets, away_m, skips)?).into_diagnostic();
    let models = [model(Skips::default())?, model(off)?];
    let depth_m = if away_m > 0.0 { 0.0 } else { DEPTH_M };
    let mut presses = models.each_ref().map(|model| Press::new(model, depth_m, APPROACH_TICKS));
    for press in &mut presses {
        for _ in 0..APPROACH_TICKS {
            press.tick();
        }
    }
    let mut contenders: Vec<Box<dyn FnMut() + '_>> =
        presses.iter_mut().map(|press| Box::new(|| _ = press.tick()) as Box<dyn FnMut() + '_>).collect();
    let times = interleaved(&mut contenders, rounds);
    drop(contenders);
    let same_bits = presses[0].state() == presses[1].state();
    let farthest_m = farthest_m(presses[0].state(), presses[1].state());
    Ok(Found { with: times[0], without: times[1], same_bits, farthest_m })
}
