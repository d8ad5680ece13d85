//! Haply 2diy (open hardware): an impedance arm of two motors with encoders, in a plane, on a serial line of USB.
//!
//! One request at a time is on its way: it carries two torques, and its answer two angles. So a pose is a tick old, or as long as an answer takes; its age counts from
//! its request. The tool moves in x and y; z is 0, and a force along z is not felt.
//!
//! Its encoders count from where the arm is when the bridge starts: that has to be the pose of [`wire::Axis::offset_deg`]. The published firmware keeps the last torques
//! for ever: a bridge that ends takes them away, and the guard of one that is killed.
//!
//! What only hardware can tell: which way its motors push ([`Settings::reversed`]), and the weight and friction of its links (not compensated).
pub mod kinematics;
mod settings;
pub mod wire;

use super::{
    Arm, Effort, Fault, LONGEST_EXTRAPOLATION_S, LastWords, Reading,
    drain::Drain,
    requests::{Requests, between},
    serial::{self, FAREWELL, Line},
    share::Share,
};
use glam::{DMat2, DVec2, DVec3, Vec3Swizzles as _};
use palpate_control::{Motion, Velocity, extrapolate};
pub use settings::Settings;
use std::time::{Duration, Instant};
use thiserror::Error;
use wire::Replies;

/// How long the first answer may take.
const PATIENCE: Duration = Duration::from_secs(3);
/// A board that does not answer is set up anew after so long: it may have begun anew when the port was opened.
const SET_UP_EVERY: Duration = Duration::from_secs(1);
/// How long a message that sets it up waits for the one before.
const IN_TURN: Duration = Duration::from_millis(200);
/// Between two looks at whether it answered.
const LOOK_EVERY: Duration = Duration::from_millis(1);

/// Why the arm could not be started.
#[derive(Debug, Error)]
pub enum StartError {
    /// Its port, or its silence.
    #[error(transparent)]
    Line(#[from] serial::StartError),
    /// Angles that no such arm has.
    #[error("{path}: its angles are {} and {} degrees, which no arm of these lengths has", angles_deg[0], angles_deg[1])]
    Impossible {
        /// The port.
        path: String,
        /// What it says.
        angles_deg: [f64; 2],
    },
}

/// The arm.
#[derive(Debug)]
pub struct Haply2diy {
    line: Line,
    replies: Replies,
    settings: Settings,
    period_s: f64,
    silence_periods: u64,
    /// At the newest pose (m/rad).
    jacobian_m_per_rad: DMat2,
    /// Rates (degrees/s): at the motors, where a step of the encoder is known; answers are told at ticks.
    rates: [Velocity; 2],
    motion: Motion,
    force_n: DVec2,
    /// Of it: none where the outer links are in line.
    share: Share,
    requests: Requests,
    /// When the newest pose was asked for: it is not older.
    asked_at: u64,
    /// Since it came.
    quiet_periods: u64,
    /// Of answers to a guard.
    drain: Drain,
    lost: Option<Fault>,
}

impl Haply2diy {
    /// Opens the port, sets the board up, and waits for a first answer. Blocks. Torques that were left on are taken away.
    ///
    /// # Errors
    /// [`StartError`].
    pub fn start(settings: &Settings, period_s: f64) -> Result<Self, StartError> {
        let mut replies = Replies::new(settings.device_id);
        let mut set_up = None::<Instant>;
        let (line, sent_deg) = serial::start((&settings.port, settings.baud), ("answer", PATIENCE), |line| {
            if set_up.is_none_or(|set_up| set_up.elapsed() > SET_UP_EVERY) {
                line.forget()?;
                replies = Replies::new(settings.device_id);
                set_up_board(line, settings)?;
                set_up = Some(Instant::now());
            }
            std::thread::sleep(LOOK_EVERY);
            line.newest(|byte| replies.take(byte))
        })?;
        let steps_deg = settings.steps_deg();
        let mut arm = Self {
            line,
            replies,
            period_s,
            silence_periods: (settings.silence.as_secs_f64() / period_s).ceil() as u64,
            jacobian_m_per_rad: DMat2::ZERO,
            rates: [steps_deg.x, steps_deg.y].map(|step| Velocity::new(step, period_s)),
            motion: Motion::at(DVec3::ZERO),
            force_n: DVec2::ZERO,
            share: Share::ALL,
            requests: Requests::default(),
            asked_at: 0,
            quiet_periods: 0,
            drain: Drain::default(),
            lost: None,
            settings: settings.clone(),
        };
        let (path, angles_deg) = (settings.port.clone(), settings.swapped(sent_deg));
        arm.renew(sent_deg, period_s).map_err(|_| StartError::Impossible { path, angles_deg })?;
        Ok(arm)
    }

