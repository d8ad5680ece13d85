//! The heart that is served by default, pressed and dragged with a skip and without: tick by tick in turns.
//!
//! What is skipped of a body with particles is not always exact: which particles are awake changes the answer, and so does the length of the coarse tets' steps. How far
//! any vertex of the skin is from where it is without the skip is told, after the same press.
use super::Found;
use crate::{
    press::Slow,
    timing::{Summary, interleaved},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, bail, ensure, miette};
use palpate_physics::{BodySpec, Model, ModelSpec, SelfContactChoice, Skips, bodies::hybrid::Waking};
use palpate_scene::Limits;

/// How far (m) the finger goes in from where it starts, beside the wall, in so many ticks, and how far it is dragged to each side.
const PRESS_M: f64 = 25e-3;
const PRESS_TICKS: usize = 250;
const DRAG_M: f64 = 5e-3;
/// Way (m) of the finger in a tick while it is dragged: 100 mm/s.
const STEP_M: f64 = 1e-4;
/// More particles than the heart has, and a reach (m) that holds it.
const ALL: usize = 20_000;
const WHOLE_M: f64 = 0.3;
pub(super) const TOLERANCE_M: f64 = 1e-7;
/// Not asleep after so many ticks: it never will be.
const MOST_TICKS: usize = 20_000;

/// Coarse tets in steps of their own, or in all substeps.
pub(super) fn long_steps(rounds: usize) -> Result<Found> {
    compare(
        rounds,
        |_| Ok(()),
        |spec| {
            spec.settings.long_coarse_steps = false;
            Ok(())
        },
    )
}

/// Particles near the finger awake, or all.
pub(super) fn sleeping_particles(rounds: usize) -> Result<Found> {
    compare(
        rounds,
        |_| Ok(()),
        |spec| {
            let BodySpec::Hybrid(hybrid) = &mut spec.body else { bail!("the heart has no particles") };
            hybrid.particles.most_active = ALL;
            hybrid.particles.waking = Waking::ByTools { reach_m: WHOLE_M };
            Ok(())
        },
    )
}

/// Triangles of the skin that the finger may touch, or all. Walls of the heart do not press each other, as in [`super::pair::scene`].
pub(super) fn distant_contact(rounds: usize) -> Result<Found> {
    let alone = |spec: &mut ModelSpec| {
        spec.settings.self_contact = SelfContactChoice::Off;
        Ok(())
    };
    compare(rounds, alone, |spec| {
        alone(spec)?;
        spec.settings.skips = Skips { distant_contact: false, ..Skips::default() };
        Ok(())
    })
}

/// Vertices of the skin that contact asks for, or all in every tick.
pub(super) fn unwatched_skin(rounds: usize) -> Result<Found> {
    let model = Model::build(spec(|_| Ok(()))?).into_diagnostic()?;
    let mut hands = [Hand::new(&model), Hand::new(&model)];
    hands.iter_mut().for_each(Hand::press);
    let mut skin_m = Vec::new();
    let [unwatched, watched] = &mut hands;
    let mut watch = || {
        watched.drag();
        model.surface_positions_m(watched.finger.state(), &mut skin_m);
        std::hint::black_box(&skin_m);
    };
    let times = interleaved(&mut [Box::new(|| unwatched.drag()), Box::new(&mut watch)], rounds);
    found(&times, &hands)
}

/// A heart that has come to rest, left alone or computed on.
pub(super) fn sleep(rounds: usize) -> Result<Found> {
    let model = |sleep_tolerance_m: f64| {
        let spec = spec(|spec| {
            spec.settings.sleep_tolerance_m = sleep_tolerance_m;
            Ok(())
        })?;
        Model::build(spec).into_diagnostic()
    };
    let models = [model(TOLERANCE_M)?, model(0.0)?];
    let mut hands = models.each_ref().map(Hand::new);
    for hand in &mut hands {
        hand.press();
        hand.leave();
    }
    let mut ticks = 0;
    while !hands[0].finger.state().sleep.asleep {
        ensure!(ticks < MOST_TICKS, "the heart did not fall asleep in {MOST_TICKS} ticks");
        ticks += 1;
        hands.iter_mut().for_each(Hand::stay);
    }
    let [sleepy, awake] = &mut hands;
    let times = interleaved(&mut [Box::new(|| sleepy.stay()), Box::new(|| awake.stay())], rounds);
    ensure!(hands[0].finger.state().sleep.asleep, "the heart woke while it was timed");
    found(&times, &hands)
}

fn spec(change: impl FnOnce(&mut ModelSpec) -> Result<()>) -> Result<ModelSpec> {
    let scene = palpate_scene::load_builtin("heart", &Limits::local(), &mut |_, _| ());
    let mut spec = scene.ok_or_else(|| miette!("the built-in scene is missing"))??.model;
    change(&mut spec)?;
    Ok(spec)
}

fn compare(
    rounds: usize,
    with: impl FnOnce(&mut ModelSpec) -> Result<()>,
    without: impl FnOnce(&mut ModelSpec) -> Result<()>,
) -> Result<Found> {
    let models = [Model::build(spec(with)?).into_diagnostic()?, Model::build(spec(without)?).into_diagnostic()?];
    let mut hands = models.each_ref().map(Hand::new);
    hands.iter_mut().for_each(Hand::press);
    let [one, other] = &mut hands;
    let times = interleaved(&mut [Box::new(|| one.drag()), Box::new(|| other.drag())], rounds);
    found(&times, &hands)
}

fn found(times: &[Summary], hands: &[Hand<'_>; 2]) -> Result<Found> {
    let survived = hands.iter().all(|hand| hand.finger.state().quarantine.is_none());
    ensure!(survived, "a tick of the heart was refused, so that what was timed are no ticks");
    let [mut one_m, mut other_m] = [Vec::new(), Vec::new()];
    hands[0].model.surface_positions_m(hands[0].finger.state(), &mut one_m);
    hands[1].model.surface_positions_m(hands[1].finger.state(), &mut other_m);
    let farthest_m = one_m.iter().zip(&other_m).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let same_bits = hands[0].finger.state().mechanical == hands[1].finger.state().mechanical;
    Ok(Found { with: times[0], without: times[1], same_bits, farthest_m })
}

/// A hand with its finger beside a heart.
struct Hand<'m> {
    model: &'m Model,
    finger: Slow<'m>,
    start_m: DVec3,
    at_m: DVec3,
    dragged: usize,
}

impl<'m> Hand<'m> {
    fn new(model: &'m Model) -> Self {
        let start_m = model.tools()[0].start_position_m;
        Self { model, finger: Slow::at_rest(model), start_m, at_m: start_m, dragged: 0 }
    }

    fn press(&mut self) {
        for tick in 1..=PRESS_TICKS {
            self.at_m = self.start_m - DVec3::X * (PRESS_M * tick as f64 / PRESS_TICKS as f64);
            self.finger.tick(self.at_m);
        }
    }

    /// A tick on the way to one side, to the other and back.
    fn drag(&mut self) {
        self.dragged += 1;
        let phase = (self.dragged as f64 * STEP_M / DRAG_M + 1.0).rem_euclid(4.0);
        let side = if phase < 2.0 { phase - 1.0 } else { 3.0 - phase };
        self.finger.tick(self.at_m + DVec3::Y * (DRAG_M * side));
    }

    fn leave(&mut self) {
        for tick in 1..=PRESS_TICKS {
            self.finger.tick(self.at_m.lerp(self.start_m, tick as f64 / PRESS_TICKS as f64));
        }
        self.at_m = self.start_m;
    }

    fn stay(&mut self) {
        self.finger.tick(self.at_m);
    }
}
