//! Checks of settings, with an error that names the setting.
use thiserror::Error;

/// A setting outside its range.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("{name} = {value}: {rule}")]
pub struct ParameterError {
    /// Name of the setting, with its unit.
    pub name: &'static str,
    /// Value given.
    pub value: f64,
    /// What it must satisfy.
    pub rule: &'static str,
}

/// `value` if it is finite and larger than zero.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    let rule = "must be finite and larger than 0";
    if value.is_finite() && value > 0.0 { Ok(value) } else { Err(ParameterError { name, value, rule }) }
}

/// `value` if it is finite and not negative.
pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<f64, ParameterError> {
    let rule = "must be finite and not negative";
    if value.is_finite() && value >= 0.0 { Ok(value) } else { Err(ParameterError { name, value, rule }) }
}
