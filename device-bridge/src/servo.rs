//! The loop beside the arm: from the newest command and the arm's motion to a safe force.
use crate::{
    convert::{Command, Sample},
    device::{Arm, Effort, Reading},
    guard::Guard,
    run::Shared,
    settings::ServoSettings,
    vrpn_server::moment::MomentWriter,
};
use glam::DVec3;
use palpate_control::{
    ContactPlane, EnergyMeter, Fault, ForceLimiter, ForceLimits, Limited, Link, LocalModel, Motion,
    PassivityController, RenderSettings, StiffnessBound, SuccessRate, ThermalLimiter, TorqueLaw, Verdict, Watchdog,
};
use palpate_realtime::{Doorbell, SlotReader, SlotWriter, TickLoop, Wakeup};
use std::{
    ops::ControlFlow,
    sync::{Arc, atomic::Ordering},
};

/// With automatic recovery, poses must have been answered in time, without a gap, for so long (ns) since the fault was latched.
const SETTLED_NS: u64 = 500_000_000;

/// The law, free of threads and clocks.
#[derive(Debug)]
pub struct ServoLaw {
    settings: ServoSettings,
    watchdog: Watchdog,
    passivity: Option<PassivityController>,
    limiter: ForceLimiter,
    thermal: Option<ThermalLimiter>,
    stiffness: StiffnessBound,
    success: SuccessRate,
    torque: TorqueLaw,
    command: Option<Command>,
    /// The plane that the arm was given, and where it was (m).
    given: Option<(ContactPlane, DVec3)>,
    force_share: f64,
    /// Since the last tick (s).
    passed_s: f64,
    steady_since_ns: Option<u64>,
    faults_seen: u64,
}

/// What one tick did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoTick {
    /// Force for the arm (N).
    pub limited: Limited,
    /// Torque for the arm (N m).
    pub torque_nm: DVec3,
    /// The part of the force that the arm renders by itself, if it does.
    pub plane: Option<ContactPlane>,
    /// State of the link.
    pub verdict: Verdict,
    /// Damping that the passivity controller added (N s/m).
    pub added_damping_n_s_per_m: f64,
    /// It shortened the force besides.
    pub is_capped: bool,
}

impl ServoLaw {
    /// Waiting for a first command.
    pub fn new(settings: ServoSettings) -> Self {
        Self {
            watchdog: Watchdog::new(settings.watchdog),
            passivity: settings.passivity.map(PassivityController::new),
            limiter: ForceLimiter::new(settings.limits),
            thermal: settings.thermal.map(ThermalLimiter::new),
            stiffness: settings.stiffness,
            success: SuccessRate::default(),
            torque: TorqueLaw::new(settings.torque, settings.passivity),
            command: None,
            given: None,
            force_share: 1.0,
            passed_s: settings.period_s,
            steady_since_ns: None,
            faults_seen: 0,
            settings,
        }
    }

    /// A new command.
    pub fn receive(&mut self, command: &Command) {
        self.watchdog.sample_arrived(command.answers_ns);
        let (ours, theirs) = (self.settings.limits, command.limits);
        self.limiter.set_limits(ForceLimits {
            max_force_n: ours.max_force_n.min(theirs.max_force_n),
            max_force_rate_n_per_s: ours.max_force_rate_n_per_s.min(theirs.max_force_rate_n_per_s),
        });
        self.torque.limit_to(command.torque.1);
        self.command = Some(*command);
    }

    /// Ramps to zero from now on, and latches.
    pub fn trip(&mut self, now_ns: u64, fault: Fault) {
        self.watchdog.trip(now_ns, fault);
    }

    /// In this tick the arm has this share of the force at most, 0 to 1: less than 1 while a clutch lets go or takes hold, or none is given yet. It rises no faster than the watchdog's ramp.
    pub fn share_force(&mut self, share: f64) {
        let ramp_up_s = self.settings.watchdog.ramp_up_s;
        let rise = if ramp_up_s > 0.0 { self.settings.period_s / ramp_up_s } else { 1.0 };
        self.force_share = share.min(self.force_share + rise);
    }

    /// So many periods have passed since the last tick: more than one when ticks were left out.
    pub fn passed(&mut self, periods: u64) {
        self.passed_s = periods as f64 * self.settings.period_s;
    }

