//! A PHANToM that is not there, behind the library that stands in libHD's place (`tests/mock-libhd`): what hardware is to the real one. They talk over a Unix socket, in lines of text,
//! frame by frame; the library says which.
use super::{Faults, Running, Shared};
use glam::{DMat3, DQuat, DVec3};
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use std::{
    fmt::Write as _,
    io::{BufRead as _, BufReader, ErrorKind, Write as _},
    os::unix::net::{UnixListener, UnixStream},
    path::{Path, PathBuf},
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};

/// Step of its motion (s).
const STEP_S: f64 = 1e-3;
/// Without a force for so long its motors are off.
const PATIENCE: Duration = Duration::from_millis(500);
/// How often it looks whether somebody comes, or it is over.
const LOOK_EVERY: Duration = Duration::from_millis(5);

/// `HD_CALIBRATION_AUTO`, `HD_CALIBRATION_INKWELL`, `HD_CALIBRATION_ENCODER_RESET`.
const STYLES: [u32; 3] = [2, 4, 1];
/// `HD_CALIBRATION_OK`, `…_NEEDS_UPDATE`, `…_NEEDS_MANUAL_INPUT`.
const CALIBRATED: u32 = 0x5000;
const NEEDS_UPDATE: u32 = 0x5001;
const NEEDS_HAND: u32 = 0x5002;

/// How it comes to know where it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Calibration {
    /// It knows.
    Done,
    /// Once it was moved for so many frames.
    Auto {
        /// Frames until then.
        frames: u64,
    },
    /// Once somebody has put it into its inkwell, after so many frames.
    Inkwell {
        /// Frames until then.
        frames: u64,
    },
    /// Once its encoders are reset.
    EncoderReset,
}

/// What it is, and who holds it.
#[derive(Debug, Clone)]
pub struct Settings {
    /// It has motors for torque.
    pub turns: bool,
    /// How it is calibrated.
    pub calibration: Calibration,
    /// Peak force, and what its motors bear for ever (N).
    pub forces_n: (f64, f64),
    /// How it is turned; its tool does not turn.
    pub orientation: DQuat,
    /// Bits of its buttons.
    pub buttons: i32,
    /// Mass, friction and hand.
    pub arm: ArmSpec,
    /// Where the hand goes (m, the arm's axes), from the first frame on.
    pub path: HandPath,
}

impl Default for Settings {
    /// A Touch at rest.
    fn default() -> Self {
        Self {
            turns: false,
            calibration: Calibration::Done,
            forces_n: (3.3, 0.88),
            orientation: DQuat::IDENTITY,
            buttons: 0,
            arm: ArmSpec::default(),
            path: HandPath::resting_at(DVec3::ZERO),
        }
    }
}

/// It runs until dropped.
#[derive(Debug)]
pub struct Phantom {
    socket: PathBuf,
    /// What it does wrong.
    pub faults: Arc<Faults>,
    shared: Shared<Machine>,
    _running: Running,
}

impl Phantom {
    /// Listens there, with a thread of its own, in the place of another socket only.
    ///
    /// # Errors
    /// When the place is taken, or its constants are out of range.
    pub fn listen(socket: &Path, settings: Settings) -> std::io::Result<Self> {
        if std::fs::symlink_metadata(socket)
            .is_ok_and(|there| std::os::unix::fs::FileTypeExt::is_socket(&there.file_type()))
        {
            std::fs::remove_file(socket)?;
        }
        let listener = UnixListener::bind(socket)?;
        listener.set_nonblocking(true)?;
        let machine = Machine::new(settings).map_err(|error| std::io::Error::new(ErrorKind::InvalidInput, error))?;
        let shared = Shared::new(machine);
        let served = shared.clone();
        let running = Running::start("phantom", &shared.stop, move || serve(&listener, &served))?;
        Ok(Self { socket: socket.to_owned(), faults: Arc::clone(&shared.faults), shared, _running: running })
    }

