//! The tick neither allocates nor frees after warm-up, whatever happens around it: samples, contacts, injected forces, viewers,
//! pauses, resets, quarantine.
#![allow(clippy::unwrap_used, clippy::expect_used)]
mod common;
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use common::{above, block_scene, hybrid::hybrid_scene, path, pressing, springs::springs_scene};
use glam::DVec3;
use palpate_physics::{Model, State, snapshot};
use palpate_realtime::Clock;
use palpate_scene::{Scene, ScriptedHand};
use palpated::{
    serve::config::default_limits,
    sim::{
        exchange::DeviceInput,
        inject::Injection,
        simulation::{Ends, Parts, Simulation},
        tick::Plan,
        timing::Timing,
        tool::Order,
    },
    stream::hub::Demand,
};
use std::sync::Arc;

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// A hybrid body: particles wake and sleep, viewers watch, states come and go.
#[tokio::test]
async fn no_tick_of_a_hybrid_body_allocates() {
    watched_and_restored(hybrid_scene(), 1200, |state| !state.body.active_particles().is_empty());
}

/// The same of a mass-spring surface, refined here and there, most of which sleeps.
#[tokio::test]
async fn no_tick_of_springs_allocates() {
    watched_and_restored(springs_scene(), 2700, |state| !state.mechanical.x.is_empty());
}

/// Runs until something is awake, and for so many ticks until nothing is.
fn watched_and_restored(scene: Scene, ticks: u32, is_awake: impl Fn(&State) -> bool) {
    let demand = Arc::new(Demand::default());
    let model = Arc::new(Model::build(scene.model).unwrap());
    let (simulation, ends) = Simulation::build(Parts {
        session: 1,
        model: Arc::clone(&model),
        timeline: scene.timeline,
        drivers: scene.drivers,
        arm: None,
        limits: default_limits(),
        demand: Arc::clone(&demand),
        arms: tokio::runtime::Handle::current(),
    })
    .unwrap();
    let mut bench = Bench { simulation, ends, demand, clock: Clock::Monotonic, timing: Timing::default() };
    bench.ticks(300, RUN);
    assert!(is_awake(bench.simulation.state()));
    bench.demand.set(8, true);
    let mut copy = State::at_rest(&model);
    assert!(assert_no_alloc(|| copy.try_copy_from(bench.simulation.state())));
    bench.ticks(ticks, RUN);
    assert!(!is_awake(bench.simulation.state()));
    let saved = snapshot::restore(&model, &snapshot::save(&model, &copy)).unwrap();
    assert!(assert_no_alloc(|| bench.simulation.restore(&saved)));
    bench.ticks(300, RUN);
    assert_no_alloc(|| bench.simulation.reset());
    bench.ticks(300, RUN);
}

struct Bench {
    simulation: Box<Simulation>,
    ends: Ends,
    demand: Arc<Demand>,
    clock: Clock,
    timing: Timing,
}

impl Bench {
    fn new() -> Self {
        let scene = block_scene("block", 4);
        let demand = Arc::new(Demand::default());
        let keyframes = [(0.0, above()), (0.1, pressing()), (0.2, above()), (0.3, pressing())];
        let (simulation, ends) = Simulation::build(Parts {
            session: 1,
            model: Arc::new(Model::build(scene.model).unwrap()),
            timeline: scene.timeline,
            drivers: scene.drivers,
            arm: Some(ScriptedHand { tool: 0, tool_name: "finger".into(), path: path(&keyframes) }),
            limits: default_limits(),
            demand: Arc::clone(&demand),
            arms: tokio::runtime::Handle::current(),
        })
        .unwrap();
        Self { simulation, ends, demand, clock: Clock::Monotonic, timing: Timing::default() }
    }

    /// Ticks; an allocation or a release aborts the test.
    fn ticks(&mut self, ticks: u32, plan: Plan) {
        let Self { simulation, clock, timing, .. } = self;
        assert_no_alloc(|| (0..ticks).for_each(|_| simulation.tick(plan, clock, timing)));
    }
}

const RUN: Plan = Plan { advance: true, order: Order::Render };
const PAUSED: Plan = Plan { advance: false, order: Order::Hold };

#[tokio::test]
async fn no_tick_allocates() {
    let mut bench = Bench::new();
    bench.ticks(400, RUN); // simulated arm, in and out of contact

    bench.demand.set(8, true);
    bench.ticks(20, RUN);
    bench.ticks(200, RUN); // with viewers

    bench.ends.tools[0].shared.attach(7, 3.0);
    for sequence in 1..300 {
        let depth = 0.004 * (sequence as f64 * 0.05).sin();
        bench.ends.tools[0].samples.write(Some(DeviceInput {
            attachment: 7,
            sequence,
            device_time_ns: sequence,
            arrived_ns: bench.clock.now_ns(),
            position_m: pressing() + DVec3::Z * depth,
            velocity_m_per_s: DVec3::ZERO,
            orientation: glam::DQuat::IDENTITY,
            angular_velocity_rad_per_s: DVec3::ZERO,
            buttons: 0,
        }));
        bench.ticks(1, RUN);
    }
    bench.ends.tools[0].outputs.update();
    assert!(bench.ends.tools[0].outputs.output_buffer().sample_sequence > 290, "the samples arrived");

    let forces: Vec<Injection> = (0..64)
        .map(|i| Injection {
            node: 60 + i % 8,
            force_n: DVec3::X * 1e-3,
            from_tick: 0,
            tick_count: 5 + i,
            is_bounded: false,
        })
        .collect();
    let next_tick = bench.simulation.state().mechanical.tick + 1;
    assert!(assert_no_alloc(|| bench.simulation.inject(&forces, next_tick)).is_ok());
    bench.ticks(100, RUN); // with injected forces

    bench.ticks(50, PAUSED); // paused
    bench.ends.tools[0].shared.detach();
    bench.ticks(50, RUN); // detached
    assert_no_alloc(|| bench.simulation.reset());
    bench.ticks(50, RUN);

    let absurd = [Injection { node: 60, force_n: DVec3::splat(1e308), from_tick: 0, tick_count: 1, is_bounded: false }];
    let next_tick = bench.simulation.state().mechanical.tick + 1;
    bench.simulation.inject(&absurd, next_tick).unwrap();
    bench.ticks(50, RUN); // quarantined
    assert!(bench.simulation.state().quarantine.is_some());
}