    /// A new pose, `passed_s` after the one before.
    fn renew(&mut self, sent_deg: [f64; 2], passed_s: f64) -> Result<(), Fault> {
        let angles_deg = DVec2::from(self.settings.swapped(sent_deg));
        let angles_rad = angles_deg.map(f64::to_radians);
        let place = self.settings.kinematics.place(angles_rad).ok_or(Fault::Garbled)?;
        let [a, b] = &mut self.rates;
        let rates_deg = DVec2::new(a.push(angles_deg.x, passed_s), b.push(angles_deg.y, passed_s));
        self.jacobian_m_per_rad = place.jacobian_m_per_rad;
        self.share.pass(place.jacobian_m_per_rad != DMat2::ZERO);
        self.motion = Motion::at(place.tool_m.extend(0.0));
        // v = J ω
        self.motion.velocity_m_per_s = (place.jacobian_m_per_rad * rates_deg.map(f64::to_radians)).extend(0.0);
        Ok(())
    }

    /// Drops what has come; when that ends, nothing is on its way.
    fn drop_answers(&mut self) -> Result<(), Fault> {
        self.quiet_periods = 0;
        if self.drain.hear(&mut self.line)? {
            self.requests.forget();
            self.replies = Replies::new(self.settings.device_id);
        }
        Ok(())
    }

    fn receive(&mut self) -> Result<(), Fault> {
        let (replies, requests) = (&mut self.replies, &mut self.requests);
        let newest = self.line.newest(|byte| {
            // Nobody asked for it.
            if requests.unanswered() == 0 {
                return Err(Fault::Garbled);
            }
            let Some(sent_deg) = replies.take(byte)? else { return Ok(None) };
            Ok(requests.answered().map(|asked_at| (sent_deg, asked_at)))
        })?;
        if let Some((sent_deg, asked_at)) = newest {
            let passed = between(asked_at - self.asked_at, self.quiet_periods);
            self.renew(sent_deg, passed as f64 * self.period_s)?;
            self.quiet_periods = 0;
            self.asked_at = asked_at;
        }
        if self.quiet_periods > self.silence_periods { Err(Fault::Silent) } else { Ok(()) }
    }

    /// τ = Jᵀ F, when the last request is answered, or the arm is lost.
    fn send(&mut self) -> Result<(), Fault> {
        if self.drain.is_on() {
            return self.drain.tell(&mut self.line, &wire::request(self.settings.device_id, [0.0; 2]));
        }
        if self.requests.unanswered() > 0 && self.lost.is_none() {
            return Ok(());
        }
        // One that was not sent is not on its way: the next tick tries again, with what is to be felt then.
        if self.line.send(&wire::request(self.settings.device_id, self.sent_nm()))? {
            self.requests.made();
        }
        Ok(())
    }

    fn sent_nm(&self) -> [f32; 2] {
        self.settings.sent_nm(self.share.now() * (self.jacobian_m_per_rad.transpose() * self.force_n))
    }

    fn lose(&mut self, fault: Fault) -> Fault {
        *self.lost.get_or_insert(fault)
    }
}

fn set_up_board(line: &mut Line, settings: &Settings) -> Result<(), Fault> {
    let id = settings.device_id;
    let setup = wire::setup(id, settings.swapped(settings.axes));
    for message in [&[wire::RESET, id][..], &setup, &wire::request(id, [0.0; 2])] {
        // None without the one before.
        if !line.send_in_turn(message, IN_TURN)? {
            break;
        }
    }
    Ok(())
}

impl Arm for Haply2diy {
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        if let Some(fault) = self.lost {
            return Err(fault);
        }
        self.requests.pass(periods);
        self.quiet_periods = self.quiet_periods.saturating_add(periods);
        let taken = if self.drain.is_on() { self.drop_answers() } else { self.receive() };
        taken.map_err(|fault| self.lose(fault))?;
        let age_s = (self.requests.now() - self.asked_at) as f64 * self.period_s;
        Ok(Reading {
            motion: extrapolate(&self.motion, age_s, LONGEST_EXTRAPOLATION_S),
            buttons: 0,
            measured_force_n: None,
            age_s,
            force_share: self.drain.force_share(),
        })
    }