    /// Its name for the library.
    pub fn socket(&self) -> &Path {
        &self.socket
    }

    /// Force (N, its axes) of its motors now.
    pub fn force_n(&self) -> DVec3 {
        let mut machine = self.shared.machine();
        machine.go_on();
        machine.force_n
    }

    /// Torque (N m, its axes) of its motors now.
    pub fn torque_nm(&self) -> DVec3 {
        self.shared.machine().torque_nm
    }

    /// Where it is (m, its own axes).
    pub fn position_m(&self) -> DVec3 {
        self.shared.machine().arm.motion().position_m
    }

    /// Frames that it saw.
    pub fn frames(&self) -> u64 {
        self.shared.machine().frames
    }

    /// Styles in which it was calibrated.
    pub fn calibrated(&self) -> Vec<u32> {
        self.shared.machine().calibrated.clone()
    }

    /// What force (N) the last library left on it when it went.
    pub fn left_with_n(&self) -> Option<f64> {
        self.shared.machine().left_with_n
    }

    /// The largest force (N) since it was switched on.
    pub fn peak_n(&self) -> f64 {
        self.shared.machine().peak_n
    }
}

impl Drop for Phantom {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.socket);
    }
}

/// One library after another.
fn serve(listener: &UnixListener, shared: &Shared<Machine>) {
    while !Faults::is(&shared.stop) {
        match listener.accept() {
            // A library that has gone is no matter.
            Ok((stream, _)) if !shared.is_over() => {
                let _ = talk(stream, shared);
                shared.machine().let_go();
            }
            _ => std::thread::sleep(LOOK_EVERY),
        }
    }
}

fn talk(stream: UnixStream, shared: &Shared<Machine>) -> std::io::Result<()> {
    stream.set_nonblocking(false)?;
    stream.set_read_timeout(Some(LOOK_EVERY))?;
    let mut says = stream.try_clone()?;
    says.write_all(shared.machine().greeting().as_bytes())?;
    let mut hears = BufReader::new(stream);
    let mut line = String::new();
    while !shared.is_over() {
        match hears.read_line(&mut line) {
            Ok(0) => return Ok(()),
            Ok(_) => {}
            // What has come of the line stays in it.
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => continue,
            Err(error) => return Err(error),
        }
        let (word, rest) = line.trim_end().split_once(' ').unwrap_or((line.trim_end(), ""));
        match word {
            "frame" => answer(&mut says, shared)?,
            "force" => shared.machine().obey(rest),
            "calibrate" => shared.machine().calibrate(rest),
            _ => return Err(ErrorKind::InvalidData.into()),
        }
        line.clear();
    }
    Ok(())
}

fn answer(says: &mut UnixStream, shared: &Shared<Machine>) -> std::io::Result<()> {
    let faults = &shared.faults;
    std::thread::sleep(Duration::from_micros(faults.slow_us.load(Ordering::Relaxed).into()));
    while Faults::is(&faults.silence) && !shared.is_over() {
        std::thread::sleep(LOOK_EVERY);
    }
    let state = shared.machine().state(Faults::is(&faults.garbage), faults.error_code.load(Ordering::Relaxed));
    says.write_all(state.as_bytes())
}

#[derive(Debug)]
struct Machine {
    settings: Settings,
    arm: SimulatedArm,
    force_n: DVec3,
    torque_nm: DVec3,
    peak_n: f64,
    left_with_n: Option<f64>,
    heard: Option<Instant>,
    began: Option<Instant>,
    steps: u64,
    frames: u64,
    /// Styles in which it was calibrated.
    calibrated: Vec<u32>,
}

impl Machine {
    fn new(settings: Settings) -> Result<Self, ParameterError> {
        Ok(Self {
            arm: SimulatedArm::new(settings.arm, settings.path.clone(), STEP_S)?,
            force_n: DVec3::ZERO,
            torque_nm: DVec3::ZERO,
            peak_n: 0.0,
            left_with_n: None,
            heard: None,
            began: None,
            steps: 0,
            frames: 0,
            calibrated: Vec::new(),
            settings,
        })
    }

