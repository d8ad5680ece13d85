//! The slip clutch between a rigid tool and its device.
//!
//! A rigid tool is where its device is, as long as the surface can bear it: no sample that it presses is deeper in it than
//! [`SLIP_DEPTH`]·R, the force is no more than [`slips_at_n`], and the surface that it presses is not stretched so far that
//! neighbouring samples are further apart than [`MOST_APART`]·R, where the tool would pass between them. Beyond, the clutch
//! slips: the tool stays behind by the slip `s`, at `c = d + s`, and carries what the body gives there. Without it, a device
//! that goes on drives the tool through any surface.
//!
//! The clutch has no mass. With the depth `g` of the deepest sample, the distance `a` between samples, the force `f` on the tool,
//! and how far they are from their limits, `ρ = max(g/g_max, a/a_max, |f|/f_max)`, a substep does
//! ```text
//! s ← s + (ρ − 1) g_max f/|f|              for ρ > 1
//! |s| ← max(|s| − (ρ_back − ρ) g_max, 0)   for ρ < ρ_back
//! |s| ← max(|s| − b (1 − ρ)/(1 − ρ_back), 0)   for ρ_back ≤ ρ ≤ 1, where s·f < 0
//! ```
//! No depth changes by more than the tool moves, and a force by no more than its own part of it, so neither overshoots.
//! Between `ρ_back` and 1 the slip stays where the way back is against the force, `s·f ≥ 0`: a body that has just made way
//! for the tool would otherwise be struck again and again. Where the force pushes the tool on its way back, waiting would
//! let a body that presses it from the side hold it for ever. The tool comes back by no more than `b`, for which it needs
//! [`RETURN_S`] per radius: a soft body would make way for one that is quicker, down to its floor. What the device does
//! and the tool does not is lost in the clutch, as in one of steel: it takes energy only.
//!
//! Nor does the tool move faster than [`LEAP_M_PER_S`], or by more than [`NEAR`]·R in a substep, so that a device that
//! leaps takes it through nothing unseen.
use super::{
    ToolModel, ToolSpec, ToolState,
    foundation::{Foundation, SATURATION_DEPTH},
    proxy::NEAR,
    spring::shortened,
    state::ToolContact,
};
use glam::DVec3;
use std::f64::consts::PI;

/// Time (s) in which a tool comes back to its device by a radius.
const RETURN_S: f64 = 0.01;
/// Speed (m/s) above which a device leaps, rather than moves.
pub(super) const LEAP_M_PER_S: f64 = 5.0;
/// Depth, over R, of a sample at which the clutch slips: pressure has grown to more than a coupling gives.
const SLIP_DEPTH: f64 = 0.4;
/// Force at which it slips, over that at which the coupling of a tool of the same radius saturates.
const SLIP_FORCE: f64 = 1.2;
/// Distance, over R, between the samples that it presses at which it slips; at rest they are no further apart than
/// [`super::foundation::SPACING`].
const MOST_APART: f64 = 1.0;
/// `ρ_back`.
const BACK: f64 = 0.75;

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
    let borne = Borne {
        radius_m: model.spec.radius_m,
        deepest_m: contact.deepest_m,
        apart_m: contact.apart_sq_m2.sqrt(),
        force_n: contact.force_n,
        slips_at_n: model.slips_at_n,
    };
    tool.slip_m = borne.slipped(tool.slip_m, dt_s);
    let step_m = device_m + tool.slip_m - before_m;
    // Within rounding: a device that goes just so fast is followed.
    if step_m.length() > most_m * (1.0 + 1e-9) {
        tool.slip_m = before_m + shortened(step_m, most_m) - device_m;
    }
    tool.centre_m = device_m + tool.slip_m;
    let slips = tool.slip_m != DVec3::ZERO;
    tool.velocity_m_per_s = if slips { (tool.centre_m - before_m) / dt_s } else { device_m_per_s };
}

/// What a rigid tool bears.
#[derive(Debug, Clone, Copy)]
struct Borne {
    radius_m: f64,
    /// `g` (m).
    deepest_m: f64,
    /// `a` (m).
    apart_m: f64,
    /// `f` (N).
    force_n: DVec3,
    /// `f_max` (N).
    slips_at_n: f64,
}

impl Borne {
    /// Returns the slip (m) after a substep that began with this one.
    fn slipped(&self, slip_m: DVec3, dt_s: f64) -> DVec3 {
        let most_deep_m = SLIP_DEPTH * self.radius_m;
        let loaded = (self.deepest_m / most_deep_m)
            .max(self.apart_m / (MOST_APART * self.radius_m))
            .max(self.force_n.length() / self.slips_at_n);
        let quickest_m = self.radius_m * dt_s / RETURN_S;
        let back_m = if loaded > 1.0 {
            // A sample loses what is above its limit at once; a mean one is half as deep as the deepest.
            let beyond_m = f64::max(self.deepest_m - most_deep_m, 0.5 * (loaded - 1.0) * most_deep_m);
            return slip_m + self.force_n.normalize_or_zero() * beyond_m.min(most_deep_m);
        } else if loaded < BACK {
            quickest_m.min((BACK - loaded) * most_deep_m)
        } else if self.force_n.dot(slip_m) < 0.0 {
            quickest_m * (1.0 - loaded) / (1.0 - BACK)
        } else {
            0.0
        };
        slip_m - slip_m.clamp_length_max(back_m)
    }
}

