//! The loop takes orders one a tick, and works on them without touching the heap.
#![allow(clippy::unwrap_used, clippy::expect_used)]
mod common;
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use common::{above, block_scene, path, pressing};
use glam::DVec3;
use palpate_physics::{Model, State, snapshot};
use palpate_realtime::{Clock, TickLoop};
use palpate_scene::{Scene, ScriptedHand};
use palpated::{
    serve::config::default_limits,
    sim::{
        command::{CAPACITY, Copy, Done, Orders, Refusal, Request, desk},
        exchange::DeviceInput,
        inject::Injection,
        simulation::{Ends, Parts, Simulation},
        thread::{Loop, StopSign},
        timing::Timing,
    },
    stream::hub::Demand,
};
use std::{sync::Arc, thread::JoinHandle, time::Duration};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// A session whose simulated arm presses now and then.
fn session(number: u64, scene: Scene, demand: &Arc<Demand>) -> (Box<Simulation>, Ends, Arc<Model>) {
    let keyframes = [(0.0, above()), (0.1, pressing()), (0.2, above()), (0.3, pressing())];
    let model = Arc::new(Model::build(scene.model).unwrap());
    let (simulation, ends) = Simulation::build(Parts {
        session: number,
        model: Arc::clone(&model),
        timeline: scene.timeline,
        drivers: scene.drivers,
        arm: Some(ScriptedHand { tool: 0, tool_name: "finger".into(), path: path(&keyframes) }),
        limits: default_limits(),
        demand: Arc::clone(demand),
        arms: tokio::runtime::Handle::current(),
    })
    .unwrap();
    (simulation, ends, model)
}

/// The real loop in a thread of its own, in which an allocation or a release aborts the test.
struct Running {
    orders: Orders,
    sign: StopSign,
    timing: Arc<Timing>,
    thread: Option<JoinHandle<()>>,
    begin: std::sync::mpsc::Sender<()>,
}

impl Running {
    /// Waits for [`Running::begin`].
    fn on(simulation: Box<Simulation>) -> Self {
        let (desk, orders, clerk) = desk().unwrap();
        tokio::spawn(clerk.work());
        let (sign, timing) = (StopSign::default(), Arc::new(Timing::default()));
        let tick_loop = TickLoop::new(Clock::Monotonic, simulation.period_s()).unwrap();
        let mut tick_loop = tick_loop.measured_in(Arc::clone(&timing.the_loop));
        let mut the_loop = Loop::new(simulation, desk, sign.clone(), Arc::clone(&timing), Clock::Monotonic);
        let (begin, begun) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            begun.recv().unwrap();
            assert_no_alloc(|| the_loop.run(&mut tick_loop));
        });
        Self { orders, sign, timing, thread: Some(thread), begin }
    }

    fn begin(&self) {
        self.begin.send(()).unwrap();
    }

    async fn give(&self, session: u64, request: Request) -> (Request, Done) {
        let given = tokio::time::timeout(common::PATIENCE, self.orders.give(session, request, true));
        given.await.expect("an answer in time").expect("no refusal")
    }

    fn stop(mut self) {
        self.sign.raise();
        self.thread.take().unwrap().join().unwrap();
        assert!(self.sign.is_released());
    }
}

fn copy_of(model: &Model) -> Request {
    Request::Copy(Box::new(Copy::of(model)))
}

/// Pause was refused in 14 of 86 tries while another client flooded the daemon with orders.
#[tokio::test(flavor = "multi_thread")]
async fn a_pause_goes_before_all_other_orders() {
    let (simulation, _ends, model) = session(1, block_scene("block", 2), &Arc::default());
    let running = Running::on(simulation);
    let mut waiting = tokio::task::JoinSet::new();
    for _ in 0..CAPACITY {
        let (orders, request) = (running.orders.clone(), copy_of(&model));
        waiting.spawn(async move { orders.give(1, request, true).await.unwrap().1 });
    }
    tokio::time::sleep(Duration::from_millis(50)).await;
    assert!(matches!(running.orders.give(1, copy_of(&model), true).await, Err(Refusal::Busy)), "no place is left");
    // As many as there are, and more than may wait at a time.
    let mut pauses = tokio::task::JoinSet::new();
    for _ in 0..CAPACITY {
        let orders = running.orders.clone();
        pauses.spawn(async move { orders.give(1, Request::Pause(true), false).await.unwrap().1 });
    }
    tokio::time::sleep(Duration::from_millis(50)).await;
    running.begin();
    let paused = pauses.join_all().await;
    assert!(paused.iter().all(|done| done.paused && done.tick == 0), "the first tick is never begun: {paused:?}");
    assert!(waiting.join_all().await.iter().all(|done| done.paused));
    running.stop();
}

