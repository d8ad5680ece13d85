//! The rotation of a tool that turns: it follows its device's orientation rigidly, or on the virtual coupling of
//! orientation.
//!
//! A coupled capsule obeys `J ω̇ = τ_contact + K_r log(R_d Rᵀ) + B_r (ω_d − ω)` beside `m c̈ = …` of [`super::proxy`],
//! with the same half kicks, the damper integrated exactly, and `R ← exp(ω h) R` for a drift. `log` is the rotation
//! vector of the shorter way round: it is the gradient of `½ |log|²`, so the spring `½ K_r |log(R_d Rᵀ)|²` is
//! conservative. With one inertia `J` for every axis the angular momentum is `J ω`, whichever way the tool is turned.
//!
//! The spring saturates at `τ_max = F_max L`. Held by both couplings, a tool that is wedged between two walls carries
//! `f₁ − f₂ ≤ F_max` and `(f₁ + f₂) L ≤ τ_max` at its ends: neither is more than `F_max`, which its hemisphere bears.
//!
//! The limit of the approach is that of a sphere, at the point of the axis that is nearest to the surface: an impulse
//! `λ` there takes `λ (1/m + |p × n|²/J)` of its speed, and energy only.
use super::{
    ToolModel, ToolState,
    proxy::{Pull, SubstepTime},
    spring::SaturatingSpring,
};
use glam::{DQuat, DVec3};

/// Returns the rotation vector (rad) of a rotation, the shorter way round: `|v| ≤ π`.
pub(super) fn rotation_vector(q: DQuat) -> DVec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let axis = q.xyz();
    let sine = axis.length();
    // 2 atan(s/w)/s → 2/w
    let factor = if sine > 1e-9 { 2.0 * sine.atan2(q.w) / sine } else { 2.0 / q.w };
    axis * factor
}

impl SubstepTime {
    /// Returns orientation and angular velocity (rad/s) of the device, which turns about one axis from target to target
    /// during a tick.
    pub(super) fn device_turn(&self, tool: &ToolState) -> (DQuat, DVec3) {
        let (from, to) = (tool.previous_target.orientation, tool.target.orientation);
        let turn = rotation_vector(to * from.conjugate());
        (DQuat::from_scaled_axis(turn * self.fraction) * from, turn / self.tick_period_s)
    }
}

impl ToolModel {
    /// Returns spring, damper and inertia of a coupled tool that turns, `None` for others.
    fn turning(&self) -> Option<Pull> {
        let (capsule, spring) = (self.spec.shape.as_capsule()?, self.spring()?);
        let turning = capsule.turning;
        let limit_n = spring.limit_n * capsule.half_length_m;
        Some(Pull {
            spring: SaturatingSpring { stiffness_n_per_m: turning.stiffness_nm_per_rad, limit_n },
            damping_n_s_per_m: turning.damping_nm_s_per_rad,
            mass_kg: turning.inertia_kg_m2,
        })
    }
}

/// Turns a rigid tool as its device is turned.
pub(super) fn follow(model: &ToolModel, tool: &mut ToolState, time: &SubstepTime) {
    if model.spec.shape.as_capsule().is_some() {
        (tool.orientation, tool.angular_velocity_rad_per_s) = time.device_turn(tool);
    }
}

/// Does half a kick of a coupled tool's rotation. Returns the coupling's mean torque (N m) over it.
pub(super) fn half_kick(
    model: &ToolModel,
    tool: &mut ToolState,
    contact_nm: DVec3,
    time: &SubstepTime,
    h_s: f64,
) -> DVec3 {
    let Some(pull) = model.turning() else { return DVec3::ZERO };
    let apart = rotation_vector(time.device_turn(tool).0 * tool.orientation.conjugate());
    pull.half_kick(&mut tool.angular_velocity_rad_per_s, contact_nm, apart, tool.device_rad_per_s, h_s)
}

/// Does the drift of a coupled tool's rotation.
pub(super) fn drift(model: &ToolModel, tool: &mut ToolState, dt_s: f64) {
    if model.spec.shape.as_capsule().is_some() {
        let turn = DQuat::from_scaled_axis(tool.angular_velocity_rad_per_s * dt_s);
        tool.orientation = (turn * tool.orientation).normalize();
    }
}

/// Cuts the speed with which a point of the axis, `arm_m` from the centre, goes towards the surface, but to no less
/// than zero.
pub(super) fn limit_approach(
    tool: &mut ToolState,
    arm_m: DVec3,
    towards: DVec3,
    limit_m_per_s: f64,
    mass_kg: f64,
    inertia_kg_m2: f64,
) {
    let own = (tool.velocity_m_per_s + tool.angular_velocity_rad_per_s.cross(arm_m)).dot(towards);
    let excess = (own - limit_m_per_s).min(own);
    if excess > 0.0 {
        let lever_m = arm_m.cross(towards);
        let impulse = excess / (1.0 / mass_kg + lever_m.length_squared() / inertia_kg_m2);
        tool.velocity_m_per_s -= towards * (impulse / mass_kg);
        tool.angular_velocity_rad_per_s -= lever_m * (impulse / inertia_kg_m2);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn rotation_vectors_come_back(
            v in prop::array::uniform3(-1.8..1.8_f64),
            scale in prop::sample::select(vec![1.0, 1e-6, 1e-12]),
        ) {
            let v = DVec3::from(v) * scale;
            for q in [DQuat::from_scaled_axis(v), -DQuat::from_scaled_axis(v)] {
                prop_assume!(v.length() < 3.1);
                prop_assert!((rotation_vector(q) - v).length() <= 1e-12 * scale, "{v}");
            }
        }

        /// `d/dε ½|log(R_d (exp(ε a) R)ᵀ)|² = −a·log(R_d Rᵀ)`
        #[test]
        fn the_torque_is_the_gradient_of_the_spring(v in prop::array::uniform3(-1.5..1.5_f64), axis in 0..3_usize) {
            let (q, h) = (DQuat::from_scaled_axis(v.into()), 1e-6);
            let turned = |e: f64| q * DQuat::from_scaled_axis(DVec3::AXES[axis] * e).conjugate();
            let energy = |e: f64| 0.5 * rotation_vector(turned(e)).length_squared();
            let slope = (energy(h) - energy(-h)) / (2.0 * h);
            prop_assert!((slope + rotation_vector(q)[axis]).abs() < 1e-8, "{slope}");
        }
    }
}
