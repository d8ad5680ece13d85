//! The slip clutch between a rigid tool and its device.
//!
//! A rigid tool is where its device is, as long as no sample that it presses is deeper in it than [`SLIP_DEPTH`]·R.
//! Where one would be, the clutch slips: the tool stays behind by the slip `s`, at `c = d + s`, and carries what the body
//! gives at that depth. Without it, a device that goes on drives the tool through any surface.
//!
//! The clutch has no mass. With the depth `g` of the deepest sample and the force `f` on the tool, a substep does
//! ```text
//! s ← s + (g − g_max) f/|f|            for g > g_max
//! |s| ← max(|s| − (g_back − g), 0)     for g < g_back
//! ```
//! No depth changes by more than the tool moves, so neither overshoots. Between `g_back` and `g_max` the slip stays: a body
//! that has just made way for the tool would otherwise be struck again and again. The tool comes back by no more than R in
//! [`RETURN_S`]: a soft body would make way for one that is quicker, down to its floor. What the device does and the tool does not is
//! lost in the clutch, as in one of steel: it takes energy only.
//!
//! Nor does the tool move faster than [`LEAP_M_PER_S`], or by more than [`NEAR`]·R in a substep, so that a device that
//! leaps takes it through nothing unseen.
use super::{ToolModel, ToolState, proxy::NEAR, spring::shortened, state::ToolContact};
use glam::DVec3;

/// Time (s) in which a tool comes back to its device by a radius.
const RETURN_S: f64 = 0.01;
/// Speed (m/s) above which a device leaps, rather than moves.
const LEAP_M_PER_S: f64 = 5.0;
/// Depth, over R, of a sample at which the clutch slips: pressure has grown to several times what a coupling gives.
const SLIP_DEPTH: f64 = 0.4;

/// Depth, over R, below which the tool comes back.
const BACK_DEPTH: f64 = 0.3;

/// Moves a rigid tool after its device, which is at `device_m` and moves by `device_m_per_s`, with the contact that it
/// had before.
pub(super) fn follow(
    model: &ToolModel,
    tool: &mut ToolState,
    contact: &ToolContact,
    (device_m, device_m_per_s): (DVec3, DVec3),
    dt_s: f64,
) {
    if dt_s == 0.0 {
        (tool.centre_m, tool.velocity_m_per_s) = (device_m + tool.slip_m, device_m_per_s);
        return;
    }
    let (before_m, most_m) = (tool.centre_m, f64::min(NEAR * model.spec.radius_m, LEAP_M_PER_S * dt_s));
    tool.slip_m = slipped(model.spec.radius_m, tool.slip_m, contact, dt_s);
    let step_m = device_m + tool.slip_m - before_m;
    // Within rounding: a device that goes just so fast is followed.
    if step_m.length() > most_m * (1.0 + 1e-9) {
        tool.slip_m = before_m + shortened(step_m, most_m) - device_m;
    }
    tool.centre_m = device_m + tool.slip_m;
    let slips = tool.slip_m != DVec3::ZERO;
    tool.velocity_m_per_s = if slips { (tool.centre_m - before_m) / dt_s } else { device_m_per_s };
}

fn slipped(radius_m: f64, slip_m: DVec3, contact: &ToolContact, dt_s: f64) -> DVec3 {
    let too_deep_m = contact.deepest_m - SLIP_DEPTH * radius_m;
    if too_deep_m > 0.0 {
        slip_m + contact.force_n.normalize_or_zero() * too_deep_m
    } else {
        let most_m = f64::min(radius_m * dt_s / RETURN_S, BACK_DEPTH * radius_m - contact.deepest_m);
        slip_m - slip_m.clamp_length_max(most_m.max(0.0))
    }
}