/// Returns the force (N) at which a rigid tool slips: [`SLIP_FORCE`] times what the coupling of a tool of its radius would
/// press the surface with at most ([`Foundation::bears_n`]), or what presses it by a radius into the body where that is
/// more (Hertz, `4/3 E/(1 − ν²) R²`): on coarse triangles the foundation is soft, and the body is stiffer than it should be.
///
/// Beside its two hemispheres, which are a sphere, a capsule has a cylinder: pressed in by `d`, it displaces
/// `2L (4/3) √(2R) d^{3/2}`, where the sphere displaces `π R d²`.
pub(super) fn slips_at_n(spec: &ToolSpec, foundation: &Foundation) -> f64 {
    let (radius_m, half_m) = (spec.radius_m, spec.shape.half_length_m());
    let flat_n = foundation.bears_n(radius_m);
    let into_body_n = 4.0 / 3.0 * foundation.mean_indentation_modulus_pa() * radius_m * radius_m;
    let of_cylinder = 8.0 / (3.0 * PI) * (2.0 / SATURATION_DEPTH).sqrt() * half_m / radius_m;
    SLIP_FORCE * flat_n.max(into_body_n) * (1.0 + of_cylinder)
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT_S: f64 = 1e-4;
    const SLIP_M: DVec3 = DVec3::new(0.0, -0.02, 0.0);

    /// How far a tool of 10 mm comes back along +y in a substep, that slips at 1 N and bears a force.
    fn back_m(force_n: DVec3) -> f64 {
        let borne = Borne { radius_m: 0.01, deepest_m: 1e-3, apart_m: 0.0, force_n, slips_at_n: 1.0 };
        (borne.slipped(SLIP_M, DT_S) - SLIP_M).y
    }

    /// A tool that bore nine tenths of its limit across its way out stayed where it was for ever.
    #[test]
    fn a_tool_that_is_pressed_from_the_side_comes_back_where_the_force_lets_it() {
        let (on_its_way, against) = (DVec3::new(0.0, 0.05, 0.9), DVec3::new(0.0, -0.05, 0.9));
        let expected_m = 1e-4 * (1.0 - on_its_way.length()) / 0.25;
        assert!((back_m(on_its_way) - expected_m).abs() < 1e-12 && expected_m > 3e-5, "{}", back_m(on_its_way));
        assert_eq!(back_m(against), 0.0);
        assert!((back_m(DVec3::Z * 0.5) - 1e-4).abs() < 1e-12, "{}", back_m(DVec3::Z * 0.5));
        // It comes as quickly as it may at the lower end of the range, and not at all at the upper one.
        let at = |load: f64| back_m(DVec3::new(0.0, 0.1, 0.99499).normalize() * load);
        assert!(at(0.750_001) > 0.99e-4, "{}", at(0.750_001));
        assert!(at(0.999_999).abs() < 1e-9, "{}", at(0.999_999));
    }

    /// A tool passed between the samples of a surface that it stretched to nine times its length.
    #[test]
    fn a_tool_that_presses_samples_far_apart_gives_way() {
        let moved_m = |apart_m: f64| {
            let borne = Borne { radius_m: 0.01, deepest_m: 1e-3, apart_m, force_n: DVec3::Z * 0.8, slips_at_n: 1.0 };
            borne.slipped(SLIP_M, DT_S) - SLIP_M
        };
        assert_eq!(moved_m(0.0), DVec3::ZERO);
        assert_eq!(moved_m(0.0099), DVec3::ZERO);
        // ½ (ρ − 1) g_max
        assert!(moved_m(0.012).distance(DVec3::Z * (0.5 * 0.2 * 0.004)) < 1e-12, "{}", moved_m(0.012));
    }

    #[test]
    fn a_tool_beyond_its_limit_gives_way_along_the_force() {
        let force_n = DVec3::new(0.0, -0.6, 0.8) * 1.5;
        let borne = Borne { radius_m: 0.01, deepest_m: 1e-3, apart_m: 0.0, force_n, slips_at_n: 1.0 };
        let moved_m = borne.slipped(SLIP_M, DT_S) - SLIP_M;
        // ½ (ρ − 1) g_max, as the deepest sample is within its limit
        assert!(moved_m.distance(force_n.normalize() * (0.5 * 0.5 * 0.004)) < 1e-12, "{moved_m}");
    }
}
