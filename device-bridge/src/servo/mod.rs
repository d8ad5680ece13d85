//! The loop beside the arm: from the newest command and the arm's motion to a safe force.
mod law;
mod waits;

use crate::{
    convert::{Command, Sample},
    device::{Arm, Effort, Reading},
    guard::Guard,
    run::Shared,
    vrpn_server::moment::MomentWriter,
};
use glam::DVec3;
pub use law::{ServoLaw, ServoTick};
use palpate_control::{EnergyMeter, Fault, Link, Motion, PhaseLock};
use palpate_realtime::{Doorbell, SlotReader, SlotWriter, TickLoop, Wakeup};
use std::{
    ops::ControlFlow,
    sync::{Arc, atomic::Ordering},
};
pub use waits::Waits;

/// The servo's ends of everything.
#[derive(Debug)]
pub struct Servo {
    /// The law.
    pub law: ServoLaw,
    /// The arm.
    pub device: Box<dyn Arm>,
    /// Where it was last.
    pub last: Option<Reading>,
    /// Commands from the uplink.
    pub down: SlotReader<Option<Command>>,
    /// Samples for the uplink.
    pub up: SlotWriter<Option<Sample>>,
    /// Tells the uplink of a sample.
    pub bell: Doorbell,
    /// For programs that watch by VRPN.
    pub told: Option<MomentWriter>,
    /// Flags and counters.
    pub shared: Arc<Shared>,
    /// Sequence number of the last sample.
    pub sequence: u64,
    /// What the hand gave and got.
    pub energy: EnergyMeter,
    /// Who takes the force away should this process be killed.
    pub guard: Option<Guard>,
    /// When to run beside the daemon's loop; `None`: whenever it was started.
    pub phase: Option<PhaseLock>,
}

impl Servo {
    /// Runs on this thread until told to stop and the force is at zero. Dropped afterwards, by a panic too, it leaves the arm
    /// without force.
    pub fn run(&mut self, tick_loop: &mut TickLoop) {
        let clock = tick_loop.clock().clone();
        tick_loop.run_shifted(|wakeup| self.tick(wakeup, clock.now_ns()));
    }

    fn tick(&mut self, wakeup: &Wakeup, now_ns: u64) -> ControlFlow<(), i64> {
        self.obey_guard();
        let mut read = self.device.read(1 + wakeup.skipped);
        if self.obey_guard() && !self.has_failed() {
            // What was read may be what the arm said to the guard.
            read = self.last.map_or(read, Ok);
        }
        if let Err(fault) = read {
            self.shared.stats.set_device_fault(fault);
            self.law.trip(now_ns, Fault::Device);
        }
        self.last = read.ok().or(self.last);
        self.law.passed(1 + wakeup.skipped);
        self.law.share_force(self.share());
        self.law.pose_is(self.last.map_or(0.0, |reading| reading.age_s));
        let motion = self.last.map_or(Motion::at(DVec3::ZERO), |reading| reading.motion);
        if let Some(Some(command)) = self.down.take() {
            self.law.receive(command);
        }
        self.obey_flags(now_ns);
        let mut tick = self.law.tick(now_ns, &motion);
        // Before the force, which is guarded then.
        if let Some(guard) = &mut self.guard {
            let heard = guard.beat();
            self.shared.unguarded.store(!heard, Ordering::Relaxed);
        }
        if self.obey_guard() {
            (tick.limited.force_n, tick.torque_nm, tick.plane) = (DVec3::ZERO, DVec3::ZERO, None);
        }
        self.device.apply(&Effort { force_n: tick.limited.force_n, torque_nm: tick.torque_nm, plane: tick.plane });
        self.energy.step(motion.position_m, tick.limited.force_n);
        if let Ok(reading) = read
            && reading.motion.is_finite()
        {
            self.tell(now_ns, &reading, &tick);
        }
        self.count(&tick, motion.is_finite());
        match tick.verdict.link {
            Link::Latched(Fault::Requested) => ControlFlow::Break(()),
            // Whatever took the force away: a lost arm has to be opened anew.
            Link::Latched(_) if read.is_err() || self.shared.stop.load(Ordering::Relaxed) => ControlFlow::Break(()),
            _ => ControlFlow::Continue(self.later_ns()),
        }
    }

    /// By how much (ns) the ticks to come are to be later, so that poses reach the daemon right before it uses them.
    fn later_ns(&mut self) -> i64 {
        let heard = self.shared.waits.take();
        self.phase.as_mut().zip(heard).map_or(0, |(phase, wait)| phase.heard(&wait))
    }

    /// The guard may have spoken at any moment that this thread stood still in: the force is gone. Whether it has since this was asked last.
    fn obey_guard(&mut self) -> bool {
        let spoken = self.guard.as_mut().is_some_and(Guard::has_spoken);
        if spoken {
            // An arm that was lost before stays so.
            if !self.has_failed() {
                self.device.last_words_were_said();
            }
            self.law.latch(Fault::Stalled);
        }
        spoken
    }

    fn has_failed(&self) -> bool {
        self.shared.stats.device_fault().is_some()
    }