    /// A lost arm is still told to let go, should it hear.
    fn apply(&mut self, effort: &Effort) {
        self.force_n = effort.unless(self.lost.is_some()).force_n.xy();
        if let Err(fault) = self.send() {
            self.lose(fault);
        }
    }

    fn last_words(&self) -> Option<LastWords> {
        self.line.last_words(wire::request(self.settings.device_id, [0.0; 2]).to_vec())
    }

    fn last_words_were_said(&mut self) {
        self.lost = self.lost.filter(|fault| !fault.may_be_misheard());
        self.drain.begin(self.silence_periods);
    }
}

impl Drop for Haply2diy {
    /// Takes the torques away.
    fn drop(&mut self) {
        let _ = self.line.send_in_turn(&wire::request(self.settings.device_id, [0.0; 2]), FAREWELL);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        config::Haply2diyConfig,
        device::{noise::Pair, serial::Buffers},
        emulate::haply_2diy as emulator,
        settings::arm,
    };
    use palpate_control::{ArmSpec, HandPath};

    /// As if each were asked for: poses that are numbers, or a fault by its name, and nothing else.
    #[test]
    fn a_million_random_bytes_are_poses_or_garbled() {
        let mut pair = Pair::new();
        let keys = Haply2diyConfig { port: pair.path.clone(), ..Haply2diyConfig::default() };
        let settings = arm::haply_2diy::checked(&keys).unwrap();
        let answer = wire::reply(settings.device_id, [12.0, 168.0]);
        let mut arm = pair.starting(&answer, || Haply2diy::start(&settings, 1e-3)).unwrap();
        let (mut readings, mut faults) = (0, 0);
        pair.feed(&answer, || {
            arm.requests.made();
            arm.lost = None;
            match arm.read(1) {
                Ok(reading) => {
                    assert!(reading.motion.is_finite());
                    readings += 1;
                }
                Err(fault) => {
                    assert_eq!(fault, Fault::Garbled);
                    arm.line.forget().unwrap();
                    arm.replies = Replies::new(settings.device_id);
                    faults += 1;
                }
            }
            arm.quiet_periods = 0;
            arm.apply(&Effort::force(DVec3::ONE));
        });
        assert!(faults > 1000 && readings > 1000, "{faults} {readings}");
    }

    fn emulated() -> (emulator::Haply2diy, Settings) {
        let keys = Haply2diyConfig { max_torque_nm: 0.4, silence_s: 10.0, ..Haply2diyConfig::default() };
        let constants = arm::haply_2diy::checked(&keys).unwrap();
        let path = HandPath::resting_at(DVec3::ZERO);
        let held = ArmSpec::default();
        let settings = emulator::Settings { constants, knows_home: true, watchdog: None, arm: held, path };
        let emulated = emulator::Haply2diy::start(settings).unwrap();
        let keys = Haply2diyConfig { port: emulated.port().to_owned(), ..keys };
        (emulated, arm::haply_2diy::checked(&keys).unwrap())
    }

