//! WoodenHaptics (open hardware): an impedance arm of three motors with encoders, on a serial line.
//!
//! Every tick a line with three currents goes out, and what has come is read: the newest line counts. Whether the board answers each line or sends by itself
//! does not matter, so. Its encoders count from where the arm was when it was switched on: that has to be the pose in which all angles are 0, or
//! [`Settings::home_counts`] says what they are there.
//!
//! What only hardware can tell: the order and signs of axes ([`Settings::reversed`]), what its word of information says (it is not looked at), the weight of its links
//! (not compensated). Its firmware switches the motors off after half a second without a line.
pub mod kinematics;
pub mod wire;

use super::{
    Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, LastWords, Reading,
    serial::{self, FAREWELL, Line, Lines, StartError},
};
use glam::{DMat3, DVec3};
use kinematics::Kinematics;
use palpate_control::{Motion, Velocity, extrapolate};
use std::time::Duration;

/// How long the first line may take.
const PATIENCE: Duration = Duration::from_secs(2);
/// Between two lines to a board that has not said anything yet.
const ASK_EVERY: Duration = Duration::from_millis(5);
/// No current: motors off.
const NOTHING: [i16; wire::NUMBERS] = [0; wire::NUMBERS];

/// The arm's constants. Of each three, the first is of body a, which turns round the upright axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Path of the serial port.
    pub port: String,
    /// Its rate; a board with USB of its own does not care.
    pub baud: u32,
    /// Lengths.
    pub kinematics: Kinematics,
    /// Turns of each motor for a turn of its body: its diameter over the capstan's.
    pub gear_ratios: DVec3,
    /// Counts for a turn of a motor.
    pub counts_per_turn: f64,
    /// What the encoders say where all angles are 0.
    pub home_counts: [i16; 3],
    /// Motors and encoders that turn the other way.
    pub reversed: [bool; 3],
    /// Torque of a motor (N m/A).
    pub torque_constant_nm_per_a: f64,
    /// Largest current (A) that a motor is ever given.
    pub max_current_a: f64,
    /// Without a line for so long the arm is lost.
    pub silence: Duration,
}

impl Settings {
    /// Angles (rad) of the bodies.
    pub fn angles_rad(&self, counts: [i16; 3]) -> DVec3 {
        let turned = |axis: usize| f64::from(counts[axis]) - f64::from(self.home_counts[axis]);
        DVec3::new(turned(0), turned(1), turned(2)) * self.rad_per_count()
    }

    /// What a count means (rad), with its sign.
    pub fn rad_per_count(&self) -> DVec3 {
        self.signs() * std::f64::consts::TAU / self.counts_per_turn / self.gear_ratios
    }

    /// Currents (mA) for torques (N m) on the bodies, all shortened alike when one is too large: then the force keeps its direction.
    pub fn currents_ma(&self, torques_nm: DVec3) -> [i16; 3] {
        let wanted_a = self.signs() * torques_nm / self.gear_ratios / self.torque_constant_nm_per_a;
        let share = (self.max_current_a / wanted_a.abs().max_element()).min(1.0);
        // A conversion saturates, and what is no number is 0.
        (1e3 * share * wanted_a).round().to_array().map(|ma| ma as i16)
    }

    /// Torques (N m) on the bodies from currents (mA).
    pub fn torques_nm(&self, currents_ma: [i16; 3]) -> DVec3 {
        let amperes = DVec3::from(currents_ma.map(f64::from)) * 1e-3;
        self.signs() * amperes * self.torque_constant_nm_per_a * self.gear_ratios
    }

    fn signs(&self) -> DVec3 {
        DVec3::from(self.reversed.map(|reversed| if reversed { -1.0 } else { 1.0 }))
    }
}

/// The arm.
#[derive(Debug)]
pub struct WoodenHaptics {
    line: Line,
    lines: Lines,
    settings: Settings,
    period_s: f64,
    silence_periods: u64,
    /// At the newest pose (m/rad).
    jacobian_m_per_rad: DMat3,
    /// Rates (counts/s): counted at the motors, where a step of the encoder is 1; lines are told at ticks.
    rates: [Velocity; 3],
    motion: Motion,
    force_n: DVec3,
    /// Since the newest line came.
    quiet_periods: u64,
    message: Vec<u8>,
    lost: Option<Fault>,
}

