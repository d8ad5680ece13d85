//! Whatever is ordered, the force on an arm neither jumps nor takes longer to vanish than it may. A clock by hand.
use crate::common;
use crate::common::{above, block_scene, pressing};
use glam::DVec3;
use palpate_control::{HandPath, Keyframe, LocalModel, RenderSettings};
use palpate_physics::Model;
use palpate_realtime::{Clock, ManualClock};
use palpate_scene::{Limits, Scene, ScriptedHand, builtin, parse};
use palpated::{
    serve::config::default_limits,
    sim::{
        exchange::{DeviceInput, ToolOutput},
        simulation::{Ends, Parts, Simulation},
        tick::Plan,
        timing::Timing,
        tool::Order,
    },
    stream::hub::Demand,
};
use std::sync::Arc;

const RUN: Plan = Plan { advance: true, order: Order::Render };
const PAUSED: Plan = Plan { advance: false, order: Order::Hold };

/// The block's upper side (m).
const TOP_M: f64 = 0.02;

struct Bench {
    simulation: Box<Simulation>,
    ends: Ends,
    clock: Clock,
    time: Arc<ManualClock>,
    timing: Timing,
    sequence: u64,
}

impl Bench {
    fn new() -> Self {
        Self::with_arm(None)
    }

    fn with_peak(max_force_n: f64) -> Self {
        let bench = Self::new();
        bench.ends.tools[0].shared.detach();
        bench.ends.tools[0].shared.attach(7, max_force_n);
        bench
    }

    /// With a simulated arm whose hand rests at a place while no device is attached.
    fn with_arm(hand_m: Option<DVec3>) -> Self {
        let scene = block_scene("block", 3);
        let model = Arc::new(Model::build(scene.model.clone()).unwrap());
        Self::on(scene, model, hand_m)
    }

    fn on(scene: Scene, model: Arc<Model>, hand_m: Option<DVec3>) -> Self {
        let hand =
            |at| ScriptedHand { tool: 0, tool_name: "finger".into(), path: common::path(&[(0.0, at), (1.0, at)]) };
        let (simulation, ends) = Simulation::build(Parts {
            session: 1,
            model,
            timeline: scene.timeline,
            drivers: scene.drivers,
            arm: hand_m.map(hand),
            limits: default_limits(),
            demand: Arc::new(Demand::default()),
            arms: tokio::runtime::Handle::current(),
        })
        .unwrap();
        let (clock, time) = Clock::manual();
        time.advance(1_000_000_000);
        ends.tools[0].shared.attach(7, 3.0);
        Self { simulation, ends, clock, time, timing: Timing::default(), sequence: 0 }
    }

    /// A tick that took `took_ms`, with a fresh sample.
    fn tick(&mut self, plan: Plan, position_m: DVec3, took_ms: u64) -> ToolOutput {
        self.time.advance(took_ms * 1_000_000);
        self.sequence += 1;
        self.ends.tools[0].samples.write(Some(DeviceInput {
            attachment: 7,
            sequence: self.sequence,
            device_time_ns: 0,
            arrived_ns: self.clock.now_ns(),
            position_m,
            velocity_m_per_s: DVec3::ZERO,
            orientation: glam::DQuat::IDENTITY,
            angular_velocity_rad_per_s: DVec3::ZERO,
            buttons: 0,
        }));
        self.simulation.tick(plan, &self.clock, &self.timing);
        self.ends.tools[0].outputs.update();
        *self.ends.tools[0].outputs.output_buffer()
    }

    /// Pressed, at rest, at full force (N).
    fn pressed() -> (Self, f64) {
        let mut bench = Self::new();
        for _ in 0..300 {
            bench.tick(RUN, above(), 1);
        }
        let mut force_n = DVec3::ZERO;
        for _ in 0..600 {
            force_n = bench.tick(RUN, pressing(), 1).force_n;
        }
        assert!(force_n.z > 0.1, "it presses: {force_n}");
        (bench, force_n.length())
    }
}

#[tokio::test]
async fn after_a_pause_the_force_comes_back_as_slowly_as_after_attaching() {
    let (mut bench, full_n) = Bench::pressed();
    let limits = default_limits();
    let mut last_n = full_n;
    for _ in 0..16 {
        let now_n = bench.tick(PAUSED, pressing(), 1).force_n.length();
        let most_n = full_n * 1e-3 / limits.watchdog.ramp_to_zero_s;
        assert!(last_n - now_n <= 1.01 * most_n && now_n <= last_n, "{last_n} N to {now_n} N");
        last_n = now_n;
    }
    assert_eq!(last_n, 0.0, "zero within ramp_to_zero_s");
    let most_n = 1.5 * full_n * 1e-3 / limits.watchdog.ramp_up_s;
    for _ in 0..400 {
        let now_n = bench.tick(RUN, pressing(), 1).force_n.length();
        assert!((now_n - last_n).abs() <= most_n, "{last_n} N to {now_n} N in a tick; at most {most_n} N");
        last_n = now_n;
    }
    assert!(last_n > 0.9 * full_n, "and it comes back: {last_n} N of {full_n} N");
}

