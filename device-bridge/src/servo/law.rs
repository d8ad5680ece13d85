//! The law of the servo: what force an arm is given, tick by tick, without threads and clocks.
use crate::{convert::Command, settings::ServoSettings};
use glam::DVec3;
use palpate_control::{
    ContactPlane, Fault, ForceLimiter, ForceLimits, Limited, Link, LocalModel, Motion, PassivityController,
    RenderSettings, StiffnessBound, SuccessRate, ThermalLimiter, TorqueLaw, Verdict, Watchdog,
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

    /// Begins with a fault that was latched before this program was started.
    pub fn begin_latched(&mut self, fault: Fault) {
        self.watchdog.begin_latched(fault);
    }

    /// Latches at once: the force was taken away already.
    pub fn latch(&mut self, fault: Fault) {
        self.watchdog.latch(fault);
        self.steady_since_ns = None;
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
    pub(super) fn is_in_time(&self, verdict: &Verdict) -> bool {
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
            // A force is held until the next tick, however many are left out; how long that is, is known then: the time of the last one stands for it.
            thermal.held(limited.force_n, self.passed_s);
        }
        let at = (motion.position_m, motion.velocity_m_per_s);
        let plane = plane
            .filter(|_| !limited.non_finite)
            .and_then(|plane| plane.limited(limited.force_n, at, ramp, self.largest_n()));
        self.given = plane.map(|plane| (plane, motion.position_m));
        let wanted_nm = self.wanted_nm(motion, &verdict);
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

    /// The same of torque.
    fn wanted_nm(&self, motion: &Motion, verdict: &Verdict) -> DVec3 {
        let Some(command) = &self.command else { return DVec3::ZERO };
        match (&command.local_torque, &self.settings.render) {
            (Some(model), Some(render)) => {
                let max_stiffness_n_per_m = self.stiffness.largest_n_per_m();
                let age_s = verdict.age_s + command.model_age_s;
                model.render(motion.orientation, age_s, &RenderSettings { max_stiffness_n_per_m, ..*render })
            }
            _ => command.torque.0,
        }
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
