//! How a tool moves: along its device's path, or as a mass on the virtual coupling.
//!
//! A coupled tool (the *proxy*) obeys `m c̈ = f_contact + K(d − c) + B(ḋ − ċ)` and is advanced with the body's own leapfrog:
//! half kick, drift, new force, half kick. The damper is integrated exactly over each half kick,
//! `v ← ḋ + (v − ḋ) e^{−B h/m}`, so no damping makes it unstable.
//!
//! What keeps it outside, whatever the device does:
//! - The spring saturates ([`super::spring`]) at `F_max`, the force that presses the sphere [`SATURATION_DEPTH`]·R into the flat
//!   foundation. The damper is cut where the sum exceeds it.
//! - It moves at most `R/4` in a substep; within `R/4` of the surface it approaches the nearest point, seen from there, with at
//!   most the kinetic energy that the flat foundation stores at depth [`IMPACT_DEPTH`]·R. The rest is taken from the (virtual) tool,
//!   never given to tool or body. In contact that point moves with the dent, which the body will stop: there a surface that gives
//!   way allows no more speed than one at rest.
use super::{Coupling, ToolModel, ToolState, narrow::Pressed, spring::shortened};
use glam::DVec3;

/// Depth over R at which the coupling's force saturates.
pub(super) const SATURATION_DEPTH: f64 = 0.3;
/// Depth over R whose foundation energy bounds the proxy's kinetic energy near the surface.
pub(super) const IMPACT_DEPTH: f64 = 0.4;
/// Largest motion in a substep, and the width of the zone near the surface, over R.
pub(super) const NEAR: f64 = 0.25;

/// Where a substep stands in its tick.
#[derive(Debug, Clone, Copy)]
pub struct SubstepTime {
    /// Part of the tick done at its end, 0..=1.
    pub fraction: f64,
    /// Its length (s); 0 evaluates forces where things are.
    pub dt_s: f64,
    /// The tick's length (s).
    pub tick_period_s: f64,
}

impl SubstepTime {
    /// Position (m) and velocity (m/s) of the device: straight from target to target during a tick.
    fn device(&self, tool: &ToolState) -> (DVec3, DVec3) {
        let (from, to) = (tool.previous_target.position_m, tool.target.position_m);
        (from.lerp(to, self.fraction), (to - from) / self.tick_period_s)
    }
}

/// First half of a substep: half kick and drift. Returns how far the tool moved (m).
pub(super) fn drift(model: &ToolModel, tool: &mut ToolState, contact_n: DVec3, time: &SubstepTime) -> f64 {
    let before = tool.centre_m;
    let (device_m, device_m_per_s) = time.device(tool);
    match model.spec.coupling {
        Coupling::Rigid => {
            tool.centre_m = device_m;
            tool.velocity_m_per_s = device_m_per_s;
        }
        Coupling::Spring { .. } => {
            let at_start = SubstepTime { fraction: time.fraction - time.dt_s / time.tick_period_s, ..*time };
            half_kick(model, tool, contact_n, at_start.device(tool), 0.5 * time.dt_s);
            limit_speed(tool, NEAR * model.spec.radius_m / time.dt_s.max(f64::MIN_POSITIVE));
            tool.centre_m += tool.velocity_m_per_s * time.dt_s;
        }
    }
    before.distance(tool.centre_m)
}

/// Second half, with what the tool now meets. Returns the coupling's force on the tool (N).
pub(super) fn finish(
    model: &ToolModel,
    tool: &mut ToolState,
    pressed: &Pressed,
    surface_m_per_s: DVec3,
    time: &SubstepTime,
) -> DVec3 {
    let Coupling::Spring { mass_kg, .. } = model.spec.coupling else { return DVec3::ZERO };
    let distance_m = pressed.to_surface_m.length();
    if distance_m < (1.0 + NEAR) * model.spec.radius_m {
        let limit_m_per_s = (2.0 * model.impact_energy_j / mass_kg).sqrt();
        let towards = pressed.to_surface_m / distance_m;
        let recedes_m_per_s = surface_m_per_s.dot(towards);
        let base_m_per_s = if pressed.contacts > 0 { recedes_m_per_s.min(0.0) } else { recedes_m_per_s };
        limit_approach(tool, towards, base_m_per_s + limit_m_per_s);
    }
    half_kick(model, tool, pressed.force_n, time.device(tool), 0.5 * time.dt_s)
}

/// Kicks the tool over `h_s` and returns the coupling's mean force (N) over it.
fn half_kick(
    model: &ToolModel,
    tool: &mut ToolState,
    contact_n: DVec3,
    (device_m, device_m_per_s): (DVec3, DVec3),
    h_s: f64,
) -> DVec3 {
    let (Coupling::Spring { damping_n_s_per_m, mass_kg, .. }, Some(spring)) = (model.spec.coupling, model.spring())
    else {
        return DVec3::ZERO;
    };
    let (limit_n, spring_n) = (spring.limit_n, spring.force_n(device_m - tool.centre_m));
    if h_s == 0.0 {
        return spring_n;
    }
    tool.velocity_m_per_s += (contact_n + spring_n) * (h_s / mass_kg);
    // Impulse of the damper over h: m (1 − e^{−B h/m}) (ḋ − ċ)
    let share = -(-damping_n_s_per_m * h_s / mass_kg).exp_m1();
    // |s + β d| ≤ limit and |s| ≤ limit: no more than twice the limit of it can be used.
    let damper_n = shortened((device_m_per_s - tool.velocity_m_per_s) * (mass_kg * share / h_s), 2.0 * limit_n);
    let damper_n = damper_n * share_within(spring_n, damper_n, limit_n);
    tool.velocity_m_per_s += damper_n * (h_s / mass_kg);
    spring_n + damper_n
}

/// Largest `β ≤ 1` with `|s + β d| ≤ limit`, for `|s| ≤ limit`. A shortened damper still only takes energy.
fn share_within(s: DVec3, d: DVec3, limit: f64) -> f64 {
    if (s + d).length_squared() <= limit * limit {
        return 1.0;
    }
    // d² β² + 2 s·d β + s² − limit² = 0
    let (square, half, rest) = (d.length_squared(), s.dot(d), (limit * limit - s.length_squared()).max(0.0));
    (((half * half + square * rest).sqrt() - half) / square).clamp(0.0, 1.0)
}

/// Cuts the velocity towards the surface, but no more than to a stop; `towards` is not a direction when the centre lies on the
/// surface.
fn limit_approach(tool: &mut ToolState, towards: DVec3, limit_m_per_s: f64) {
    let own = tool.velocity_m_per_s.dot(towards);
    let excess = (own - limit_m_per_s).min(own);
    if excess > 0.0 {
        tool.velocity_m_per_s -= towards * excess;
    }
}

fn limit_speed(tool: &mut ToolState, limit_m_per_s: f64) {
    tool.velocity_m_per_s = tool.velocity_m_per_s.clamp_length_max(limit_m_per_s);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_damper_is_cut_at_the_limit_and_never_reversed() {
        for (s, d) in [(DVec3::X, DVec3::X * 5.0), (DVec3::X * 2.0, DVec3::Y), (DVec3::X * 2.0, DVec3::NEG_X * 9.0)] {
            let share = share_within(s, d, 2.0);
            assert!((0.0..=1.0).contains(&share));
            assert!((s + d * share).length() <= 2.0 + 1e-12, "{s} {d} {share}");
        }
        assert_eq!(share_within(DVec3::X, DVec3::X * 0.5, 2.0), 1.0);
    }
}
