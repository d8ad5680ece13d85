//! The loop: a thread of its own that wakes at absolute deadlines, takes orders, and ticks.
use super::{
    command::{Command, Copy, Desk, Done, PAUSES, Refusal, Request},
    simulation::Simulation,
    tick::Plan,
    timing::Timing,
    tool::Order,
};
use palpate_realtime::{Clock, TickLoop, Wakeup};
use std::{
    ops::ControlFlow,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};
use tokio_util::sync::{CancellationToken, DropGuard};

/// How the loop is told to end, and tells that it has.
#[derive(Debug, Clone, Default)]
pub struct StopSign {
    stop: Arc<AtomicBool>,
    released: Arc<AtomicBool>,
    gone: CancellationToken,
}

impl StopSign {
    /// Forces ramp to zero, then the loop ends.
    pub fn raise(&self) {
        self.stop.store(true, Ordering::Release);
    }

    /// Whether the loop was told to end.
    pub fn is_raised(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }

    /// Cancelled when the loop runs no more, whatever ended it.
    pub fn gone(&self) -> CancellationToken {
        self.gone.clone()
    }

    /// Held by the loop's thread: tells that the loop is gone when it is dropped, by a panic too.
    pub fn hold(&self) -> DropGuard {
        self.gone.clone().drop_guard()
    }

    /// Whether every force has reached zero.
    pub fn is_released(&self) -> bool {
        self.released.load(Ordering::Acquire)
    }
}

/// Time after which the loop ends whatever the forces: several ramps.
const LONGEST_RELEASE_NS: u64 = 500_000_000;

/// The loop. Takes one order a tick at most: however many wait, a tick costs no more than one copy of a state.
#[derive(Debug)]
pub struct Loop {
    simulation: Box<Simulation>,
    desk: Desk,
    sign: StopSign,
    timing: Arc<Timing>,
    clock: Clock,
    paused: bool,
    stepping: Option<(Command, u32)>,
    /// An order that puts the body elsewhere, until devices are released, and since when (ns).
    waiting: Option<(Command, u64)>,
    /// Another session has come, with a period of its own.
    other_period: bool,
    told_to_stop_ns: Option<u64>,
}

impl Loop {
    /// A loop that has not begun; `clock` is that of the [`TickLoop`] it will run on.
    pub fn new(simulation: Box<Simulation>, desk: Desk, sign: StopSign, timing: Arc<Timing>, clock: Clock) -> Self {
        Self {
            simulation,
            desk,
            sign,
            timing,
            clock,
            paused: false,
            stepping: None,
            waiting: None,
            other_period: false,
            told_to_stop_ns: None,
        }
    }

    /// Begins with time standing.
    pub fn pause(&mut self) {
        self.paused = true;
    }

    /// Runs until the sign is raised and forces are zero.
    pub fn run(&mut self, tick_loop: &mut TickLoop) {
        loop {
            tick_loop.run(|wakeup| self.turn(wakeup));
            if !std::mem::take(&mut self.other_period) {
                return;
            }
            // The period was checked when the session was built.
            let _ = tick_loop.set_period(self.simulation.period_s());
        }
    }