    /// The arm's newest pose is `age_s` old: the older, the softer a contact has to be rendered.
    pub fn pose_is(&mut self, age_s: f64) {
        self.stiffness.pose_is(age_s, self.settings.period_s);
    }

    /// How stiff (N/m) a contact is rendered at most.
    pub fn largest_stiffness_n_per_m(&self) -> f64 {
        self.stiffness.largest_n_per_m()
    }

    /// Whether the newest answer is in time, whatever was latched before.
    fn is_in_time(&self, verdict: &Verdict) -> bool {
        verdict.link != Link::Waiting && verdict.age_s <= self.settings.watchdog.stale_after_s
    }

    /// Share of the last thousand ticks in which the newest answer was in time.
    pub fn success_rate(&self) -> Option<f64> {
        self.success.rate()
    }

    /// Leaves a latched fault; the force comes back slowly, with the next command.
    pub fn recover(&mut self) -> bool {
        self.watchdog.recover()
    }

    /// The contact of the newest command.
    pub fn contact(&self) -> Option<LocalModel> {
        self.command.and_then(|command| command.local_model)
    }

    /// Faults latched so far.
    pub fn latched(&self) -> u64 {
        self.watchdog.faults()
    }

    /// The force for the arm, which now moves so.
    pub fn tick(&mut self, now_ns: u64, motion: &Motion) -> ServoTick {
        if !motion.is_finite() {
            self.watchdog.trip(now_ns, Fault::NonFinite);
        }
        self.recover_when_steady(now_ns);
        let verdict = self.watchdog.check(now_ns);
        if self.watchdog.faults() > self.faults_seen {
            self.faults_seen = self.watchdog.faults();
            self.steady_since_ns = None;
        }
        self.judge(now_ns, &verdict);
        let (wanted_n, plane) = self.wanted(motion, &verdict);
        let ramp = verdict.ramp * self.force_share;
        let dt_s = self.settings.period_s;
        if let (Some((plane, from_m)), Some(passivity)) = (self.given, &mut self.passivity) {
            passivity.spared(plane.spared_j(from_m, motion.position_m));
        }
        let step = self
            .passivity
            .as_mut()
            .map(|passivity| passivity.step(wanted_n, motion.position_m, motion.velocity_m_per_s, dt_s));
        let mut limited = self.limiter.limit(step.map_or(wanted_n, |step| step.force_n), ramp, dt_s);
        let given_n = limited.force_n;
        if let Some(thermal) = &self.thermal {
            limited.force_n = thermal.limit(given_n);
            limited.saturated |= limited.force_n != given_n;
        }
        let mut is_capped = false;
        if let Some(passivity) = &mut self.passivity {
            // Last, and shorter only: energy that is not there must not be given for the sake of a rate.
            let capped_n = passivity.cap(limited.force_n, motion.velocity_m_per_s, dt_s);
            is_capped = capped_n != limited.force_n;
            limited.force_n = capped_n;
            if ramp == 0.0 {
                passivity.reset();
            }
        }
        if limited.force_n != given_n {
            self.limiter.was_shortened_to(limited.force_n, ramp);
        }
        if ramp == 0.0 {
            // What comes back begins at nothing.
            self.limiter.reset();
        }
        if let Some(thermal) = &mut self.thermal {
            // A tick that is left out holds the force longer.
            thermal.held(limited.force_n, self.passed_s);
        }
        let at = (motion.position_m, motion.velocity_m_per_s);
        let plane = plane
            .filter(|_| !limited.non_finite)
            .and_then(|plane| plane.limited(limited.force_n, at, ramp, self.largest_n()));
        self.given = plane.map(|plane| (plane, motion.position_m));
        let wanted_nm = self.command.map_or(DVec3::ZERO, |command| command.torque.0);
        ServoTick {
            limited,
            plane,
            torque_nm: self.torque.tick(wanted_nm, motion, ramp, dt_s),
            verdict,
            added_damping_n_s_per_m: step.map_or(0.0, |step| step.damping_n_s_per_m),
            is_capped,
        }
    }

