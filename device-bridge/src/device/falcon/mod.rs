//! Novint Falcon: an impedance arm of three motors with encoders (a delta), on the kernel's serial port of its USB chip, which is FTDI's.
//!
//! Every tick a frame with three torques goes out, and what has come is read: the newest frame counts. Firmware, which the arm forgets without power, is loaded at the
//! start ([`firmware`]); then the hand shows the arm its home ([`start`]).
//!
//! What only hardware can tell: what a unit of torque is and its sign ([`Settings::torque_units_per_nm`], [`Settings::reversed`]), the angle at count 0
//! ([`Settings::zero_rad`]), whether the motors go off by themselves when no frame comes (no public source says), the weight of its links (not compensated).
pub mod firmware;
pub mod kinematics;
pub mod start;
pub mod wire;

use super::{
    Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, LastWords, Reading,
    drain::Drain,
    requests::{Requests, between},
    serial::{FAREWELL, Line},
    share::Share,
};
use glam::{DMat3, DVec3};
use palpate_control::{Motion, Velocity, extrapolate};
use std::{path::PathBuf, time::Duration};
use tokio_util::sync::CancellationToken;
use wire::{Frame, Frames};

/// Rate (bit/s) while the firmware runs: the chip's 3 MHz over 2.
pub const BAUD: u32 = 1_500_000;
/// A step of an encoder turns a leg by so much (rad): 320 slots, each counted four times, on a shaft of 14.25 mm that turns a wheel of 110 mm.
pub const RAD_PER_COUNT: f64 = 14.25 / 110.0 * std::f64::consts::TAU / 1280.0;
/// Of its published limits.
const STIFFEST_WALL_N_PER_M: f64 = 3000.0;
/// With so many frames unanswered no more is sent: the arm is slower than the loop, and poses would become old.
const MOST_UNANSWERED: usize = 4;
/// When nothing has come for so many periods, what is unanswered was lost, and is asked for anew.
const LOST_AFTER_PERIODS: u64 = 10;
/// Where no Falcon can be, as its encoders may say near its stops, it gets no force and is taken to be where it was last, for so long (s): then it is lost.
const LONGEST_OUT_OF_REACH_S: f64 = 1.0;
/// To the arm in the loop.
const FLAGS: u8 = wire::HOMING | wire::GREEN;

/// The arm's constants.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Path of the serial port.
    pub port: String,
    /// File of the firmware, for an arm in which none runs.
    pub firmware: Option<PathBuf>,
    /// How long the hand may take to show the arm its home.
    pub homing: Duration,
    /// Where the middle of the workspace is, in Stamper's axes (m): the origin of poses.
    pub centre_m: DVec3,
    /// Angle of a leg (rad) at count 0.
    pub zero_rad: f64,
    /// Units that a frame has for a torque on a leg (1/(N m)).
    pub torque_units_per_nm: f64,
    /// Positive units push towards smaller angles.
    pub reversed: bool,
    /// Most units that a motor is ever given.
    pub max_torque_units: i16,
    /// Without a frame for so long the arm is lost.
    pub silence: Duration,
}

impl Settings {
    /// Angles of the legs (rad).
    pub fn angles_rad(&self, counts: [i16; 3]) -> DVec3 {
        DVec3::from(counts.map(f64::from)) * RAD_PER_COUNT + self.zero_rad
    }

    /// Units for torques on the legs (N m), all shortened alike when one is too large: then the force keeps its direction.
    pub fn units(&self, torques_nm: DVec3) -> [i16; 3] {
        let wanted = torques_nm * self.signed_units_per_nm();
        if !wanted.is_finite() {
            return [0; 3];
        }
        let share = (f64::from(self.max_torque_units) / wanted.abs().max_element()).min(1.0);
        // A conversion saturates.
        (share * wanted).round().to_array().map(|units| units as i16)
    }

    /// Torques on the legs (N m) from units.
    pub fn torques_nm(&self, units: [i16; 3]) -> DVec3 {
        DVec3::from(units.map(f64::from)) / self.signed_units_per_nm()
    }

    fn signed_units_per_nm(&self) -> f64 {
        if self.reversed { -self.torque_units_per_nm } else { self.torque_units_per_nm }
    }
}

/// The arm.
#[derive(Debug)]
pub struct Falcon {
    line: Line,
    frames: Frames,
    settings: Settings,
    period_s: f64,
    silence_periods: u64,
    /// Of the newest pose, in Stamper's axes.
    grip_m: DVec3,
    /// There (m/rad).
    jacobian_m_per_rad: DMat3,
    /// Rates (counts/s): counted at the motors, where a step of the encoder is 1; frames are told at ticks.
    rates: [Velocity; 3],
    motion: Motion,
    buttons: u32,
    force_n: DVec3,
    /// Of it: none where no Falcon can be.
    share: Share,
    /// Since the newest frame came.
    quiet_periods: u64,
    /// Frames on their way.
    requests: Requests,
    /// When the newest frame was asked for.
    asked_at: u64,
    /// When the newest pose was asked for: it is not older.
    pose_at: u64,
    /// Of answers to a guard.
    drain: Drain,
    lost: Option<Fault>,
}