    /// What is done at one wake-up; breaks when the loop is to end, or to go on with another period.
    pub fn turn(&mut self, wakeup: &Wakeup) -> ControlFlow<()> {
        self.take_an_order();
        if self.sign.is_raised() {
            let since_ns = *self.told_to_stop_ns.get_or_insert(wakeup.woke_ns);
            if self.release(since_ns) {
                self.other_period = false;
                return ControlFlow::Break(());
            }
        } else if self.waiting.is_some() {
            self.tick(Plan { advance: !self.paused, order: Order::Hold });
        } else if self.stepping.is_some() {
            self.work_on_steps(wakeup);
        } else {
            let (advance, order) = (!self.paused, if self.paused { Order::Hold } else { Order::Render });
            self.tick(Plan { advance, order });
        }
        if self.other_period { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    fn tick(&mut self, plan: Plan) {
        self.simulation.tick(plan, &self.clock, &self.timing);
    }

    /// Ticks with forces going to zero; true when the loop may end.
    fn release(&mut self, since_ns: u64) -> bool {
        if let Some((command, _)) = self.stepping.take() {
            self.desk.finish(command, Err(Refusal::Stopping));
        }
        if let Some((command, _)) = self.waiting.take() {
            self.desk.finish(command, Err(Refusal::Stopping));
        }
        self.tick(Plan { advance: !self.paused, order: Order::Release });
        let released = self.simulation.is_released() || self.clock.now_ns() - since_ns > LONGEST_RELEASE_NS;
        if released {
            self.sign.released.store(true, Ordering::Release);
            // Once more: arms hear of the zero, and that it is the last.
            self.tick(Plan { advance: false, order: Order::Release });
        }
        released
    }

    /// Ticks as fast as they go, as many as end before the next deadline, and one at least.
    fn work_on_steps(&mut self, wakeup: &Wakeup) {
        let period_ns = (self.simulation.period_s() * 1e9) as u64;
        let next_ns = wakeup.deadline_ns + period_ns;
        let mut begun_ns = wakeup.woke_ns;
        while let Some((command, left)) = self.stepping.take() {
            if left == 0 {
                let done = self.done();
                self.desk.finish(command, Ok(done));
                return;
            }
            self.stepping = Some((command, left - 1));
            self.tick(Plan { advance: true, order: Order::Hold });
            let now_ns = self.clock.now_ns();
            // The next one costs what this one did.
            if now_ns + (now_ns - begun_ns) > next_ns {
                return;
            }
            begun_ns = now_ns;
        }
    }

    /// Orders are taken one after the other, one a tick: what follows one that waits, waits as well. Orders to pause or go on do not.
    fn take_an_order(&mut self) {
        // They cost nothing, so all that are there are taken: many of them delay no other order.
        for _ in 0..PAUSES {
            let Some(mut command) = self.desk.next_pause() else { break };
            let is_of_this = command.session == self.simulation.session;
            let outcome = if is_of_this { self.obey(&mut command.request) } else { Err(Refusal::OtherSession) };
            self.desk.finish(command, outcome);
        }
        if let Some((command, since_ns)) = self.waiting.take() {
            self.obey_waiting(command, since_ns);
            return;
        }
        let Some(mut command) = self.desk.next_order() else { return };
        if command.session != self.simulation.session {
            self.desk.finish(command, Err(Refusal::OtherSession));
            return;
        }
        match &command.request {
            Request::Step(ticks) => {
                let ticks = *ticks;
                match (self.paused, &self.stepping) {
                    (false, _) => self.desk.finish(command, Err(Refusal::NotPaused)),
                    (true, Some(_)) => self.desk.finish(command, Err(Refusal::Stepping)),
                    (true, None) => self.stepping = Some((command, ticks)),
                }
            }
            Request::Load(_) | Request::Reset | Request::Restore(_) => {
                let now_ns = self.clock.now_ns();
                self.obey_waiting(command, now_ns);
            }
            Request::Pause(_) | Request::Copy(_) | Request::Inject(_) => {
                let outcome = self.obey(&mut command.request);
                self.desk.finish(command, outcome);
            }
        }
    }

    /// Obeys an order that puts the body elsewhere, if devices are released; else it waits.
    fn obey_waiting(&mut self, mut command: Command, since_ns: u64) {
        if !self.simulation.are_devices_released() && self.clock.now_ns() - since_ns <= LONGEST_RELEASE_NS {
            self.waiting = Some((command, since_ns));
            return;
        }
        let outcome = self.obey(&mut command.request);
        self.desk.finish(command, outcome);
    }

    fn obey(&mut self, request: &mut Request) -> Result<Done, Refusal> {
        let mut first_tick = 0;
        match request {
            Request::Load(simulation) => {
                self.interrupt_steps();
                std::mem::swap(simulation, &mut self.simulation);
                self.paused = false;
                self.other_period = true;
            }
            Request::Reset => {
                self.interrupt_steps();
                self.simulation.reset();
            }
            Request::Pause(paused) => {
                if !*paused {
                    self.interrupt_steps();
                }
                self.paused = *paused;
            }
            Request::Step(_) => {}
            Request::Copy(copy) => self.copy_to(copy)?,
            Request::Restore(state) => {
                if !self.simulation.restore(state) {
                    return Err(Refusal::OtherBody);
                }
                self.interrupt_steps();
            }
            Request::Inject(forces) => {
                let next_tick = self.simulation.state.mechanical.tick + 1;
                first_tick = self.simulation.inject(forces, next_tick).map_err(Refusal::Inject)?;
            }
        }
        Ok(Done { first_tick, ..self.done() })
    }

    fn interrupt_steps(&mut self) {
        if let Some((command, _)) = self.stepping.take() {
            self.desk.finish(command, Err(Refusal::Interrupted));
        }
    }

    fn copy_to(&self, copy: &mut Copy) -> Result<(), Refusal> {
        if !copy.state.try_copy_from(&self.simulation.state) {
            return Err(Refusal::OtherBody);
        }
        for (copied, reaction_n) in copy.reactions_n.iter_mut().zip(self.simulation.scratch.reactions_n()) {
            *copied = *reaction_n;
        }
        // It has room for all that may act.
        copy.injected.clear();
        copy.injected.extend_from_slice(self.simulation.injections.acting());
        Ok(())
    }

    fn done(&self) -> Done {
        let state = &self.simulation.state;
        Done {
            tick: state.mechanical.tick,
            time_s: state.time_s(&self.simulation.model),
            paused: self.paused,
            first_tick: 0,
            pending: self.simulation.injections.pending(),
        }
    }
}
