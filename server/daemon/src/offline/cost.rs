//! What a tick of a scene costs on this machine.
use super::{
    load,
    simulate::Run,
    summary::{Percentiles, TimeNumbers},
};
use crate::bodies::served;
use palpate_physics::Model;
use palpate_scene::Scene;
use std::time::{Duration, Instant};

/// Wall time of a measurement.
const BUDGET: Duration = Duration::from_millis(500);
/// Fewer ticks than these with particles awake tell little; they are waited for until [`PATIENCE`] is over.
const ENOUGH_TICKS: u64 = 100;
const PATIENCE: Duration = Duration::from_secs(5);

/// What ticks cost.
pub(super) struct Cost {
    /// All of them.
    pub(super) all: TimeNumbers,
    /// Those with particles awake, of a hybrid body that a tool may touch.
    pub(super) awake: Option<AwakeCost>,
    /// Told where elements turned inside out in the ticks that were run.
    pub(super) inverted: Option<String>,
}

/// What ticks with particles awake cost.
pub(super) struct AwakeCost {
    pub(super) tick_wall_us: Percentiles,
    pub(super) ticks: u64,
    /// Most particles that were awake at once.
    pub(super) most: usize,
    /// Within the measured time no tool came near: the first one was put to the body for it, and pressed so deep (m).
    pub(super) touched_m: Option<f64>,
}

/// Runs the scene for up to half a second of wall time, or its own duration; a hybrid body that no tool touched by then once more, with its
/// first tool in a light touch where it is nearest to the body.
///
/// # Errors
/// A state that is refused, or a body that cannot be built.
pub(super) fn measure(scene: &Scene, model: &Model) -> miette::Result<Cost> {
    // What counts is a tick that is computed, not one that is slept through.
    if scene.model.settings.sleep_tolerance_m > 0.0 {
        let mut never_asleep = scene.clone();
        never_asleep.model.settings.sleep_tolerance_m = 0.0;
        return of_ticks(&never_asleep, &load::build(&never_asleep)?);
    }
    of_ticks(scene, model)
}

/// Does it with a scene whose body never sleeps as a whole.
fn of_ticks(scene: &Scene, model: &Model) -> miette::Result<Cost> {
    let mut run = Run::new(scene, model)?;
    let all = run_for(&mut run, scene, model)?;
    let inverted = run.inverted();
    let (tick_wall_us, ticks, most) = run.cost_awake();
    if ticks >= ENOUGH_TICKS && served(model).wakes_particles_for_tools() {
        return Ok(Cost { all, awake: Some(AwakeCost { tick_wall_us, ticks, most, touched_m: None }), inverted });
    }
    let touched = touched(scene, model)?;
    Ok(Cost { all, awake: touched.awake, inverted: inverted.or(touched.inverted) })
}

/// What a light touch of the first tool shows; nothing where no tool can touch the body.
#[derive(Default)]
struct Touched {
    /// `None` where it wakes no particles.
    awake: Option<AwakeCost>,
    /// Told where elements turned inside out.
    inverted: Option<String>,
}

fn run_for(run: &mut Run<'_>, scene: &Scene, model: &Model) -> miette::Result<TimeNumbers> {
    let started = Instant::now();
    loop {
        run.tick_and_look();
        run.refuse_quarantined()?;
        if started.elapsed() > BUDGET || run.state.time_s(model) >= scene.output.duration_s {
            return Ok(run.cost());
        }
    }
}

/// Ticks of the body with its first tool in a light touch.
fn touched(scene: &Scene, model: &Model) -> miette::Result<Touched> {
    let Some(touch) = served(model).first_touch(scene) else { return Ok(Touched::default()) };
    let mut run = Run::new(scene, model)?;
    let depth_m = run.touch(&touch);
    let started = Instant::now();
    let is_enough = |ticks: u64, passed: Duration| passed >= PATIENCE || (passed >= BUDGET && ticks >= ENOUGH_TICKS);
    while !is_enough(run.state.mechanical.tick, started.elapsed()) {
        run.tick_and_look();
        run.refuse_quarantined()?;
    }
    let (tick_wall_us, ticks, most) = run.cost_awake();
    let awake = (ticks > 0).then_some(AwakeCost { tick_wall_us, ticks, most, touched_m: Some(depth_m) });
    Ok(Touched { awake, inverted: run.inverted() })
}
