//! From a name to an arm whose frames come: library, device, limits, scheduler, calibration.
use super::{
    Settings,
    ffi::{self, Device, Hd, LoadError, Scheduled},
    frame::{CALIBRATED, ENCODER_RESET, Frame, Guard, NEEDS_HAND, NEEDS_UPDATE, Pose, Shared},
    limits::Limits,
};
use crate::device::{Effort, Fault};
use palpate_realtime::{SlotReader, SlotWriter, slot};
use std::{
    ffi::CString,
    sync::{Arc, atomic::Ordering},
    time::{Duration, Instant},
};
use thiserror::Error;
use tokio_util::sync::CancellationToken;

/// `HD_CALIBRATION_AUTO`.
const AUTO: u32 = 1 << 1;
/// `HD_CALIBRATION_INKWELL`.
const INKWELL: u32 = 1 << 2;

/// How long the first frame may take.
const PATIENCE: Duration = Duration::from_secs(5);
/// How long the last one, without force, is waited for.
const FAREWELL: Duration = Duration::from_millis(300);
/// How often something is looked for while waiting.
const LOOK_EVERY: Duration = Duration::from_millis(1);
/// More errors than this are not left over from a start.
const MOST_ERRORS: usize = 64;

/// Why the arm could not be started.
#[derive(Debug, Error)]
pub enum StartError {
    /// No library.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The name has a zero in it.
    #[error("device.name: \"{0}\" holds a character that no name has")]
    Name(String),
    /// HD says no.
    #[error("cannot {what}: {text} (HD error {code:#06x})")]
    Hd {
        /// What.
        what: String,
        /// HD's code.
        code: u32,
        /// HD's words.
        text: String,
    },
    /// More force than the arm has.
    #[error(
        "limits.max_force_n: {asked_n} N is more than this arm gives: {max_n} N at most ({model}), {continuous} for ever (limits.continuous_force_n)"
    )]
    Force {
        /// Configured (N).
        asked_n: f64,
        /// The arm's (N).
        max_n: f64,
        /// What it bears for ever.
        continuous: String,
        /// The arm's model.
        model: String,
    },
    /// Nothing comes.
    #[error("no frame came from HD's scheduler within {} s: is the arm switched on, and does no other program use it?", PATIENCE.as_secs())]
    Silent,
    /// Not calibrated.
    #[error("the arm is not calibrated: {todo}")]
    Uncalibrated {
        /// What to do.
        todo: String,
    },
    /// It failed at once.
    #[error("{fault} (HD error {code:#06x})")]
    Failed {
        /// What it means.
        fault: Fault,
        /// HD's code.
        code: u32,
    },
    /// Told to stop.
    #[error("told to stop before the arm was calibrated")]
    Stopped,
}

/// An arm in use. Dropped, it is without force and no longer so.
#[derive(Debug)]
pub struct Session {
    hd: Hd,
    device: Device,
    scheduled: Option<Scheduled>,
    /// Flags of its frames.
    pub shared: Arc<Shared>,
}

impl Drop for Session {
    /// One more frame without force, since HD keeps the last one's; then the scheduler, then the device.
    fn drop(&mut self) {
        let said = self.shared.error();
        if let Some(scheduled) = self.scheduled {
            self.shared.leave.store(true, Ordering::Relaxed);
            let _ = wait_until(Instant::now() + FAREWELL, || self.shared.left.load(Ordering::Relaxed));
            self.hd.stop_scheduler();
            self.hd.unschedule(scheduled);
        }
        self.hd.disable_device(self.device);
        if let Some(code) = said {
            tracing::warn!("HD error {code:#06x}: {}", self.hd.error_text(code));
        }
        drop_errors(self.hd);
    }
}

/// An arm whose frames come.
#[derive(Debug)]
pub struct Started {
    /// Its use.
    pub session: Session,
    /// Newest poses.
    pub poses: SlotReader<Option<Pose>>,
    /// Newest efforts.
    pub efforts: SlotWriter<Effort>,
    /// The first pose.
    pub pose: Pose,
    /// What it says of itself.
    pub limits: Limits,
}

