//! The fractions of the time to build a body that its parts take, for a display of progress.

/// Fraction of the time that laying the body out takes.
const LAID: f64 = 0.4;
/// Fraction of the time that each of three eigenvalues takes: the largest frequency untouched, then touched, and the
/// largest rate of damping.
const EIGENVALUE: f64 = 0.2;

/// Returns a function that tells `progress` of the body being laid out, given the fraction of it that is done.
pub(crate) fn laying(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID * part)
}

/// Returns a function that tells `progress` of the search for the body's largest frequency while nothing touches it.
pub(crate) fn untouched(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID + EIGENVALUE * part)
}

/// Returns a function that tells `progress` of the search for the body's largest frequency while it is touched
/// everywhere.
pub(crate) fn touched(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID + EIGENVALUE * (1.0 + part))
}

/// Returns a function that tells `progress` of the search for the body's largest rate of damping.
pub(crate) fn damped(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID + EIGENVALUE * (2.0 + part))
}