    fn until(what: &str, mut done: impl FnMut() -> bool) {
        let began = Instant::now();
        while !done() {
            assert!(began.elapsed() < Duration::from_secs(20), "waited in vain until {what}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// A USB CDC line counts each message as a buffer of 10240 bytes for as long as it is on its way: the second and third were taken for too much, at every try.
    #[test]
    fn a_board_on_a_usb_cdc_line_is_set_up() {
        let (emulated, settings) = emulated();
        let mut line = Line::open(&settings.port, settings.baud).unwrap();
        line.buffers = Some(Buffers::new(10_240, Duration::from_millis(3)));
        set_up_board(&mut line, &settings).unwrap();
        let since = &line.buffers.as_ref().unwrap().since;
        assert!(since.len() == 3 && since.windows(2).all(|pair| pair[1] - pair[0] >= Duration::from_millis(3)));
        let mut replies = Replies::new(settings.device_id);
        until("it answers", || line.newest(|byte| replies.take(byte)).unwrap().is_some());
        assert_eq!(emulated.requests(), 1);
    }

    /// The law's ramp ran on while nothing was asked of the arm, and the whole force came at once behind it.
    #[test]
    fn after_a_guard_spoke_there_is_no_force_until_the_line_is_quiet() {
        let (emulated, settings) = emulated();
        let settings = Settings { silence: Duration::from_millis(100), ..settings };
        let mut arm = Haply2diy::start(&settings, 1e-3).unwrap();
        // Somebody else asks, and what comes is garbage to this driver.
        arm.line.send(&wire::request(settings.device_id, [0.0; 2])).unwrap();
        arm.lost = Some(Fault::Garbled);
        arm.last_words_were_said();
        let mut shares = Vec::new();
        for _ in 0..400 {
            shares.push(arm.read(1).unwrap().force_share);
            arm.apply(&Effort::force(DVec3::X * shares[shares.len() - 1]));
            std::thread::sleep(Duration::from_millis(1));
        }
        let none = shares.iter().take_while(|share| **share == 0.0).count();
        assert!((100..300).contains(&none) && shares[none..].iter().all(|share| *share == 1.0), "{none}");
        until("it has the newest force", || emulated.force_n().distance(DVec3::X) < 0.05);
    }

    #[test]
    fn a_request_that_is_not_sent_is_not_on_its_way_and_the_next_tick_sends_the_newest_force() {
        let (emulated, settings) = emulated();
        let mut arm = Haply2diy::start(&settings, 1e-3).unwrap();
        let full = || {
            let mut buffers = Buffers::new(10_240, Duration::from_millis(30));
            buffers.since = vec![Instant::now() + Duration::from_secs(1000); 4];
            Some(buffers)
        };
        let tick = |arm: &mut Haply2diy, force_n: DVec3| {
            arm.read(1).unwrap();
            arm.apply(&Effort::force(force_n));
        };
        arm.line.buffers = full();
        for refused in 1..4 {
            tick(&mut arm, DVec3::Y);
            assert_eq!((arm.requests.unanswered(), arm.line.refused_in_row()), (0, refused));
        }
        arm.line.buffers = None;
        tick(&mut arm, DVec3::X);
        assert_eq!((arm.requests.unanswered(), arm.line.refused_in_row()), (1, 0));
        until("it has the newest force", || emulated.force_n().distance(DVec3::X) < 0.05);
        // Not listening for a moment when it ends.
        arm.line.buffers = full();
        arm.line.buffers.as_mut().unwrap().since = vec![Instant::now(); 4];
        drop(arm);
        until("it lets go", || emulated.force_n() == DVec3::ZERO);
    }

    #[test]
    fn where_the_outer_links_were_in_line_the_force_comes_back_slowly() {
        let mut pair = Pair::new();
        // Inner links on the x axis make it 180 mm from elbow to elbow: all that the outer ones reach.
        let keys = Haply2diyConfig { port: pair.path.clone(), base_m: 0.04, ..Haply2diyConfig::default() };
        let settings = arm::haply_2diy::checked(&keys).unwrap();
        let answer = wire::reply(settings.device_id, [12.0, 168.0]);
        let mut arm = pair.starting(&answer, || Haply2diy::start(&settings, 1e-3)).unwrap();
        arm.force_n = DVec2::new(0.2, 0.5);
        let whole_nm = arm.sent_nm();
        assert!(whole_nm.iter().all(|nm| nm.abs() > 1e-3), "{whole_nm:?}");
        arm.renew([0.0, 180.0], 1e-3).unwrap();
        assert_eq!(arm.sent_nm(), [0.0; 2]);
        for frame in 1..=50 {
            arm.renew([12.0, 168.0], 1e-3).unwrap();
            for (now_nm, whole_nm) in arm.sent_nm().iter().zip(whole_nm) {
                assert!((now_nm / whole_nm - 0.02 * frame as f32).abs() < 1e-5, "{now_nm} of {whole_nm}");
            }
        }
    }
}