#[tokio::test]
async fn a_slow_body_is_released_as_fast_as_a_quick_one() {
    let (mut bench, full_n) = Bench::pressed();
    // Ticks of 5 ms of the clock: three make the 12 ms.
    let mut forces_n = Vec::new();
    for _ in 0..4 {
        forces_n.push(bench.tick(Plan { advance: true, order: Order::Release }, pressing(), 5).force_n.length());
    }
    assert!(forces_n[0] > 0.0 && forces_n[0] < full_n, "{forces_n:?}");
    assert_eq!(forces_n[3], 0.0, "{forces_n:?}");
    assert!(bench.simulation.is_released());
}

/// The largest force (N) that a bridge renders from the output's model anywhere in its validity radius.
fn most_rendered_n(output: &ToolOutput) -> f64 {
    let Some(model) = output.local_model else { return 0.0 };
    let rendering =
        RenderSettings { hold_s: 1.0, forget_s: 2.0, damping_n_s_per_m: 0.0, max_stiffness_n_per_m: 1e9 }.checked();
    let model = LocalModel {
        point_m: model.point_m,
        normal: model.normal,
        force_n: model.force_n,
        stiffness_n_per_m: model.stiffness_n_per_m,
        validity_radius_m: model.validity_radius_m,
        max_force_n: output.model_max_force_n,
    };
    let model = model.accept().expect("a bridge takes it");
    let directions = [-1.0, 0.0, 1.0].map(|x| [-1.0, 0.0, 1.0].map(|y| [-1.0, 0.0, 1.0].map(|z| DVec3::new(x, y, z))));
    let at = |direction: &DVec3| model.point_m + direction.normalize_or_zero() * model.validity_radius_m;
    let rendered = directions.as_flattened().as_flattened().iter();
    let force_n = |place_m| model.render(place_m, DVec3::ZERO, 0.0, rendering.as_ref().unwrap()).force_n.length();
    rendered.map(|direction| force_n(at(direction))).fold(0.0, f64::max)
}

/// The local model went to the arm as stiff and strong as the body is, whatever the limit of the arm.
#[tokio::test]
async fn the_local_model_keeps_to_the_peak_and_the_ramp_wherever_it_is_rendered() {
    let (mut bench, full_n) = Bench::pressed();
    let free = bench.tick(RUN, pressing(), 1);
    let model = free.local_model.unwrap();
    assert!((model.force_n.length() - free.force_n.length()).abs() < 1e-9 * full_n, "not limited: the model's force");
    assert!(most_rendered_n(&free) > 1.01 * full_n, "deeper is more: {} N", most_rendered_n(&free));
    let stiffness = model.stiffness_n_per_m.z_axis.z;

    // An arm that takes only half of it: half the force at the point, half as stiff, and no more anywhere.
    let (mut bench, peak_n) = (Bench::with_peak(0.5 * full_n), 0.5 * full_n);
    for _ in 0..300 {
        assert!(most_rendered_n(&bench.tick(RUN, above(), 1)) <= peak_n);
    }
    let mut output = ToolOutput::default();
    for _ in 0..600 {
        output = bench.tick(RUN, pressing(), 1);
        assert!(most_rendered_n(&output) <= peak_n * (1.0 + 1e-12), "{} N", most_rendered_n(&output));
    }
    let model = output.local_model.unwrap();
    assert!((model.force_n.length() - peak_n).abs() < 1e-3 * peak_n, "{} N", model.force_n.length());
    let softened = model.stiffness_n_per_m.z_axis.z / stiffness;
    assert!((softened - 0.5).abs() < 0.05, "{softened}");

    // On the way to zero: never more than the ramp leaves.
    let limits = default_limits();
    for tick in 1..=16_u32 {
        let output = bench.tick(PAUSED, pressing(), 1);
        let ramp = (1.0 - f64::from(tick) * 1e-3 / limits.watchdog.ramp_to_zero_s).max(0.0);
        assert!(most_rendered_n(&output) <= ramp * peak_n + 1e-9, "{} N", most_rendered_n(&output));
        assert!(tick < 16 || output.local_model.is_none());
    }
}

/// Largest displacement of a node (m).
fn deformation_m(bench: &Bench, rest_m: &[DVec3]) -> f64 {
    bench.simulation.state().mechanical.x.iter().zip(rest_m).map(|(x, rest)| x.distance(*rest)).fold(0.0, f64::max)
}

#[tokio::test]
async fn a_device_that_attaches_beyond_the_body_does_not_drag_its_tool_through_it() {
    let mut bench = Bench::new();
    let rest_m = bench.simulation.state().mechanical.x.clone();
    // The tool hangs above the block; the device is beside it, low.
    let beside = DVec3::new(-0.02, 0.02, 0.01);
    let mut most_m = 0.0_f64;
    for _ in 0..300 {
        let output = bench.tick(RUN, beside, 1);
        assert_eq!(output.force_n, DVec3::ZERO);
        assert!(output.proxy_position_m.distance(beside) < 1e-9, "{}", output.proxy_position_m);
        most_m = most_m.max(deformation_m(&bench, &rest_m));
    }
    assert!(most_m < 1e-9, "the body was moved by {most_m} m");
    // After a reset the same: the tool's start lies across the block.
    bench.simulation.reset();
    for _ in 0..300 {
        let output = bench.tick(RUN, beside, 1);
        assert!(output.proxy_position_m.distance(beside) < 1e-9, "{}", output.proxy_position_m);
        assert!(deformation_m(&bench, &rest_m) < 1e-9);
    }
}

