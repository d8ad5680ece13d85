//! How the time to build a body is parted, for who waits for it.

/// To lay it out; then come its largest frequencies, untouched and touched.
const LAID: f64 = 0.4;
const FREQUENCY: f64 = 0.3;

/// Tells `progress` of the body being laid out.
pub(crate) fn laying(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID * part)
}

/// Of its largest frequency while nothing touches it.
pub(crate) fn untouched(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID + FREQUENCY * part)
}

/// Of that while it is touched everywhere.
pub(crate) fn touched(progress: &mut dyn FnMut(f64)) -> impl FnMut(f64) {
    |part| progress(LAID + FREQUENCY * (1.0 + part))
}
