//! The loop: a thread of its own that wakes at absolute deadlines, takes orders, and ticks.
use super::{
    command::{Command, Copy, Desk, Done, Refusal, Request},
    simulation::{Simulation, copy_state},
    tick::Plan,
    timing::Timing,
    tool::Order,
};
use palpate_realtime::{Clock, Deadlines, PeriodError};
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

/// How the loop is told to end, and tells that it has.
#[derive(Debug, Clone, Default)]
pub struct StopSign {
    stop: Arc<AtomicBool>,
    released: Arc<AtomicBool>,
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

    /// Whether every force has reached zero.
    pub fn is_released(&self) -> bool {
        self.released.load(Ordering::Acquire)
    }
}

/// Time after which the loop ends whatever the forces: several ramps.
const LONGEST_RELEASE_NS: u64 = 500_000_000;

/// The loop.
#[derive(Debug)]
pub struct Loop {
    simulation: Box<Simulation>,
    desk: Desk,
    sign: StopSign,
    timing: Arc<Timing>,
    clock: Clock,
    deadlines: Deadlines,
    paused: bool,
    stepping: Option<(Command, u32)>,
    /// An order that puts the body elsewhere, until devices are released, and since when (ns).
    waiting: Option<(Command, u64)>,
}

impl Loop {
    /// A loop that has not begun.
    ///
    /// # Errors
    /// [`PeriodError`] when the session's tick period cannot be kept by any loop.
    pub fn new(
        simulation: Box<Simulation>,
        desk: Desk,
        sign: StopSign,
        timing: Arc<Timing>,
        clock: Clock,
    ) -> Result<Self, PeriodError> {
        let deadlines = Deadlines::new(clock.clone(), simulation.period_s())?;
        Ok(Self { simulation, desk, sign, timing, clock, deadlines, paused: false, stepping: None, waiting: None })
    }

    /// Runs until the sign is raised and forces are zero.
    pub fn run(mut self) {
        let mut told_to_stop_ns = None;
        loop {
            let wakeup = self.deadlines.wait();
            if !self.paused {
                self.timing.wakeup.record(wakeup.lateness_ns());
                self.timing.count_overruns(u64::from(wakeup.overrun) + wakeup.skipped);
            }
            self.take_orders();
            if self.sign.is_raised() {
                let since_ns = *told_to_stop_ns.get_or_insert_with(|| self.clock.now_ns());
                if self.release(since_ns) {
                    return;
                }
            } else if self.waiting.is_some() {
                self.tick(Plan { advance: !self.paused, order: Order::Hold });
            } else if self.stepping.is_some() {
                self.work_on_steps();
            } else {
                let (advance, order) = (!self.paused, if self.paused { Order::Hold } else { Order::Render });
                self.tick(Plan { advance, order });
            }
        }
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

    /// Ticks as fast as they go for at most one period, so that orders are heard.
    fn work_on_steps(&mut self) {
        let until_ns = self.clock.now_ns() + self.deadlines.period_ns();
        while let Some((command, left)) = self.stepping.take() {
            if left == 0 {
                let done = self.done();
                self.desk.finish(command, Ok(done));
                return;
            }
            self.stepping = Some((command, left - 1));
            self.tick(Plan { advance: true, order: Order::Hold });
            if self.clock.now_ns() > until_ns {
                return;
            }
        }
    }

    /// Orders are taken one after the other: what follows one that waits, waits as well.
    fn take_orders(&mut self) {
        while self.obey_waiting() {
            let Some(mut command) = self.desk.next_order() else { return };
            if command.session != self.simulation.session {
                self.desk.finish(command, Err(Refusal::OtherSession));
                continue;
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
                    self.waiting = Some((command, self.clock.now_ns()));
                }
                Request::Pause(_) | Request::Copy(_) | Request::Inject(_) => {
                    let outcome = self.obey(&mut command.request);
                    self.desk.finish(command, outcome);
                }
            }
        }
    }

    /// Obeys the order that waits, if devices are released; true when none waits any more.
    fn obey_waiting(&mut self) -> bool {
        let Some((mut command, since_ns)) = self.waiting.take() else { return true };
        if !self.simulation.are_devices_released() && self.clock.now_ns() - since_ns <= LONGEST_RELEASE_NS {
            self.waiting = Some((command, since_ns));
            return false;
        }
        let outcome = self.obey(&mut command.request);
        self.desk.finish(command, outcome);
        true
    }

    fn obey(&mut self, request: &mut Request) -> Result<Done, Refusal> {
        let mut first_tick = 0;
        match request {
            Request::Load(simulation) => {
                self.interrupt_steps();
                std::mem::swap(simulation, &mut self.simulation);
                self.paused = false;
                // The period was checked when the session was built.
                if let Ok(deadlines) = Deadlines::new(self.clock.clone(), self.simulation.period_s()) {
                    self.deadlines = deadlines;
                }
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
                let next_tick = self.simulation.state.tick + 1;
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
        if !copy_state(&self.simulation.state, &mut copy.state) {
            return Err(Refusal::OtherBody);
        }
        copy.scratch.copy_reactions_from(&self.simulation.scratch);
        Ok(())
    }

    fn done(&self) -> Done {
        let state = &self.simulation.state;
        Done {
            tick: state.tick,
            time_s: state.time_s(&self.simulation.model),
            paused: self.paused,
            first_tick: 0,
            pending: self.simulation.injections.pending(),
        }
    }
}