impl WoodenHaptics {
    /// Opens the port, and waits for a first line. Blocks.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(settings: &Settings, period_s: f64) -> Result<Self, StartError> {
        let (mut lines, mut message) = (Lines::default(), Vec::with_capacity(wire::LONGEST));
        wire::write(NOTHING, &mut message);
        let (line, [a, b, c, ..]) = serial::start((&settings.port, settings.baud), ("line", PATIENCE), |line| {
            line.send(&message)?;
            std::thread::sleep(ASK_EVERY);
            newest(line, &mut lines)
        })?;
        let mut arm = Self {
            line,
            lines,
            period_s,
            silence_periods: (settings.silence.as_secs_f64() / period_s).ceil() as u64,
            jacobian_m_per_rad: DMat3::ZERO,
            rates: std::array::from_fn(|_| Velocity::new(1.0, period_s)),
            motion: Motion::at(DVec3::ZERO),
            force_n: DVec3::ZERO,
            quiet_periods: 0,
            message,
            lost: None,
            settings: settings.clone(),
        };
        arm.renew([a, b, c], period_s);
        Ok(arm)
    }

    /// A new pose, `passed_s` after the one before.
    fn renew(&mut self, counts: [i16; 3], passed_s: f64) {
        let mut rates = DVec3::ZERO;
        for axis in 0..3 {
            rates[axis] = self.rates[axis].push(f64::from(counts[axis]), passed_s);
        }
        let angles_rad = self.settings.angles_rad(counts);
        let kinematics = &self.settings.kinematics;
        self.motion = Motion::at(kinematics.tool_m(angles_rad));
        self.jacobian_m_per_rad = kinematics.jacobian_m_per_rad(angles_rad);
        // v = J ω
        self.motion.velocity_m_per_s = self.jacobian_m_per_rad * (rates * self.settings.rad_per_count());
    }

    fn receive(&mut self) -> Result<(), Fault> {
        if let Some([a, b, c, ..]) = newest(&mut self.line, &mut self.lines)? {
            let passed_s = self.quiet_periods as f64 * self.period_s;
            self.quiet_periods = 0;
            self.renew([a, b, c], passed_s);
        }
        // Or it says its lines, and hears none of ours.
        if self.quiet_periods.max(self.line.refused_in_row()) > self.silence_periods {
            Err(Fault::Silent)
        } else {
            Ok(())
        }
    }

    /// τ = Jᵀ F, as currents.
    fn send(&mut self) -> Result<(), Fault> {
        let [a, b, c] = self.settings.currents_ma(self.jacobian_m_per_rad.transpose() * self.force_n);
        wire::write([a, b, c, 0, 0, 0, 0], &mut self.message);
        // One that was not sent is tried again in the next tick, with what is to be felt then.
        self.line.send(&self.message).map(drop)
    }

    fn lose(&mut self, fault: Fault) -> Fault {
        *self.lost.get_or_insert(fault)
    }
}

fn newest(line: &mut Line, lines: &mut Lines) -> Result<Option<[i16; wire::NUMBERS]>, Fault> {
    line.newest(|byte| lines.take(byte)?.map(wire::parse).transpose())
}

impl Arm for WoodenHaptics {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        self.quiet_periods = self.quiet_periods.saturating_add(periods);
        self.receive().map_err(|fault| self.lose(fault))?;
        let quiet_s = self.quiet_periods as f64 * self.period_s;
        Ok(Reading {
            motion: extrapolate(&self.motion, quiet_s, LONGEST_EXTRAPOLATION_S),
            buttons: 0,
            measured_force_n: None,
            // It came since the last tick.
            age_s: quiet_s + self.period_s,
            force_share: 1.0,
        })
    }

    /// A lost arm is still told to let go, should it hear.
    fn apply(&mut self, effort: &Effort) {
        self.force_n = effort.unless(self.lost.is_some()).force_n;
        if let Err(fault) = self.send() {
            self.lose(fault);
        }
    }

    /// A line of its own, whatever was begun.
    fn last_words(&self) -> Option<LastWords> {
        let (mut bytes, mut line) = (b"\n".to_vec(), Vec::new());
        wire::write(NOTHING, &mut line);
        bytes.append(&mut line);
        self.line.last_words(bytes)
    }
}

impl Drop for WoodenHaptics {
    /// Switches the motors off.
    fn drop(&mut self) {
        wire::write(NOTHING, &mut self.message);
        let _ = self.line.send_in_turn(&self.message, FAREWELL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{config::WoodenHapticsConfig, device::noise::Pair, settings::arm};

    /// The currents of the last line that the driver said.
    fn last_currents(heard: &[u8]) -> [i16; wire::NUMBERS] {
        let mut lines = Lines::default();
        let mut take = |&byte: &u8| lines.take(byte).unwrap().map(|line| wire::parse(line).unwrap());
        heard.iter().filter_map(&mut take).last().unwrap()
    }

    /// A board that says its lines by itself, and does not read ours.
    #[test]
    fn a_board_that_does_not_listen_is_lost_and_hears_the_newest_when_it_does() {
        let mut pair = Pair::new();
        let keys = WoodenHapticsConfig { port: pair.path.clone(), silence_s: 0.05, ..WoodenHapticsConfig::default() };
        let settings = arm::woodenhaptics::checked(&keys).unwrap();
        let mut mine = Vec::new();
        wire::write([1, 2, 3, 0, 0, 0, 0], &mut mine);
        let mut arm = pair.starting(&mine, || WoodenHaptics::start(&settings, 1e-3)).unwrap();
        let deaf = |arm: &mut WoodenHaptics, pair: &mut Pair, done: &dyn Fn(&WoodenHaptics) -> bool| {
            for _ in 0..100_000 {
                pair.say(&mine);
                // A pseudo terminal hands on what was written a moment later.
                arm.quiet_periods = 0;
                let read = arm.read(1).map(drop);
                arm.apply(&Effort::force(DVec3::X));
                if read.is_err() || done(arm) {
                    return read;
                }
            }
            Ok(())
        };
        assert_eq!(deaf(&mut arm, &mut pair, &|arm| arm.line.refused_in_row() > 10), Ok(()));
        pair.heard();
        arm.apply(&Effort::force(DVec3::Y));
        let expected = arm.settings.currents_ma(arm.jacobian_m_per_rad.transpose() * DVec3::Y);
        assert_eq!(last_currents(&pair.heard())[..3], expected);
        assert_ne!(expected, [0; 3]);
        assert_eq!(deaf(&mut arm, &mut pair, &|_| false), Err(Fault::Silent));
        pair.heard();
        arm.apply(&Effort::force(DVec3::Y));
        assert_eq!(last_currents(&pair.heard()), NOTHING);
    }
}