/// Starts the arm, and waits until somebody has put it into its inkwell if it asks for that. Blocks until told to stop.
///
/// # Errors
/// [`StartError`].
pub fn start(settings: &Settings, stop: &CancellationToken) -> Result<Started, StartError> {
    let hd = Hd::load(&settings.libraries)?;
    drop_errors(hd);
    let mut session = init(hd, settings)?;
    let model = hd.text(ffi::MODEL);
    let turns = settings.torque && hd.integer(ffi::OUTPUT_DOF) == 6;
    let limits = Limits::read(hd, turns);
    tracing::info!("{model}: {limits}");
    limits.check(settings, &model)?;
    if turns && limits.max_torque_nm.is_none() {
        tracing::warn!("HD does not know this arm's peak torque: it is given none");
    }
    hd.enable(ffi::FORCE_OUTPUT);
    checked(hd, "switch its force on")?;
    hd.set_scheduler_rate(settings.rate_hz);
    if hd.error().is_some() {
        tracing::warn!("HD's scheduler does not know {} Hz: it keeps its own rate", settings.rate_hz);
    }
    let styles = hd.integer(ffi::CALIBRATION_STYLE).cast_unsigned();
    drop_errors(hd);
    if settings.reset_encoders {
        hd.update_calibration(ENCODER_RESET);
        checked(hd, "reset its encoders")?;
    }
    let (poses_in, poses) = slot(&None);
    let (efforts, efforts_out) = slot(&Effort::NONE);
    let guard = Guard::new(settings.max_force_n, limits.max_torque_nm.unwrap_or(0.0));
    let shared = Arc::clone(&session.shared);
    shared.calibrating.store(style(styles), Ordering::Relaxed);
    let frame = Frame { hd, device: session.device, turns, guard, poses: poses_in, efforts: efforts_out, shared };
    session.scheduled = Some(hd.schedule(frame));
    checked(hd, "schedule its frames")?;
    hd.start_scheduler();
    let mut poses = poses;
    let pose = first_pose(&session, &mut poses)?;
    calibrate(&session.shared, styles, settings.calibration, stop)?;
    Ok(Started { session, poses, efforts, pose, limits })
}

fn init(hd: Hd, settings: &Settings) -> Result<Session, StartError> {
    let name = (!settings.name.is_empty()).then(|| CString::new(settings.name.as_str())).transpose();
    let name = name.map_err(|_| StartError::Name(settings.name.escape_debug().to_string()))?;
    let device = hd.init_device(name.as_deref());
    let what = match name {
        Some(_) => format!("use the arm \"{}\"", settings.name),
        None => "use the default arm".to_owned(),
    };
    let Some(device) = device else {
        checked(hd, &what)?;
        return Err(StartError::Hd { what, code: 0, text: "HD gives no handle".to_owned() });
    };
    let session = Session { hd, device, scheduled: None, shared: Arc::default() };
    checked(hd, &what)?;
    Ok(session)
}

fn first_pose(session: &Session, poses: &mut SlotReader<Option<Pose>>) -> Result<Pose, StartError> {
    let mut first = None;
    wait_until(Instant::now() + PATIENCE, || {
        first = *poses.newest();
        first.is_some() || session.shared.error().is_some()
    });
    failed(&session.shared)?;
    first.ok_or(StartError::Silent)
}

/// Waits while frames calibrate the arm; says once what to do for it.
fn calibrate(shared: &Shared, styles: u32, patience: Duration, stop: &CancellationToken) -> Result<(), StartError> {
    let deadline = Instant::now() + patience;
    let mut said = false;
    while style(styles) != 0 {
        failed(shared)?;
        match shared.calibration.load(Ordering::Relaxed) {
            CALIBRATED => break,
            _ if stop.is_cancelled() => return Err(StartError::Stopped),
            _ if styles & (AUTO | INKWELL) == 0 || Instant::now() >= deadline => {
                return Err(StartError::Uncalibrated { todo: todo(styles).to_owned() });
            }
            NEEDS_HAND if !said => {
                tracing::warn!("the arm is to be calibrated: {}", todo(styles));
                said = true;
            }
            0 | NEEDS_HAND | NEEDS_UPDATE => std::thread::sleep(LOOK_EVERY),
            strange => return Err(StartError::Uncalibrated { todo: format!("HD says {strange:#06x} of it") }),
        }
    }
    shared.calibrating.store(0, Ordering::Relaxed);
    Ok(())
}

/// The best of those that the arm has, as HD's own examples choose.
fn style(styles: u32) -> u32 {
    [AUTO, INKWELL, ENCODER_RESET].into_iter().find(|style| styles & style != 0).unwrap_or(0)
}

fn todo(styles: u32) -> &'static str {
    match style(styles) {
        AUTO => "move it to and fro through its whole workspace",
        INKWELL => "put its stylus into the inkwell and leave it there",
        _ => {
            "hold it in its reset position, all links at right angles, and start with device.reset_encoders = true, once after it was switched on"
        }
    }
}

fn failed(shared: &Shared) -> Result<(), StartError> {
    match shared.error() {
        Some(code) => Err(StartError::Failed { fault: super::frame::fault(code), code }),
        None => Ok(()),
    }
}

/// The oldest error there is, if any.
fn checked(hd: Hd, what: &str) -> Result<(), StartError> {
    match std::iter::from_fn(|| hd.error()).take(MOST_ERRORS).last() {
        Some(code) => Err(StartError::Hd { what: what.to_owned(), code, text: hd.error_text(code) }),
        None => Ok(()),
    }
}

pub(super) fn drop_errors(hd: Hd) {
    std::iter::from_fn(|| hd.error()).take(MOST_ERRORS).for_each(drop);
}

fn wait_until(deadline: Instant, mut condition: impl FnMut() -> bool) -> bool {
    loop {
        if condition() {
            return true;
        }
        if Instant::now() >= deadline {
            return false;
        }
        std::thread::sleep(LOOK_EVERY);
    }
}
