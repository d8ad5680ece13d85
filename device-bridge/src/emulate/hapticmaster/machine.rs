//! The machine: its states, its motion, its answers.
use super::{LEAST_INERTIA_KG, Settings, effects::Effects};
use crate::device::hapticmaster::plane::DampFactor;
use glam::DVec3;
use palpate_control::{ArmSpec, ParameterError, SimulatedArm};
use std::time::Instant;

/// Step of its motion (s): its inner loop is said to run at 2.5 kHz.
const STEP_S: f64 = 4e-4;
/// What it bears at most (N).
const MAX_FORCE_N: f64 = 100.0;

#[derive(Debug, Clone, Copy, PartialEq)]
enum State {
    Off,
    Init(Instant),
    Stop,
    Force,
}

#[derive(Debug)]
pub(super) struct Machine {
    pub(super) settings: Settings,
    pub(super) arm: SimulatedArm,
    state: State,
    homed: bool,
    pub(super) stopped: bool,
    pub(super) effects: Effects,
    /// The longest force (N) of all effects so far.
    pub(super) peak_n: f64,
    began: Option<Instant>,
    steps: u64,
    pub(super) requests: u64,
}

impl Machine {
    pub(super) fn new(settings: Settings) -> Result<Self, ParameterError> {
        Ok(Self {
            arm: SimulatedArm::new(settings.arm, settings.path.clone(), STEP_S)?,
            state: State::Off,
            homed: settings.homing.is_none(),
            stopped: false,
            effects: Effects::new(damp_factor(&settings)),
            peak_n: 0.0,
            began: None,
            steps: 0,
            requests: 0,
            settings,
        })
    }

    pub(super) fn effect_n(&self) -> DVec3 {
        if self.state != State::Force || self.stopped {
            return DVec3::ZERO;
        }
        self.effects.force_n(&self.arm.motion()).clamp_length_max(MAX_FORCE_N)
    }

    /// Motion up to now; the hand begins on its path with the first force.
    pub(super) fn go_on(&mut self) {
        if let State::Init(since) = self.state
            && since.elapsed() >= self.settings.homing.unwrap_or_default()
        {
            (self.state, self.homed) = (State::Stop, true);
        }
        let Some(began) = self.began else { return };
        let due = (began.elapsed().as_secs_f64() / STEP_S) as u64;
        while self.steps < due {
            let force_n = self.effect_n();
            self.peak_n = self.peak_n.max(force_n.length());
            self.arm.step(force_n);
            self.steps += 1;
        }
    }

    pub(super) fn obey(&mut self, text: &str) -> String {
        let commands: Vec<&str> = text.split(';').map(str::trim).collect();
        let is_get = |command: &&str| command.starts_with("get ");
        if self.settings.apart && commands.iter().any(is_get) && !commands.iter().all(is_get) {
            return "--- ERROR: set and get in one request".into();
        }
        let answers: Vec<String> = commands.into_iter().map(|command| self.command(command)).collect();
        // One `;` between two answers, whatever each ends with.
        let trimmed = |answer: &String| answer.trim_end_matches(';').to_owned();
        match &answers[..] {
            [one] => one.clone(),
            _ => answers.iter().map(trimmed).collect::<Vec<_>>().join(";"),
        }
    }

    fn command(&mut self, command: &str) -> String {
        let words: Vec<&str> = command.split_whitespace().collect();
        match words[..] {
            ["get", what] => self.get(what),
            ["remove", "all"] => {
                self.effects.clear();
                "Removed".into()
            }
            ["create", "flatplane", _] if !self.settings.effects.planes => unknown(command),
            ["create", kind, name] => self.effects.create(kind, name).unwrap_or_else(|| unknown(command)),
            ["set", "state", state] => self.set_state(state),
            ["set", "inertia", kg] => self.set_inertia(kg),
            ["set", name, ref what @ ..] => self.effects.set(name, what).unwrap_or_else(|| unknown(command)),
            _ => unknown(command),
        }
    }

    fn get(&self, what: &str) -> String {
        let motion = self.arm.motion();
        // Six digits, as C's `%g` gives them.
        let vector = |v: DVec3| format!("[{:.5e},{:.5e},{:.5e}]", v.x, v.y, v.z);
        let word = |text: &str| if self.settings.quoted { format!("\"{text}\"") } else { format!("{text};") };
        match what {
            "modelpos" | "measpos" => vector(motion.position_m),
            "modelvel" => vector(motion.velocity_m_per_s),
            "measforce" => vector(self.arm.hand_force_n()),
            "os" => word("palpate emulator"),
            "emergencybuttonpushed" => word(if self.stopped { "true" } else { "false" }),
            "position_calibrated" => word(if self.homed { "true" } else { "false" }),
            "state" => word(match self.state {
                State::Off => "off",
                State::Init(_) => "init",
                State::Stop => "stop",
                State::Force => "force",
            }),
            _ => unknown(what),
        }
    }

    fn set_state(&mut self, state: &str) -> String {
        self.state = match state {
            "init" => State::Init(Instant::now()),
            "stop" => State::Stop,
            "off" => State::Off,
            "force" if self.homed => State::Force,
            "force" => return "--- ERROR: position not calibrated".into(),
            _ => return unknown(state),
        };
        if self.state == State::Force {
            self.began.get_or_insert_with(Instant::now);
        }
        format!("state set to '{state}'")
    }

    fn set_inertia(&mut self, kg: &str) -> String {
        let kg: f64 = kg.parse().unwrap_or(f64::NAN);
        let spec = ArmSpec { mass_kg: kg, ..self.settings.arm };
        match SimulatedArm::new(spec, self.settings.path.clone(), STEP_S) {
            Ok(arm) if kg >= LEAST_INERTIA_KG && self.began.is_none() => {
                self.arm = arm;
                self.settings.arm.mass_kg = kg;
                self.effects.mean(damp_factor(&self.settings));
                "Inertia set".into()
            }
            // The next one to start it finds it moving.
            Ok(_) if kg == self.settings.arm.mass_kg => "Inertia set".into(),
            _ => format!("--- ERROR: inertia must be at least {LEAST_INERTIA_KG}"),
        }
    }
}

fn damp_factor(settings: &Settings) -> DampFactor {
    let inertia_kg = settings.arm.mass_kg;
    if settings.effects.damping_is_ratio { DampFactor::Ratio { inertia_kg } } else { DampFactor::Coefficient }
}

fn unknown(command: &str) -> String {
    format!("--- ERROR: unknown command {command}")
}