    /// What the clutch leaves of the force, or nothing, when none is wanted or none may be given yet.
    fn share(&self) -> f64 {
        let none =
            [&self.shared.without_force, &self.shared.unmeasured].iter().any(|flag| flag.load(Ordering::Relaxed));
        if none { 0.0 } else { self.last.map_or(1.0, |reading| reading.force_share) }
    }

    /// The uplink, and those that watch.
    fn tell(&mut self, now_ns: u64, reading: &Reading, tick: &ServoTick) {
        if self.shared.attached.load(Ordering::Relaxed) {
            self.sequence += 1;
            self.up.publish(Some(Sample {
                sequence: self.sequence,
                device_time_ns: now_ns,
                reading: *reading,
                link: tick.verdict.link,
            }));
            self.bell.ring();
        }
        if let Some(told) = &mut self.told {
            let contact = self.law.contact().filter(|_| tick.verdict.ramp > 0.0);
            told.tell(now_ns, reading, tick.limited.force_n, contact);
        }
    }

    fn obey_flags(&mut self, now_ns: u64) {
        if self.shared.stop.load(Ordering::Relaxed) {
            self.law.trip(now_ns, Fault::Requested);
        } else if self.shared.peer_fault.swap(false, Ordering::Relaxed) {
            self.law.trip(now_ns, Fault::Peer);
        } else if self.shared.lost.swap(false, Ordering::Relaxed) && self.shared.stats.link() != Link::Waiting {
            self.law.trip(now_ns, Fault::Stale);
        } else if self.shared.recover.swap(false, Ordering::Relaxed) {
            self.law.recover();
        }
    }

    fn count(&self, tick: &ServoTick, motion_finite: bool) {
        let stats = &self.shared.stats;
        let count_if = |counter: &crate::stats::Counter, happened: bool| {
            if happened {
                counter.increment();
            }
        };
        count_if(&stats.saturated, tick.limited.saturated);
        count_if(&stats.rate_limited, tick.limited.rate_limited);
        count_if(&stats.non_finite, tick.limited.non_finite || !motion_finite);
        let is_held_back = tick.added_damping_n_s_per_m > 0.0 || tick.is_capped;
        count_if(&stats.damped, tick.verdict.ramp > 0.0 && is_held_back);
        stats.latched.set(self.law.latched());
        stats.dropped_up.set(self.up.overwritten());
        stats.dropped_down.set(self.down.overwritten());
        stats.set_force(tick.limited.force_n.length());
        stats.set_least_energy(self.energy.least_j());
        stats.set_gain(self.law.largest_stiffness_n_per_m());
        stats.set_success_rate(self.law.success_rate());
        count_if(&stats.judged, stats.received.get() > 0);
        count_if(&stats.in_time, self.law.is_in_time(&tick.verdict));
        if let Some(reading) = self.last {
            stats.pose_age.record((reading.age_s * 1e9) as u64);
        }
        stats.set_link(tick.verdict.link);
    }
}

