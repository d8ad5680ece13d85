//! Answers in time, one value per tick.

/// Root of the mean square.
pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

/// `‖found − reference‖/‖reference‖` in L2 over time; not a number where their lengths differ.
pub fn relative_difference(found: &[f64], reference: &[f64]) -> f64 {
    if found.len() != reference.len() {
        return f64::NAN;
    }
    let difference: Vec<f64> = found.iter().zip(reference).map(|(f, r)| f - r).collect();
    rms(&difference) / rms(reference)
}
