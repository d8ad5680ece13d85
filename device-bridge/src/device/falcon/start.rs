//! Bringing a Falcon from whatever state it is in to one in which it knows where it is. Waits for it, so never in the loop.
use super::{
    BAUD, Settings, firmware,
    wire::{self, Frame, Frames},
};
use crate::device::{
    Fault,
    serial::{Line, OpenError},
};
use std::time::{Duration, Instant};
use thiserror::Error;
use tokio_util::sync::CancellationToken;

/// How long a firmware that runs may take to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// Between two frames to an arm that is not started.
const ASK_EVERY: Duration = Duration::from_millis(5);

/// An arm that knows where it is: its torques are zero.
#[derive(Debug)]
pub struct Started {
    /// The connection.
    pub line: Line,
    /// In step with its frames.
    pub frames: Frames,
    /// The newest.
    pub frame: Frame,
}

/// Why an arm could not be started.
#[derive(Debug, Error)]
pub enum StartError {
    /// No port.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// Nobody answers, and there is nothing to load.
    #[error(
        "no firmware answers at {path}: give its file as `firmware` of [device] (docs/arms/falcon.md), and see that the arm has power"
    )]
    NoFirmware {
        /// The port.
        path: String,
    },
    /// It was not loaded.
    #[error(transparent)]
    Load(#[from] firmware::LoadError),
    /// It was loaded, and does not run.
    #[error("the firmware {file} was loaded, and does not answer at {path} within {} s: is it a Falcon's?", PATIENCE.as_secs())]
    Dead {
        /// The file.
        file: String,
        /// The port.
        path: String,
    },
    /// Something else.
    #[error("{path}: {fault}; is it this arm's port?")]
    Strange {
        /// The port.
        path: String,
        /// What went wrong.
        fault: Fault,
    },
    /// Nobody showed it its home.
    #[error("it was not shown its home within {seconds} s: pull its grip all the way out, then push it all the way in")]
    NotHome {
        /// How long it was waited for.
        seconds: f64,
    },
    /// Counts that no Falcon has.
    #[error(
        "{path}: its counts are {counts:?}, which no Falcon has: pull its grip all the way out, then push it all the way in, and start again"
    )]
    Impossible {
        /// The port.
        path: String,
        /// What it says.
        counts: [i16; 3],
    },
    /// Somebody stopped the start.
    #[error("its start was stopped")]
    Stopped,
}

/// Opens the port, loads the firmware if none runs, and waits until the arm knows its home.
///
/// # Errors
/// [`StartError`].
pub fn start(settings: &Settings, stop: &CancellationToken) -> Result<Started, StartError> {
    let path = settings.port.clone();
    let mut talk = Talk { line: Line::open(&path, BAUD)?, frames: Frames::default(), path };
    let mut frame = talk.first_frame(stop)?;
    if frame.is_none() {
        let path = talk.path.clone();
        let file = settings.firmware.as_ref().ok_or(StartError::NoFirmware { path })?;
        firmware::load(&mut talk.line, &talk.path, file, stop)?;
        tracing::info!("the Falcon at {} has the firmware {}", talk.path, file.display());
        frame = talk.first_frame(stop)?;
        if frame.is_none() {
            return Err(StartError::Dead { file: file.display().to_string(), path: talk.path });
        }
    }
    let frame = talk.home(settings.homing, stop)?;
    Ok(Started { line: talk.line, frames: talk.frames, frame })
}

struct Talk {
    line: Line,
    frames: Frames,
    path: String,
}

impl Talk {
    /// The answer of a firmware that runs. Without one the chip may say anything.
    fn first_frame(&mut self, stop: &CancellationToken) -> Result<Option<Frame>, StartError> {
        let began = Instant::now();
        while began.elapsed() < PATIENCE {
            match self.ask(wire::HOMING | wire::BLUE, stop) {
                Ok(None) => {}
                Err(StartError::Strange { fault: Fault::Garbled, .. }) => self.frames = Frames::default(),
                found => return found,
            }
        }
        self.line.forget().map_err(|fault| self.strange(fault))?;
        self.frames = Frames::default();
        Ok(None)
    }

    fn home(&mut self, patience: Duration, stop: &CancellationToken) -> Result<Frame, StartError> {
        let (began, mut is_told) = (Instant::now(), false);
        loop {
            let frame = self.ask(wire::HOMING | wire::RED, stop)?;
            if let Some(frame) = frame.filter(|frame| frame.flags & wire::HOMED == wire::HOMED) {
                return Ok(frame);
            }
            if frame.is_some() && !std::mem::replace(&mut is_told, true) {
                tracing::warn!("show the Falcon its home: pull its grip all the way out, then push it all the way in");
            }
            if began.elapsed() > patience {
                return Err(StartError::NotHome { seconds: patience.as_secs_f64() });
            }
        }
    }

    fn ask(&mut self, flags: u8, stop: &CancellationToken) -> Result<Option<Frame>, StartError> {
        if stop.is_cancelled() {
            return Err(StartError::Stopped);
        }
        let asked = self.line.send(&Frame { numbers: [0; 3], flags }.bytes());
        std::thread::sleep(ASK_EVERY);
        let frames = &mut self.frames;
        let answer = asked.and_then(|_| self.line.newest(|byte| frames.take(byte)));
        answer.map_err(|fault| self.strange(fault))
    }

    fn strange(&self, fault: Fault) -> StartError {
        StartError::Strange { path: self.path.clone(), fault }
    }
}