impl Falcon {
    /// Starts the arm, which may take a minute: it waits for the hand that shows the arm its home, until told to stop.
    ///
    /// # Errors
    /// [`start::StartError`].
    pub fn open(settings: &Settings, period_s: f64, stop: &CancellationToken) -> Result<Self, start::StartError> {
        let start::Started { line, frames, frame } = start::start(settings, stop)?;
        let mut arm = Self {
            line,
            frames,
            period_s,
            silence_periods: (settings.silence.as_secs_f64() / period_s).ceil() as u64,
            grip_m: kinematics::MIDDLE_M,
            jacobian_m_per_rad: DMat3::ZERO,
            rates: std::array::from_fn(|_| Velocity::new(1.0, period_s)),
            motion: Motion::at(DVec3::ZERO),
            buttons: 0,
            force_n: DVec3::ZERO,
            share: Share::ALL,
            quiet_periods: 0,
            requests: Requests::default(),
            asked_at: 0,
            pose_at: 0,
            drain: Drain::default(),
            lost: None,
            settings: settings.clone(),
        };
        if arm.renew(frame, period_s) {
            Ok(arm)
        } else {
            Err(start::StartError::Impossible { path: settings.port.clone(), counts: frame.numbers })
        }
    }

    /// A new pose, `passed_s` after the last frame; whether a Falcon can be there.
    fn renew(&mut self, frame: Frame, passed_s: f64) -> bool {
        let mut rates = DVec3::ZERO;
        for leg in 0..3 {
            rates[leg] = self.rates[leg].push(f64::from(frame.numbers[leg]), passed_s);
        }
        self.buttons = (frame.flags & wire::BUTTONS).into();
        let Some((grip_m, legs)) = kinematics::grip(self.settings.angles_rad(frame.numbers), self.grip_m) else {
            self.share.pass(false);
            self.motion.velocity_m_per_s = DVec3::ZERO;
            return false;
        };
        self.share.pass(true);
        self.grip_m = grip_m;
        self.jacobian_m_per_rad = legs.slope_rad_per_m.inverse();
        self.motion = Motion::at(grip_m - self.settings.centre_m);
        // v = J ω
        self.motion.velocity_m_per_s = self.jacobian_m_per_rad * (rates * RAD_PER_COUNT);
        true
    }

