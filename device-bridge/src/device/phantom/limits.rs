//! What the arm says that it bears, and whether more is configured.
use super::{
    Settings,
    ffi::{self, Hd},
    start::{StartError, drop_errors},
};
use std::fmt;

/// What the arm says of itself; absent where HD does not know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Peak force (N).
    pub max_force_n: Option<f64>,
    /// Force (N) that it bears for ever.
    pub continuous_force_n: Option<f64>,
    /// Stiffest wall (N/m) that is stable.
    pub stiffness_n_per_m: Option<f64>,
    /// Beyond this velocity (m/s) HD raises an error.
    pub velocity_m_per_s: Option<f64>,
    /// Beyond this change of force (N) between frames HD raises an error.
    pub impulse_n: Option<f64>,
    /// Peak torque (N m), where it has motors for it.
    pub max_torque_nm: Option<f64>,
}

impl fmt::Display for Limits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let told = |value: Option<f64>, unit| value.map_or_else(|| "unknown".to_owned(), |v| format!("{v} {unit}"));
        write!(
            f,
            "peak force {}, for ever {}; stiffest wall {}; velocity limit {}, limit of the change of force in a frame {}; ",
            told(self.max_force_n, "N"),
            told(self.continuous_force_n, "N"),
            told(self.stiffness_n_per_m, "N/m"),
            told(self.velocity_m_per_s, "m/s"),
            told(self.impulse_n, "N"),
        )?;
        match self.max_torque_nm {
            Some(nm) => write!(f, "peak torque {nm} N m"),
            None => write!(f, "no torque"),
        }
    }
}

impl Limits {
    /// Asks for them; errors of what it does not know are dropped.
    pub(super) fn read(hd: Hd, turns: bool) -> Self {
        let known = |parameter, scale: f64| {
            let [value] = hd.doubles(parameter);
            (value.is_finite() && value > 0.0).then_some(value * scale)
        };
        let limits = Self {
            max_force_n: known(ffi::MAX_FORCE, 1.0),
            continuous_force_n: known(ffi::MAX_CONTINUOUS_FORCE, 1.0),
            stiffness_n_per_m: known(ffi::MAX_STIFFNESS, 1e3),
            velocity_m_per_s: known(ffi::VELOCITY_LIMIT, 1e-3),
            impulse_n: known(ffi::IMPULSE_LIMIT, 1.0),
            max_torque_nm: if turns { known(ffi::MAX_TORQUE, 1e-3) } else { None },
        };
        drop_errors(hd);
        limits
    }

    /// What is configured that the arm does not bear: more force is refused, the rest told.
    pub(super) fn check(&self, settings: &Settings, model: &str) -> Result<(), StartError> {
        let asked_n = settings.max_force_n;
        let told = |n: Option<f64>| n.map_or_else(|| "unknown".to_owned(), |n| format!("{n} N"));
        match self.max_force_n {
            Some(max_n) if asked_n > max_n => {
                let continuous = told(self.continuous_force_n);
                return Err(StartError::Force { asked_n, max_n, continuous, model: model.to_owned() });
            }
            Some(_) => {}
            None => tracing::warn!("HD does not know this arm's peak force: limits.max_force_n has to be within it"),
        }
        if let Some(bears_n) = self.continuous_force_n
            && settings.continuous_force_n.is_none_or(|n| n > bears_n)
        {
            tracing::warn!(
                "limits.continuous_force_n should be {bears_n}, what this arm's motors bear for ever, or they get too warm in a long press"
            );
        }
        Ok(())
    }
}
