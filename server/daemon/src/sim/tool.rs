//! One tool's side of the tick: where it shall go, and what force its arm gets.
use super::{
    arm::BuiltinArm,
    exchange::{DeviceInput, LimitedTicks, ToolOutput, ToolPort, ToolView},
};
use glam::DVec3;
use palpate_control::{
    extrapolate::{Motion, extrapolate},
    limits::{ForceLimiter, ForceLimits},
    torque::{TorqueLimiter, TorqueLimits},
    watchdog::{Link, Verdict, Watchdog, WatchdogSettings},
};
use palpate_physics::contact::{LocalContactModel, LocalTorqueModel, ToolState, ToolTarget};
use palpate_scene::Driver;

/// Times and limits of an arm's force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmLimits {
    /// Peak (N) and rate (N/s); a device's own peak applies when it is smaller.
    pub force: ForceLimits,
    /// The same of torque.
    pub torque: TorqueLimits,
    /// When a sample is stale, and the ramps.
    pub watchdog: WatchdogSettings,
    /// Largest sum of forces (N) that callers without the role of an operator inject while an arm is attached.
    pub max_injected_force_n: f64,
    /// Button that has to be held on an arm for it to have force.
    pub hold_to_run: Option<u8>,
}

/// What the loop asks of devices this tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Render the force.
    Render,
    /// Time stands or is stepped by hand: devices are released. The simulated arm lives in simulated time and minds nothing.
    Hold,
    /// Every force ramps to zero and stays there.
    Release,
}

/// How far a tool has come to its device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    /// The device may be in the body: the tool is put to it in every tick, and there is no force yet.
    Put,
    /// Has been clear of the body at least once.
    Clear,
}

/// A tool in the loop.
#[derive(Debug)]
pub struct ToolLoop {
    driver: Driver,
    port: ToolPort,
    arm: Option<BuiltinArm>,
    limits: ArmLimits,
    limiter: ForceLimiter,
    torque_limiter: TorqueLimiter,
    watchdog: Watchdog,
    /// Factor of the force by order, 0 to 1.
    level: f64,
    /// When that was last changed (loop clock, ns).
    levelled_ns: Option<u64>,
    attachment: u64,
    place: Place,
    /// The simulated arm has to start where the device left the tool.
    arm_takes_over: bool,
    newest: Option<DeviceInput>,
    /// For how long (ns) the newest sample had waited, if this tick is the first that uses it.
    waited_ns: Option<u64>,
    limited: LimitedTicks,
    raw_n: DVec3,
    raw_nm: DVec3,
    output: ToolOutput,
}

impl ToolLoop {
    /// A tool of a scene.
    pub fn new(driver: Driver, port: ToolPort, arm: Option<BuiltinArm>, limits: ArmLimits) -> Self {
        Self {
            driver,
            port,
            arm,
            limits,
            limiter: ForceLimiter::new(limits.force),
            torque_limiter: TorqueLimiter::new(limits.torque),
            watchdog: Watchdog::new(limits.watchdog),
            level: 1.0,
            levelled_ns: None,
            attachment: 0,
            place: Place::Clear,
            arm_takes_over: false,
            newest: None,
            waited_ns: None,
            limited: LimitedTicks::default(),
            raw_n: DVec3::ZERO,
            raw_nm: DVec3::ZERO,
            output: ToolOutput::default(),
        }
    }

    /// Whether a device drives it now.
    pub fn is_attached(&self) -> bool {
        self.attachment != 0
    }

    /// Its arm has neither force nor torque now.
    pub fn is_without_force(&self) -> bool {
        (self.output.force_n, self.output.torque_nm) == (DVec3::ZERO, DVec3::ZERO)
    }

    /// Takes note of attaching, detaching and new samples at the beginning (ns) of each tick, also while paused.
    pub fn listen(&mut self, begun_ns: u64) {
        self.waited_ns = None;
        let attachment = self.port.shared.attachment();
        if attachment != self.attachment {
            self.change_hands(attachment);
        }
        if !self.port.samples.update() {
            return;
        }
        if let Some(sample) =
            self.port.samples.output_buffer().filter(|s| s.attachment == attachment && attachment != 0)
        {
            self.watchdog.recover();
            self.watchdog.sample_arrived(sample.arrived_ns);
            self.newest = Some(sample);
            self.waited_ns = Some(begun_ns.saturating_sub(sample.arrived_ns));
        }
    }

    fn change_hands(&mut self, attachment: u64) {
        self.arm_takes_over = attachment == 0;
        self.attachment = attachment;
        self.newest = None;
        self.limited = LimitedTicks::default();
        self.watchdog = Watchdog::new(self.patience());
        let own = self.limits.force;
        let max_force_n =
            if attachment == 0 { own.max_force_n } else { own.max_force_n.min(self.port.shared.max_force_n()) };
        self.limiter = ForceLimiter::new(ForceLimits { max_force_n, ..own });
        let theirs = if attachment == 0 { f64::INFINITY } else { self.port.shared.max_torque_nm() };
        let torque = self.limits.torque;
        let max_torque_nm = torque.max_torque_nm.min(theirs);
        self.torque_limiter = TorqueLimiter::new(TorqueLimits { max_torque_nm, ..torque });
        self.output = ToolOutput { attachment, ..ToolOutput::default() };
        self.start_over();
    }