    /// Drops what has come; when that ends, nothing is on its way.
    fn drop_frames(&mut self) -> Result<(), Fault> {
        self.quiet_periods = 0;
        if self.drain.hear(&mut self.line)? {
            self.requests.forget();
            self.frames = Frames::default();
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<(), Fault> {
        let (frames, requests) = (&mut self.frames, &mut self.requests);
        let newest = self.line.newest(|byte| {
            let Some(frame) = frames.take(byte)? else { return Ok(None) };
            // One that nobody asked for any more was late: the next one says all of it anew.
            Ok(requests.answered().map(|asked_at| (frame, asked_at)))
        })?;
        if let Some((frame, asked_at)) = newest {
            if frame.flags & wire::HOMED != wire::HOMED {
                return Err(Fault::Unhomed);
            }
            let passed = between(asked_at - self.asked_at, self.quiet_periods);
            if self.renew(frame, passed as f64 * self.period_s) {
                self.pose_at = asked_at;
            }
            self.asked_at = asked_at;
            self.quiet_periods = 0;
        }
        // Frames come, and no pose.
        if self.quiet_periods == 0 && self.age_s() > LONGEST_OUT_OF_REACH_S.max(self.settings.silence.as_secs_f64()) {
            return Err(Fault::Garbled);
        }
        if self.quiet_periods > self.silence_periods { Err(Fault::Silent) } else { Ok(()) }
    }

    /// τ = Jᵀ F, as units.
    fn send(&mut self) -> Result<(), Fault> {
        if self.drain.is_on() {
            return self.drain.tell(&mut self.line, &Frame { numbers: [0; 3], flags: FLAGS }.bytes());
        }
        if self.quiet_periods > LOST_AFTER_PERIODS {
            self.requests.forget();
        }
        if self.requests.unanswered() >= MOST_UNANSWERED && self.lost.is_none() {
            return Ok(());
        }
        // One that was not sent is not on its way: the next tick tries again, with what is to be felt then.
        if self.line.send(&Frame { numbers: self.units(), flags: FLAGS }.bytes())? {
            self.requests.made();
        }
        Ok(())
    }

    fn units(&self) -> [i16; 3] {
        self.settings.units(self.share.now() * (self.jacobian_m_per_rad.transpose() * self.force_n))
    }

    fn age_s(&self) -> f64 {
        (self.requests.now() - self.pose_at) as f64 * self.period_s
    }

    fn lose(&mut self, fault: Fault) -> Fault {
        *self.lost.get_or_insert(fault)
    }
}

impl Arm for Falcon {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        self.requests.pass(periods);
        self.quiet_periods = self.quiet_periods.saturating_add(periods);
        let taken = if self.drain.is_on() { self.drop_frames() } else { self.receive() };
        taken.map_err(|fault| self.lose(fault))?;
        let age_s = self.age_s();
        Ok(Reading {
            motion: extrapolate(&self.motion, age_s, LONGEST_EXTRAPOLATION_S),
            buttons: self.buttons,
            measured_force_n: None,
            age_s,
            force_share: self.drain.force_share(),
        })
    }

    /// A lost arm is still told to let go, should it hear.
    fn apply(&mut self, effort: &Effort) {
        self.force_n = effort.unless(self.lost.is_some()).force_n;
        if let Err(fault) = self.send() {
            self.lose(fault);
        }
    }

    fn stiffest_wall_n_per_m(&self) -> Option<f64> {
        Some(STIFFEST_WALL_N_PER_M)
    }

    fn last_words(&self) -> Option<LastWords> {
        self.line.last_words(Frame { numbers: [0; 3], flags: wire::HOMING | wire::BLUE }.bytes().to_vec())
    }

    fn last_words_were_said(&mut self) {
        self.lost = self.lost.filter(|fault| !fault.may_be_misheard());
        self.drain.begin(self.silence_periods);
    }
}

impl Drop for Falcon {
    /// Takes the torques away; its light says that nobody uses it.
    fn drop(&mut self) {
        let _ = self.line.send_in_turn(&Frame { numbers: [0; 3], flags: wire::HOMING | wire::BLUE }.bytes(), FAREWELL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config::FalconConfig, device::noise::Pair, settings::arm};

    fn settings(port: &str) -> Settings {
        arm::falcon::checked(&FalconConfig { port: port.to_owned(), ..FalconConfig::default() }).unwrap()
    }

    #[test]
    fn a_count_is_as_published() {
        assert!((RAD_PER_COUNT.to_degrees() - 0.036435).abs() < 1e-6);
    }

    #[test]
    fn torques_become_units_and_back_and_none_is_beyond_the_limit() {
        let settings = settings("");
        let torques_nm = DVec3::new(0.1, -0.2, 0.05);
        assert_eq!(settings.units(torques_nm), [-1000, 2000, -500]);
        assert!(settings.torques_nm(settings.units(torques_nm)).distance(torques_nm) < 1e-12);
        let most = settings.units(1e9 * torques_nm).map(f64::from);
        assert!(most[1] == f64::from(settings.max_torque_units) && (most[0] / most[1] + 0.5).abs() < 1e-3);
        assert_eq!(settings.units(DVec3::ZERO), [0; 3]);
        assert_eq!(settings.units(DVec3::new(f64::NAN, 1.0, 1.0)), [0; 3]);
    }

    /// Poses that are numbers, or a fault by its name, and nothing else; before the first frame and after it.
    #[test]
    fn a_million_random_bytes_are_poses_or_garbled() {
        let mut pair = Pair::new();
        let settings = settings(&pair.path);
        let home = Frame { numbers: [10, -20, 30], flags: wire::HOMED }.bytes();
        let mut arm = pair.starting(&home, || Falcon::open(&settings, 1e-3, &CancellationToken::new())).unwrap();
        let in_step = arm.frames.clone();
        let (mut readings, mut faults) = (0_u64, 0);
        pair.feed(&home, || {
            (arm.lost, arm.quiet_periods, arm.pose_at) = (None, 0, arm.requests.now());
            match arm.read(1) {
                Ok(reading) => {
                    assert!(reading.motion.is_finite());
                    readings += 1;
                }
                Err(fault) => {
                    assert!([Fault::Garbled, Fault::Unhomed].contains(&fault), "{fault}");
                    arm.line.forget().unwrap();
                    arm.frames = if readings.is_multiple_of(2) { Frames::default() } else { in_step.clone() };
                    faults += 1;
                }
            }
            arm.apply(&Effort::force(DVec3::ONE));
        });
        assert!(faults > 1000 && readings > 1000, "{faults} {readings}");
    }

    #[test]
    fn out_of_reach_there_is_no_force_and_it_comes_back_slowly() {
        let mut pair = Pair::new();
        let settings = settings(&pair.path);
        let home = Frame { numbers: [10, -20, 30], flags: wire::HOMED };
        let open = || Falcon::open(&settings, 1e-3, &CancellationToken::new());
        let mut arm = pair.starting(&home.bytes(), open).unwrap();
        arm.force_n = DVec3::new(1.0, 1.0, 3.0);
        let whole = arm.units();
        assert!(whole.iter().all(|units| units.abs() > 100), "{whole:?}");
        assert!(!arm.renew(Frame { numbers: [20_000, -20_000, 0], ..home }, 1e-3));
        assert_eq!(arm.units(), [0; 3]);
        for frame in 1..=50 {
            assert!(arm.renew(home, 1e-3));
            for (now, whole) in arm.units().iter().zip(whole) {
                let expected = 0.02 * f64::from(frame) * f64::from(whole);
                assert!((f64::from(*now) - expected).abs() < 1.5, "{now}, {expected}");
            }
        }
    }
}