    /// What does not change: model, degrees of freedom, style, limits (N/mm, N, mm/s, mN m).
    fn greeting(&self) -> String {
        let Settings { turns, forces_n: (peak_n, continuous_n), .. } = self.settings;
        let dof = if turns { 6 } else { 3 };
        let [auto, inkwell, reset] = STYLES;
        let style = match self.settings.calibration {
            Calibration::Done => auto | inkwell,
            Calibration::Auto { .. } => auto,
            Calibration::Inkwell { .. } => inkwell,
            Calibration::EncoderReset => reset,
        };
        let mut text = format!("text 2501 emulated PHANToM\n2554 {dof}\n2555 {style}\n");
        let _ = writeln!(text, "2602 0.5\n2603 {peak_n}\n2604 {continuous_n}\n2606 1200\n2607 4");
        if turns {
            let _ = writeln!(text, "2622 188");
        }
        text + ".\n"
    }

    fn state(&mut self, garbage: bool, error: u32) -> String {
        self.began.get_or_insert_with(Instant::now);
        self.go_on();
        self.frames += 1;
        let motion = self.arm.motion();
        let p = motion.position_m * 1e3;
        let v = motion.velocity_m_per_s * 1e3;
        let m = DMat3::from_quat(self.settings.orientation) * if garbage { 2.0 } else { 1.0 };
        let mut text = format!("2050 {} {} {}\n2051 {} {} {}\n2053 0 0 0\n", p.x, p.y, p.z, v.x, v.y, v.z);
        let (a, b, c) = (m.x_axis, m.y_axis, m.z_axis);
        let _ = writeln!(
            text,
            "2052 {} {} {} 0 {} {} {} 0 {} {} {} 0 {} {} {} 1",
            a.x, a.y, a.z, b.x, b.y, b.z, c.x, c.y, c.z, p.x, p.y, p.z
        );
        let _ = writeln!(text, "2000 {}\ncalibration {:x}", self.settings.buttons, self.calibration());
        if error != 0 {
            let _ = writeln!(text, "raise {error:x}");
        }
        text + ".\n"
    }

    fn calibration(&self) -> u32 {
        match self.settings.calibration {
            Calibration::Auto { frames } | Calibration::Inkwell { frames } if self.calibrated.is_empty() => {
                if self.frames < frames { NEEDS_HAND } else { NEEDS_UPDATE }
            }
            Calibration::EncoderReset if self.calibrated.is_empty() => NEEDS_HAND,
            _ => CALIBRATED,
        }
    }

    fn calibrate(&mut self, style: &str) {
        self.calibrated.extend(style.parse::<u32>());
    }

    /// Force (N) and torque (mN m).
    fn obey(&mut self, numbers: &str) {
        self.go_on();
        let numbers: Vec<f64> = numbers.split(' ').filter_map(|word| word.parse().ok()).collect();
        if let [x, y, z, a, b, c] = numbers[..] {
            self.force_n = DVec3::new(x, y, z);
            self.torque_nm = DVec3::new(a, b, c) * 1e-3;
            self.peak_n = self.peak_n.max(self.force_n.length());
            self.heard = Some(Instant::now());
        }
    }

    fn let_go(&mut self) {
        self.left_with_n = Some(self.force_n.length());
        self.heard = None;
        self.go_on();
    }

    fn go_on(&mut self) {
        if self.heard.is_none_or(|heard| heard.elapsed() > PATIENCE) {
            (self.force_n, self.torque_nm) = (DVec3::ZERO, DVec3::ZERO);
        }
        let Some(began) = self.began else { return };
        let due = (began.elapsed().as_secs_f64() / STEP_S) as u64;
        while self.steps < due {
            self.arm.step(self.force_n);
            self.steps += 1;
        }
    }
}