    /// How long the attached device may be silent: longer than others, where it said so.
    fn patience(&self) -> WatchdogSettings {
        let (own, theirs_s) = (self.limits.watchdog, self.port.shared.stale_after_s());
        if self.attachment == 0 || theirs_s == 0.0 {
            return own;
        }
        WatchdogSettings { stale_after_s: theirs_s, fresh_for_s: own.fresh_for_s.min(theirs_s), ..own }
    }

    /// A device's tool has to find its place, without force; any other has its own.
    fn start_over(&mut self) {
        let attached = self.is_attached();
        self.level = if attached { 0.0 } else { 1.0 };
        self.place = if attached { Place::Put } else { Place::Clear };
    }

    /// The button that its force depends on is held, or it depends on none.
    fn is_held(&self) -> bool {
        let buttons = self.newest.map_or(0, |sample| sample.buttons);
        self.limits.hold_to_run.is_none_or(|button| buttons >> button & 1 == 1)
    }

    /// Where the tool has to be put before its device moves it, as long as it was not clear of the body since the device
    /// came. It must not sweep through the body on its way from where it was. A tool that was put into a wall once, and
    /// moved by its device from there on, pressed its way to the other side of it and was caught in the cavity.
    pub fn new_place(&self) -> Option<ToolTarget> {
        let sample = self.newest.filter(|_| self.waits_to_be_clear())?;
        Some(ToolTarget { orientation: sample.orientation, ..ToolTarget::at(sample.position_m) })
    }

    /// Whether it waits to be clear of the body, with a device that says where it is.
    pub fn waits_to_be_clear(&self) -> bool {
        self.place == Place::Put && self.is_attached() && self.newest.is_some()
    }

    /// It is outside the body: from now on there is force.
    pub fn found_clear(&mut self) {
        self.place = Place::Clear;
    }

    /// Where the tool shall be at the end of the tick, `time_s` (s of simulated time).
    pub fn target(&mut self, tool: &ToolState, now_ns: u64, time_s: f64) -> ToolTarget {
        if let Some(target) = self.driver.target(time_s) {
            return target;
        }
        let held = tool.target.at_rest();
        if !self.is_attached() {
            let force_n = self.output.force_n;
            let takes_over = std::mem::take(&mut self.arm_takes_over);
            let Some(arm) = self.arm.as_mut() else { return held };
            if takes_over {
                arm.place(held);
            }
            return arm.advance(time_s, force_n);
        }
        let Some(sample) = &self.newest else { return held };
        let verdict = self.watchdog.check(now_ns);
        let motion = Motion {
            position_m: sample.position_m,
            orientation: sample.orientation,
            velocity_m_per_s: sample.velocity_m_per_s,
            angular_velocity_rad_per_s: sample.angular_velocity_rad_per_s,
        };
        let there = extrapolate(&motion, verdict.extrapolate_s, self.limits.watchdog.stale_after_s);
        let target = ToolTarget {
            position_m: there.position_m,
            velocity_m_per_s: there.velocity_m_per_s,
            orientation: there.orientation,
            angular_velocity_rad_per_s: there.angular_velocity_rad_per_s,
        };
        if is_stale(&verdict) { target.at_rest() } else { target }
    }

    /// Limits the force after a tick (`advanced`), or of a standing body.
    pub fn couple(&mut self, tool: &ToolState, frame: &Moment, order: Order, advanced: bool) {
        if !self.is_attached() && !advanced && order != Order::Release {
            return;
        }
        let quarantined = frame.quarantined;
        let ordered = match order {
            Order::Render => self.is_attached() && (self.port.shared.is_released() || !self.is_held()),
            Order::Hold => self.is_attached(),
            Order::Release => true,
        };
        let release = ordered || quarantined.is_some() || self.place != Place::Clear;
        self.ramp(release, frame);
        if quarantined.is_none() {
            (self.raw_n, self.raw_nm) = (tool.device_force_n, tool.device_torque_nm);
        }
        let watched = self.is_attached().then(|| self.watchdog.check(frame.now_ns));
        let ramp = watched.map_or(1.0, |verdict| verdict.ramp) * self.level;
        let limited = self.limiter.limit(self.raw_n, ramp, frame.period_s);
        let torque_nm = self.torque_limiter.limit(self.raw_nm, ramp, frame.period_s);
        let model_max_force_n = ramp * self.limiter.limits().max_force_n;
        let model_max_torque_nm = ramp * self.torque_limiter.max_torque_nm();
        if ramp > 0.0 {
            let count = &mut self.limited;
            count.total += u64::from(limited.saturated || limited.rate_limited || limited.non_finite);
            count.by_peak += u64::from(limited.saturated);
            count.by_rate += u64::from(limited.rate_limited);
        }
        let rendered = tool.local_model.filter(|_| ramp > 0.0 && !limited.non_finite);
        self.output = ToolOutput {
            attachment: self.attachment,
            tick: frame.tick,
            force_n: limited.force_n,
            torque_nm,
            sample_sequence: self.newest.map_or(0, |s| s.sequence),
            echo_device_time_ns: self.newest.map_or(0, |s| s.device_time_ns),
            sample_waited_ns: self.waited_ns,
            local_model: rendered.map(|model| {
                let cut = left_of(self.raw_n.length(), limited.force_n.length() / ramp);
                let to_peak = left_of(model.force_n.length() * cut * ramp, model_max_force_n);
                let torque = model.torque.filter(|_| model_max_torque_nm > 0.0).map(|torque| {
                    let cut = left_of(self.raw_nm.length(), torque_nm.length() / ramp);
                    let to_peak = left_of(torque.torque_nm.length() * cut * ramp, model_max_torque_nm);
                    scaled_torque(&torque, ramp * cut * to_peak)
                });
                LocalContactModel { torque, ..scaled(&model, ramp * cut * to_peak) }
            }),
            model_max_force_n,
            model_max_torque_nm,
            proxy_position_m: tool.centre_m,
            proxy_orientation: tool.orientation,
            stale: self.newest.is_some() && watched.is_some_and(|verdict| is_stale(&verdict)),
            held: order == Order::Hold,
            let_go: self.is_attached() && self.newest.is_some() && !self.is_held(),
            limited: self.limited,
            quarantined,
        };
    }

