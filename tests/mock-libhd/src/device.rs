//! The one device, and the stack of errors.
use crate::{
    arm::{Connection, Said},
    hd,
};
use std::{
    collections::{HashMap, HashSet},
    ffi::{CStr, CString, c_char},
    sync::{Mutex, MutexGuard, PoisonError},
};

/// The one handle there is.
pub(crate) const HANDLE: u32 = 0;
/// More errors are not kept.
const MOST_ERRORS: usize = 64;

/// What all functions share.
#[derive(Debug)]
pub(crate) struct Library {
    pub(crate) device: Option<Device>,
    pub(crate) errors: Vec<u32>,
}

static LIBRARY: Mutex<Library> = Mutex::new(Library { device: None, errors: Vec::new() });

pub(crate) fn library() -> MutexGuard<'static, Library> {
    LIBRARY.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Library {
    pub(crate) fn raise(&mut self, code: u32) {
        if self.errors.len() < MOST_ERRORS {
            self.errors.push(code);
        }
    }

    pub(crate) fn with_device(&mut self, act: impl FnOnce(&mut Device) -> std::io::Result<()>) {
        match self.device.as_mut().map(act) {
            Some(Ok(())) => {}
            Some(Err(_)) => self.raise(hd::COMM_ERROR),
            None => self.raise(hd::INVALID_OPERATION),
        }
    }

    pub(crate) fn begin_frame(&mut self, handle: u32) {
        match &mut self.device {
            Some(device) if handle == HANDLE && !device.in_frame => {
                device.in_frame = true;
                let raised = device.refresh();
                match raised {
                    Ok(codes) => codes.into_iter().for_each(|code| self.raise(code)),
                    Err(_) => self.raise(hd::COMM_ERROR),
                }
            }
            Some(_) if handle == HANDLE => self.raise(hd::ILLEGAL_BEGIN),
            _ => self.raise(hd::BAD_HANDLE),
        }
    }

    pub(crate) fn end_frame(&mut self, handle: u32) {
        match &mut self.device {
            Some(device) if handle == HANDLE && device.in_frame => {
                device.in_frame = false;
                if device.is_too_strong() {
                    device.effort = [0.0; 6];
                    self.raise(hd::EXCEEDED_MAX_FORCE);
                }
                self.with_device(Device::send_effort);
            }
            Some(_) if handle == HANDLE => self.raise(hd::ILLEGAL_END),
            _ => self.raise(hd::BAD_HANDLE),
        }
    }

    pub(crate) fn set_enabled(&mut self, capability: u32, enabled: bool) {
        match &mut self.device {
            Some(device) if enabled => drop(device.enabled.insert(capability)),
            Some(device) => drop(device.enabled.remove(&capability)),
            None => self.raise(hd::INVALID_OPERATION),
        }
    }

    /// None, and an error, for a parameter that there is not.
    pub(crate) fn numbers(&mut self, parameter: u32) -> Vec<f64> {
        let found = self.device.as_ref().and_then(|device| device.numbers.get(&parameter)).cloned();
        found.unwrap_or_else(|| {
            self.raise(hd::INVALID_ENUM);
            Vec::new()
        })
    }

    pub(crate) fn text(&mut self, parameter: u32) -> *const c_char {
        if let Some(text) = self.device.as_ref().and_then(|device| device.texts.get(&parameter)) {
            return text.as_ptr();
        }
        self.raise(hd::INVALID_ENUM);
        std::ptr::null()
    }

    pub(crate) fn set(&mut self, parameter: u32, values: [f64; 3]) {
        let Some(device) = &mut self.device else { return self.raise(hd::INVALID_OPERATION) };
        let turns = device.numbers.get(&hd::OUTPUT_DOF).is_some_and(|dof| dof[..] == [6.0]);
        match parameter {
            _ if !device.in_frame => self.raise(hd::FRAME_ERROR),
            hd::CURRENT_FORCE => device.effort[..3].copy_from_slice(&values),
            hd::CURRENT_TORQUE if turns => device.effort[3..].copy_from_slice(&values),
            _ => self.raise(hd::INVALID_ENUM),
        }
    }

    pub(crate) fn calibration(&mut self) -> u32 {
        if let Some(device) = &self.device {
            return device.calibration;
        }
        self.raise(hd::INVALID_OPERATION);
        0
    }
}

#[derive(Debug)]
pub(crate) struct Device {
    connection: Connection,
    numbers: HashMap<u32, Vec<f64>>,
    /// Never changed once said: their addresses are given away.
    texts: HashMap<u32, &'static CStr>,
    calibration: u32,
    enabled: HashSet<u32>,
    in_frame: bool,
    /// Force (N) and torque (mN m), kept from frame to frame.
    effort: [f64; 6],
}

impl Device {
    pub(crate) fn open(name: &str) -> std::io::Result<Self> {
        let mut device = Self {
            connection: Connection::open(name)?,
            numbers: HashMap::new(),
            texts: HashMap::new(),
            calibration: 0,
            enabled: HashSet::new(),
            in_frame: false,
            effort: [0.0; 6],
        };
        device.hear()?;
        Ok(device)
    }

    pub(crate) fn tell(&mut self, line: &str) -> std::io::Result<()> {
        self.connection.say(line)
    }

    /// What the arm is like now; the errors that it wants raised.
    fn refresh(&mut self) -> std::io::Result<Vec<u32>> {
        self.connection.say("frame")?;
        self.hear()
    }

    fn hear(&mut self) -> std::io::Result<Vec<u32>> {
        let mut raised = Vec::new();
        for said in self.connection.listen()? {
            match said {
                Said::Numbers(parameter, values) => drop(self.numbers.insert(parameter, values)),
                Said::Text(parameter, text) => {
                    let text = CString::new(text).unwrap_or_default().into_boxed_c_str();
                    self.texts.entry(parameter).or_insert(Box::leak(text));
                }
                Said::Calibration(status) => self.calibration = status,
                Said::Raise(code) => raised.push(code),
            }
        }
        Ok(raised)
    }

    fn is_too_strong(&self) -> bool {
        let most = self.numbers.get(&hd::NOMINAL_MAX_FORCE).and_then(|numbers| numbers.first());
        let [x, y, z, ..] = self.effort;
        most.is_some_and(|most| (x * x + y * y + z * z).sqrt() > most * (1.0 + 1e-9))
    }

    fn send_effort(&mut self) -> std::io::Result<()> {
        let [x, y, z, a, b, c] = if self.enabled.contains(&hd::FORCE_OUTPUT) { self.effort } else { [0.0; 6] };
        self.connection.say(&format!("force {x} {y} {z} {a} {b} {c}"))
    }
}
