//! What a tick of a scene costs on this machine.
use super::{
    load,
    simulate::Run,
    summary::{Percentiles, TimeNumbers},
};
use glam::DVec3;
use palpate_physics::{BodySpec, Model, bodies::hybrid::Waking};
use palpate_scene::Scene;
use std::time::{Duration, Instant};

/// Wall time of a measurement.
const BUDGET: Duration = Duration::from_millis(500);
/// Fewer ticks than these with particles awake tell nothing.
const ENOUGH_TICKS: u64 = 100;

/// What ticks cost.
pub(super) struct Cost {
    /// All of them.
    pub(super) all: TimeNumbers,
    /// Those with particles awake, of a hybrid body that a tool may touch.
    pub(super) awake: Option<AwakeCost>,
}

/// What ticks with particles awake cost.
pub(super) struct AwakeCost {
    pub(super) tick_wall_us: Percentiles,
    pub(super) ticks: u64,
    /// Most particles that were awake at once.
    pub(super) most: usize,
    /// Within the measured time no tool came near: particles were woken for it, in a body at rest.
    pub(super) untouched: bool,
}

/// Runs the scene for up to half a second of wall time, or its own duration; a hybrid body that no tool touched by then once more, with the
/// particles awake that its first tool would wake where it is nearest to the body.
///
/// # Errors
/// A state that is refused, or a body that cannot be built.
pub(super) fn measure(scene: &Scene, model: &Model) -> miette::Result<Cost> {
    // What counts is a tick that is computed, not one that is slept through.
    if scene.model.settings.sleep_tolerance_m > 0.0 {
        let mut awake = scene.clone();
        awake.model.settings.sleep_tolerance_m = 0.0;
        let model = load::build(&awake)?;
        return Ok(Cost { all: run_for(&mut Run::new(&awake, &model)?, &awake, &model)?, awake: None });
    }
    let mut run = Run::new(scene, model)?;
    let all = run_for(&mut run, scene, model)?;
    let (tick_wall_us, ticks, most) = run.cost_awake();
    let awake = if ticks >= ENOUGH_TICKS && model.body().as_hybrid().is_some() {
        Some(AwakeCost { tick_wall_us, ticks, most, untouched: false })
    } else {
        woken(scene, model)?
    };
    Ok(Cost { all, awake })
}

fn run_for(run: &mut Run<'_>, scene: &Scene, model: &Model) -> miette::Result<TimeNumbers> {
    let started = Instant::now();
    loop {
        run.tick();
        run.refuse_quarantined()?;
        if started.elapsed() > BUDGET || run.state.time_s(model) >= scene.output.duration_s {
            return Ok(run.cost());
        }
    }
}

/// Ticks of the body at rest with particles awake; `None` where there are none that a tool might wake.
fn woken(scene: &Scene, model: &Model) -> miette::Result<Option<AwakeCost>> {
    let particles = near_first_tool(scene, model);
    if particles.is_empty() {
        return Ok(None);
    }
    let mut by_hand = scene.clone();
    if let BodySpec::Hybrid(spec) = &mut by_hand.model.body {
        spec.particles.waking = Waking::ByHand;
    }
    let model = load::build(&by_hand)?;
    let mut run = Run::new(&by_hand, &model)?;
    run.wake_only(particles);
    let started = Instant::now();
    while started.elapsed() < BUDGET || run.cost_awake().1 < ENOUGH_TICKS {
        run.tick();
        run.refuse_quarantined()?;
    }
    let (tick_wall_us, ticks, most) = run.cost_awake();
    Ok(Some(AwakeCost { tick_wall_us, ticks, most, untouched: true }))
}

/// The particles that the first tool would wake where it is nearest to the body, the nearest first.
fn near_first_tool(scene: &Scene, model: &Model) -> Vec<u32> {
    let (Some(hybrid), Some(tool)) = (model.body().as_hybrid(), scene.model.tools.first()) else { return Vec::new() };
    let spec = hybrid.particles();
    let Waking::ByTools { reach_m } = spec.waking else { return Vec::new() };
    let partition = hybrid.partition();
    let all = || (0..partition.particle_count() as u32).filter(|&particle| hybrid.may_wake(particle));
    let from_tool_m = |particle: &u32| partition.particle_m(*particle).distance(tool.start_position_m);
    let Some(first) = all().min_by(|a, b| from_tool_m(a).total_cmp(&from_tool_m(b))) else { return Vec::new() };
    let centre_m = partition.particle_m(first);
    let capsule = tool.shape.as_capsule();
    let half_m = capsule.map_or(DVec3::ZERO, |own| own.start_orientation * (DVec3::Z * own.half_length_m));
    // From a point of a sphere, from a segment of a capsule.
    let distance_m = |particle: u32| {
        let from_centre_m = partition.particle_m(particle) - centre_m;
        let along = (from_centre_m.dot(half_m) / half_m.length_squared().max(f64::MIN_POSITIVE)).clamp(-1.0, 1.0);
        from_centre_m.distance(half_m * along)
    };
    let mut near: Vec<(f64, u32)> = all().map(|p| (distance_m(p), p)).filter(|(d, _)| *d <= reach_m).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(spec.most_active);
    near.into_iter().map(|(_, particle)| particle).collect()
}