    /// Down in `ramp_to_zero_s` of the clock, however long ticks take; up in `ramp_up_s`, and never faster than ticks go.
    fn ramp(&mut self, release: bool, frame: &Moment) {
        let since_s = self.levelled_ns.map_or(frame.period_s, |last| frame.now_ns.saturating_sub(last) as f64 * 1e-9);
        self.levelled_ns = Some(frame.now_ns);
        let times = self.limits.watchdog;
        if release {
            self.level = (self.level - since_s / times.ramp_to_zero_s).max(0.0);
        } else if times.ramp_up_s > 0.0 {
            self.level = (self.level + since_s.min(frame.period_s) / times.ramp_up_s).min(1.0);
        } else {
            self.level = 1.0;
        }
    }

    /// Hands the output to the device, if there is one.
    pub fn publish(&mut self) {
        if self.is_attached() {
            self.port.outputs.write(self.output);
            self.port.bell.ring();
        }
    }

    /// The tool as viewers see it.
    pub fn view(&self, tool: &ToolState) -> ToolView {
        ToolView {
            device_position_m: tool.target.position_m,
            proxy_position_m: tool.centre_m,
            contact_force_n: tool.contact_force_n,
            device_force_n: self.output.force_n,
            contacts: tool.contacts,
            device_orientation: tool.target.orientation,
            proxy_orientation: tool.orientation,
            contact_torque_nm: tool.contact_torque_nm,
            device_torque_nm: self.output.torque_nm,
        }
    }

    /// Back to the start of time.
    pub fn reset(&mut self) {
        (self.raw_n, self.raw_nm) = (DVec3::ZERO, DVec3::ZERO);
        self.start_over();
        self.arm_takes_over = false;
        self.limiter.reset();
        self.torque_limiter.reset();
        self.output = ToolOutput { attachment: self.attachment, ..ToolOutput::default() };
        if let Some(arm) = &mut self.arm {
            arm.reset();
        }
    }

    /// The state was put elsewhere in time: the simulated arm goes where its tool was sent.
    pub fn restored(&mut self, tool: &ToolState) {
        self.reset();
        if let Some(arm) = &mut self.arm {
            arm.place(tool.target);
        }
    }
}

/// When and where in time a tool is coupled.
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    /// Loop clock (ns).
    pub now_ns: u64,
    /// Tick done.
    pub tick: u64,
    /// Period of the loop (s).
    pub period_s: f64,
    /// Tick at which the body was quarantined, if it is.
    pub quarantined: Option<u64>,
}

fn is_stale(verdict: &Verdict) -> bool {
    !matches!(verdict.link, Link::Fresh | Link::Extrapolating)
}

/// Share of `wanted_n` that `allowed_n` leaves, at most 1.
fn left_of(wanted_n: f64, allowed_n: f64) -> f64 {
    if wanted_n > allowed_n { allowed_n / wanted_n } else { 1.0 }
}

/// Force and stiffness are scaled together: a contact that is cut to half its force is rendered half as stiff.
fn scaled(model: &LocalContactModel, by: f64) -> LocalContactModel {
    LocalContactModel { force_n: model.force_n * by, stiffness_n_per_m: model.stiffness_n_per_m * by, ..*model }
}

/// So are torque and stiffness.
fn scaled_torque(model: &LocalTorqueModel, by: f64) -> LocalTorqueModel {
    let stiffness_nm_per_rad = model.stiffness_nm_per_rad * by;
    LocalTorqueModel { torque_nm: model.torque_nm * by, stiffness_nm_per_rad, ..*model }
}