impl Drop for Servo {
    fn drop(&mut self) {
        self.device.apply(&Effort::NONE);
        self.shared.stats.set_force(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Config, device::Witness, settings::Settings};
    use palpate_control::Wait;
    use palpate_realtime::{Clock, slot};
    use std::io::Write as _;

    /// A servo in full force on an arm that a test looks at, and panics at its `reads`-th reading.
    fn pressed(reads: u64) -> (Servo, Arc<Witness>, SlotWriter<Option<Command>>) {
        let mut config = Config::default();
        config.watchdog.ramp_up_s = 0.0;
        // The arm is at rest: nobody worked for its force.
        config.passivity.strict = false;
        let settings = Settings::new(&config).unwrap();
        let (mut commands, down) = slot(&None);
        let (up, _samples) = slot(&None);
        let witness = Arc::new(Witness::panicking_at(reads));
        commands.publish(Some(Command {
            answers_ns: Clock::Monotonic.now_ns() + 60_000_000_000,
            tick: 1,
            force_n: DVec3::Z,
            local_model: None,
            local_torque: None,
            model_age_s: 0.0,
            limits: settings.servo.limits,
            torque: (DVec3::ZERO, settings.servo.torque),
        }));
        let servo = Servo {
            law: ServoLaw::new(settings.servo),
            device: Box::new(Arc::clone(&witness)),
            last: None,
            down,
            up,
            bell: Doorbell::new().unwrap(),
            told: None,
            shared: Arc::default(),
            sequence: 0,
            energy: EnergyMeter::default(),
            guard: None,
            phase: None,
        };
        (servo, witness, commands)
    }

    /// Once for each pose that it hears of; and not at all where it was told to stay.
    #[tokio::test]
    async fn ticks_are_later_where_poses_wait_and_earlier_where_they_miss() {
        let (mut servo, _witness, _commands) = pressed(u64::MAX);
        let wakeup = Wakeup { tick: 0, deadline_ns: 0, woke_ns: 0, skipped: 0, overrun: false };
        let after = |servo: &mut Servo, waited_ns| {
            servo.shared.waits.tell(&Wait { waited_ns, answered_after_ns: 300_000, tick_period_ns: 1_000_000 });
            servo.tick(&wakeup, Clock::Monotonic.now_ns()).continue_value()
        };
        assert_eq!(after(&mut servo, 400_000), Some(0), "it follows nothing");
        servo.phase = Some(PhaseLock::new(1_000_000));
        assert_eq!(after(&mut servo, 400_000), Some(2_000));
        assert_eq!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).continue_value(), Some(0));
        assert_eq!(after(&mut servo, 900_000), Some(-2_000));
    }

    #[tokio::test]
    async fn an_arm_has_no_force_once_its_servo_is_dropped() {
        let (mut servo, witness, _commands) = pressed(u64::MAX);
        let wakeup = Wakeup { tick: 0, deadline_ns: 0, woke_ns: 0, skipped: 0, overrun: false };
        for _ in 0..3 {
            assert!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).is_continue());
        }
        assert!(witness.force_n() > 0.5, "{} N", witness.force_n());
        let shared = Arc::clone(&servo.shared);
        drop(servo);
        assert_eq!((witness.force_n(), shared.stats.force_n()), (0.0, 0.0));
    }

    /// An arm that failed while another fault was latched left its bridge waiting for ever.
    #[tokio::test]
    async fn a_lost_arm_ends_the_loop_also_in_another_fault() {
        let (mut servo, witness, _commands) = pressed(u64::MAX);
        let wakeup = Wakeup { tick: 0, deadline_ns: 0, woke_ns: 0, skipped: 0, overrun: false };
        let mut now_ns = Clock::Monotonic.now_ns();
        let mut tick = |servo: &mut Servo| {
            now_ns += 1_000_000;
            servo.tick(&wakeup, now_ns)
        };
        assert!(tick(&mut servo).is_continue());
        servo.shared.peer_fault.store(true, Ordering::Relaxed);
        assert!((0..30).all(|_| tick(&mut servo).is_continue()));
        assert_eq!(servo.shared.stats.link(), Link::Latched(Fault::Peer));
        witness.fail();
        assert!(tick(&mut servo).is_break());
        assert_eq!(servo.shared.stats.device_fault(), Some(crate::device::Fault::Silent));
        let (mut servo, witness, _commands) = pressed(u64::MAX);
        assert!((0..5).all(|_| tick(&mut servo).is_continue()));
        witness.fail();
        // The ramp to zero comes first.
        assert!(witness.force_n() > 0.5 && tick(&mut servo).is_continue());
        let ticks = (0..30).take_while(|_| tick(&mut servo).is_continue()).count();
        assert!((10..=20).contains(&ticks) && witness.force_n() == 0.0, "{ticks} ticks, {} N", witness.force_n());
    }

    /// A force that the law still thinks of, behind the guard's words, would be a blow.
    #[tokio::test]
    async fn after_the_guard_spoke_there_is_no_force_at_once() {
        let (mut servo, witness, _commands) = pressed(u64::MAX);
        let (guard, mut theirs) = Guard::spoken_for();
        servo.guard = Some(guard);
        let wakeup = Wakeup { tick: 0, deadline_ns: 0, woke_ns: 0, skipped: 0, overrun: false };
        for _ in 0..3 {
            assert!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).is_continue());
        }
        assert!(witness.force_n() > 0.5, "{} N", witness.force_n());
        theirs.write_all(b"!").unwrap();
        for _ in 0..3 {
            assert!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).is_continue());
            assert_eq!((witness.force_n(), servo.shared.stats.link()), (0.0, Link::Latched(Fault::Stalled)));
        }
        assert_eq!(witness.times_let_go(), 1);
    }

    /// It would have been asked anew, and its bridge never ended.
    #[tokio::test]
    async fn an_arm_that_was_lost_stays_lost_when_the_guard_speaks() {
        let (mut servo, witness, _commands) = pressed(u64::MAX);
        let (guard, mut theirs) = Guard::spoken_for();
        servo.guard = Some(guard);
        let wakeup = Wakeup { tick: 0, deadline_ns: 0, woke_ns: 0, skipped: 0, overrun: false };
        assert!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).is_continue());
        witness.fail();
        assert!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).is_continue(), "the ramp comes first");
        theirs.write_all(b"!").unwrap();
        assert!(servo.tick(&wakeup, Clock::Monotonic.now_ns()).is_break());
        assert_eq!((witness.force_n(), servo.shared.stats.link()), (0.0, Link::Latched(Fault::Device)));
        assert_eq!(witness.times_let_go(), 0);
    }

    #[tokio::test]
    async fn a_panic_in_the_servo_leaves_no_force_on_the_arm() {
        let (mut servo, witness, _commands) = pressed(20);
        let thread = std::thread::spawn(move || {
            let mut tick_loop = TickLoop::new(Clock::Monotonic, 1e-3).unwrap();
            servo.run(&mut tick_loop);
        });
        assert!(thread.join().is_err(), "the driver panicked");
        assert!(witness.peak_n() > 0.5, "there was a force before: {} N", witness.peak_n());
        assert_eq!(witness.force_n(), 0.0);
    }
}