/// Whoever pauses last has the last word, and many who pause delay nobody else.
#[tokio::test(flavor = "multi_thread")]
async fn pauses_keep_their_order_and_delay_no_other() {
    let (simulation, _ends, model) = session(1, block_scene("block", 2), &Arc::default());
    let running = Running::on(simulation);
    let mut given = Vec::new();
    for pauses in [true, false, false, true, false] {
        let orders = running.orders.clone();
        given.push(tokio::spawn(async move { orders.give(1, Request::Pause(pauses), false).await.unwrap().1.paused }));
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let (orders, request) = (running.orders.clone(), copy_of(&model));
    let copy = tokio::spawn(async move { orders.give(1, request, true).await.unwrap().1 });
    tokio::time::sleep(Duration::from_millis(50)).await;
    running.begin();
    let copy = copy.await.unwrap();
    assert!(!copy.paused && copy.tick == 0, "taken in the first tick, after all of them: {copy:?}");
    for (given, paused) in given.into_iter().zip([true, false, false, true, false]) {
        assert_eq!(given.await.unwrap(), paused);
    }
    running.stop();
}

/// Sixty-four viewers that ask for the status at once cost one tick sixty-four copies of the state.
#[tokio::test(flavor = "multi_thread")]
async fn a_tick_takes_one_order_however_many_wait() {
    let (simulation, _ends, model) = session(1, block_scene("block", 2), &Arc::default());
    let running = Running::on(simulation);
    let mut waiting = tokio::task::JoinSet::new();
    for _ in 0..20 {
        let (orders, request) = (running.orders.clone(), copy_of(&model));
        waiting.spawn(async move { orders.give(1, request, true).await.unwrap().1.tick });
    }
    tokio::time::sleep(Duration::from_millis(50)).await;
    running.begin();
    let mut ticks = waiting.join_all().await;
    ticks.sort_unstable();
    assert_eq!(ticks[0], 0, "all were waiting: {ticks:?}");
    assert!(ticks.windows(2).all(|pair| pair[0] < pair[1]), "two in a tick: {ticks:?}");
    running.stop();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_loop_touches_no_heap_whatever_it_is_asked() {
    let demand = Arc::new(Demand::default());
    let (simulation, mut ends, model) = session(1, block_scene("block", 3), &demand);
    let running = Running::on(simulation);
    running.begin();
    demand.set(2, true);
    tokio::time::sleep(Duration::from_millis(300)).await; // the simulated arm, in and out of contact

    ends.tools[0].shared.attach(7, 3.0);
    for sequence in 1..200 {
        ends.tools[0].samples.write(Some(DeviceInput {
            attachment: 7,
            sequence,
            device_time_ns: sequence,
            arrived_ns: Clock::Monotonic.now_ns(),
            position_m: if sequence < 50 { above() } else { pressing() },
            velocity_m_per_s: DVec3::ZERO,
            orientation: glam::DQuat::IDENTITY,
            angular_velocity_rad_per_s: DVec3::ZERO,
            buttons: 0,
        }));
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    let inject = || {
        let force = |i: u32| Injection {
            node: 20 + i % 8,
            force_n: DVec3::X * 1e-3,
            from_tick: 0,
            tick_count: 5 + i,
            is_bounded: false,
        };
        Request::Inject((0..64).map(force).collect())
    };
    running.give(1, inject()).await;
    let (Request::Copy(copy), done) = running.give(1, copy_of(&model)).await else { panic!("another order") };
    assert_eq!(copy.state.mechanical.tick, done.tick);
    running.give(1, Request::Restore(Box::new(copy.state))).await; // waits until the device is released
    running.give(1, Request::Pause(true)).await;
    running.give(1, inject()).await;
    let stepped = running.give(1, Request::Step(200)).await.1;
    let (Request::Copy(copy), done) = running.give(1, copy_of(&model)).await else { panic!("another order") };
    assert_eq!((copy.state.mechanical.tick, done.paused), (stepped.tick, true), "time stands");
    running.give(1, Request::Reset).await;
    let (Request::Copy(copy), _) = running.give(1, copy_of(&model)).await else { panic!("another order") };
    assert_eq!(snapshot::state_hash(&copy.state), snapshot::state_hash(&State::at_rest(&model)));
    running.give(1, Request::Pause(false)).await;
    ends.tools[0].shared.detach();

    // Another session, with another period; it comes back with the old one.
    let mut slower = block_scene("slower", 2);
    slower.model.settings.tick_period_s = 2e-3;
    let (simulation, _ends, _) = session(2, slower, &demand);
    let (Request::Load(old), _) = running.give(1, Request::Load(simulation)).await else { panic!("another order") };
    assert_eq!(old.session, 1);
    let before = running.give(2, Request::Pause(false)).await.1;
    let ticks_before = running.timing.the_loop.ticks();
    tokio::time::sleep(Duration::from_millis(100)).await;
    let after = running.give(2, Request::Pause(false)).await.1;
    assert!(after.tick > before.tick, "it runs");
    assert!(running.timing.the_loop.ticks() > ticks_before, "measured in the same place");
    let turns_s = after.time_s - before.time_s;
    assert!((turns_s - (after.tick - before.tick) as f64 * 2e-3).abs() < 1e-9);
    running.stop();
}

/// A step order is worked on until shortly before the next deadline: the loop is on time for whoever comes next, and sleeps.
#[tokio::test(flavor = "multi_thread")]
async fn a_long_step_is_spread_over_turns() {
    let (simulation, _ends, _) = session(1, block_scene("block", 2), &Arc::default());
    let running = Running::on(simulation);
    running.begin();
    running.give(1, Request::Pause(true)).await;
    let done = running.give(1, Request::Step(2000)).await.1;
    assert!(done.tick >= 2000);
    let turns = running.timing.the_loop.ticks();
    assert!(turns > 10, "in many turns of one period each, not in one: {turns}");
    running.stop();
}