    /// The local model's force, or the daemon's where there is none, and the part of it that an arm can render by itself. On the way down damping takes its place.
    fn wanted(&self, motion: &Motion, verdict: &Verdict) -> (DVec3, Option<ContactPlane>) {
        let Some(command) = &self.command else { return (DVec3::ZERO, None) };
        let (force_n, plane) = match (&command.local_model, &self.settings.render) {
            (Some(model), Some(render)) => self.rendered(model, motion, verdict.age_s + command.model_age_s, render),
            _ => (command.force_n, None),
        };
        let force_n = match verdict.link {
            // F ← F − (1 − ramp) B v
            Link::Ramping(_) => {
                let damping = self.settings.fading_damping_n_s_per_m * (1.0 - verdict.ramp);
                force_n - damping * motion.velocity_m_per_s
            }
            _ => force_n,
        };
        (force_n, plane)
    }

    /// Along the normal an arm that renders the plane is as stiff as a loop without delay may be: poses that are late are none in its own loop.
    fn rendered(
        &self,
        model: &LocalModel,
        motion: &Motion,
        age_s: f64,
        render: &RenderSettings,
    ) -> (DVec3, Option<ContactPlane>) {
        let (p, v) = (motion.position_m, motion.velocity_m_per_s);
        let within = |max_stiffness_n_per_m| RenderSettings { max_stiffness_n_per_m, ..*render };
        let soft = model.render(p, v, age_s, &within(self.stiffness.largest_n_per_m()));
        let stiff = within(self.stiffness.without_delay_n_per_m());
        let plane = self.settings.plane.then(|| ContactPlane::of(model, p, age_s, &stiff)).flatten();
        let Some(plane) = plane else { return (soft.force_n, None) };
        let n = plane.normal;
        // F = F_soft − (F_soft·n) n + F_plane n
        let force_n = soft.force_n + (plane.normal_force_n(p, v) - soft.force_n.dot(n)) * n;
        (force_n.clamp_length_max(plane.max_force_n), Some(plane))
    }

    /// The largest force (N) on the arm now, but for a ramp.
    fn largest_n(&self) -> f64 {
        let peak_n = self.limiter.limits().max_force_n;
        self.thermal.as_ref().map_or(peak_n, |thermal| thermal.largest_n().min(peak_n))
    }

    /// A force that comes and goes with every other answer is none to feel with.
    fn judge(&mut self, now_ns: u64, verdict: &Verdict) {
        match verdict.link {
            Link::Waiting | Link::Latched(_) => self.success.reset(),
            link => self.success.push(!matches!(link, Link::Ramping(_))),
        }
        if self.success.rate().is_some_and(|rate| rate < self.settings.least_success_rate) {
            self.watchdog.trip(now_ns, Fault::Unreliable);
        }
    }

    fn recover_when_steady(&mut self, now_ns: u64) {
        let gap_ns = (self.settings.watchdog.stale_after_s * 1e9) as u64;
        let alive = self.command.is_some_and(|command| now_ns.saturating_sub(command.answers_ns) <= gap_ns);
        self.steady_since_ns = if alive { self.steady_since_ns.or(Some(now_ns)) } else { None };
        let steady = self.steady_since_ns.is_some_and(|since| now_ns - since >= SETTLED_NS);
        if self.settings.auto_recover && steady {
            self.watchdog.recover();
        }
    }
}

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
}

impl Servo {
    /// Runs on this thread until told to stop and the force is at zero. Dropped afterwards, by a panic too, it leaves the arm
    /// without force.
    pub fn run(&mut self, tick_loop: &mut TickLoop) {
        let clock = tick_loop.clock().clone();
        tick_loop.run(|wakeup| self.tick(wakeup, clock.now_ns()));
    }

    fn tick(&mut self, wakeup: &Wakeup, now_ns: u64) -> ControlFlow<()> {
        let read = self.device.read(1 + wakeup.skipped);
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
        let tick = self.law.tick(now_ns, &motion);
        self.device.apply(&Effort { force_n: tick.limited.force_n, torque_nm: tick.torque_nm, plane: tick.plane });
        if let Some(guard) = &mut self.guard {
            let heard = guard.beat();
            self.shared.unguarded.store(!heard, Ordering::Relaxed);
        }
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
            _ => ControlFlow::Continue(()),
        }
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
            self.up.publish(Some(Sample { sequence: self.sequence, device_time_ns: now_ns, reading: *reading }));
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
        count_if(&stats.damped, tick.added_damping_n_s_per_m > 0.0 || tick.is_capped);
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
    use palpate_realtime::{Clock, slot};

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
        };
        (servo, witness, commands)
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