#[tokio::test]
async fn a_device_that_attaches_in_the_body_gets_no_force_before_it_has_left_it() {
    for start in [pressing(), DVec3::new(0.02, 0.02, 0.01)] {
        let mut bench = Bench::new();
        for _ in 0..500 {
            let output = bench.tick(RUN, start, 1);
            assert_eq!((output.force_n, output.local_model), (DVec3::ZERO, None), "{start}");
        }
        // Out it goes, at 0.1 m/s.
        for step in 0..=250 {
            let position_m = start.lerp(above(), f64::from(step) / 250.0);
            let output = bench.tick(RUN, position_m, 1);
            // As long as any of the ball is in the body: samples it met from behind carry nothing, but it is not clear of them.
            if position_m.z < TOP_M + 0.9 * common::RADIUS_M {
                assert_eq!((output.force_n, output.local_model), (DVec3::ZERO, None), "{position_m}, out of {start}");
            }
            assert!(output.force_n.length() < 0.1, "{} N on the way out of {start}", output.force_n.length());
        }
        for _ in 0..300 {
            bench.tick(RUN, above(), 1);
        }
        let force_n = (0..300).map(|_| bench.tick(RUN, pressing(), 1).force_n.z).fold(0.0, f64::max);
        assert!(force_n > 0.1, "then it feels the body: {force_n} N");
    }
}

/// An arm came back in the middle of a press. Its tool went through the ventricle's wall into the cavity, and there it stayed, without force, however often the arm went out and in.
#[tokio::test]
async fn a_device_that_attaches_in_a_wall_feels_it_once_it_has_been_outside() {
    let scene = || parse(builtin("ventricle").unwrap(), "ventricle", None, &Limits::local(), &mut |_, _| ()).unwrap();
    let model = Arc::new(Model::build(scene().model).unwrap());
    let key = |(time_s, x_m)| Keyframe { time_s, position_m: DVec3::X * x_m };
    let path = HandPath::new([(0.0, 0.045), (0.2, 0.028), (0.3, 0.028)].map(key).to_vec(), Some(0.5)).unwrap();
    let hand = |tick: u32| path.at(1e-3 * f64::from(tick)).0;
    for phase_ms in [110, 120, 128, 130, 132, 140, 330] {
        let mut bench = Bench::on(scene(), Arc::clone(&model), None);
        let felt = (phase_ms..phase_ms + 1500).map(|ms| bench.tick(RUN, hand(ms), 1).force_n.x);
        let most_n = felt.skip(500).fold(0.0, f64::max);
        assert!(
            most_n > 0.5,
            "attached {phase_ms} ms after its hand came from outside: {most_n} N within three presses"
        );
    }
}

/// One whose tool is in the surface, its centre outside, is put to its device again and again until it goes: that moves neither tool nor body.
#[tokio::test]
async fn a_device_that_attaches_in_the_surface_disturbs_nothing() {
    let scene = parse(builtin("ventricle").unwrap(), "ventricle", None, &Limits::local(), &mut |_, _| ()).unwrap();
    let model = Arc::new(Model::build(scene.model.clone()).unwrap());
    let mut bench = Bench::on(scene, model, None);
    let rest_m = bench.simulation.state().mechanical.x.clone();
    let mut most_m = 0.0_f64;
    for tick in 0..2000 {
        // 5 mm deep, and a tremor of half a millimetre.
        let at = DVec3::X * (0.035 + 5e-4 * (0.05 * f64::from(tick)).sin());
        let output = bench.tick(RUN, at, 1);
        assert_eq!((output.force_n, output.local_model), (DVec3::ZERO, None), "tick {tick}");
        most_m = most_m.max(deformation_m(&bench, &rest_m));
    }
    assert!(most_m < 1e-3, "the body was moved by {most_m} m");
}

#[tokio::test]
async fn the_simulated_arm_takes_over_where_a_device_leaves() {
    let mut bench = Bench::with_arm(Some(above()));
    let beside = DVec3::new(-0.02, 0.02, 0.01);
    for _ in 0..50 {
        bench.tick(RUN, beside, 1);
    }
    bench.ends.tools[0].shared.detach();
    let mut last_m = beside;
    for _ in 0..200 {
        bench.time.advance(1_000_000);
        bench.simulation.tick(RUN, &bench.clock, &bench.timing);
        let now_m = bench.simulation.state().mechanical.tools[0].target.position_m;
        assert!(now_m.distance(last_m) < 2e-3, "a hand does not go from {last_m} to {now_m} in a tick");
        last_m = now_m;
    }
    assert!(last_m.distance(beside) > 1e-3, "its hand does lead it home: {last_m}");
}
