//! The motion of a tool: along its device's path, or as a mass on the virtual coupling.
//!
//! A coupled tool (the *proxy*) obeys `m c̈ = f_contact + K(d − c) + B(ḋ − ċ)` and is advanced with the body's own
//! leapfrog: half kick, drift, new force, half kick. Each half kick is the exact solution for a force `f` that is constant over it,
//! `v ← v_∞ + (v − v_∞) e^{−B h/m}` with `v_∞ = ḋ + f/B`, so no damping makes the tool unstable, nor does it stop one
//! that is light: this goes at `f/B`. (A kick by `f` and then damping would give it `f h/m e^{−B h/m}`.)
//!
//! The damper's `ḋ` is the velocity of the device's path, smoothed over [`SMOOTHED_S`]: an arm that counts steps of an
//! encoder, or whose poses are not in time with the ticks, moves by leaps. A leap of 0.05 mm in a tick of 1 ms is 50
//! mm/s, of which a damper of 2 N s/m makes a buzz of 0.1 N.
//!
//! What keeps it outside, whatever the device does:
//! - The spring saturates ([`super::spring`]) at `F_max`, the force that the surface may be pressed with
//!   ([`super::foundation::Foundation::bears_n`]). The damper is cut where the sum exceeds it. Where nothing is within
//!   R/4 of the tool, neither is: so limited, a small tool falls behind a quick hand in the air. What its device is told
//!   is limited everywhere.
//! - It moves at most `R/4` in a substep; within `R/4` of the surface it approaches the nearest point, seen from there,
//!   with at most the kinetic energy that the flat foundation stores at depth [`IMPACT_DEPTH`]·R. The rest is taken
//!   from the (virtual) tool, never given to tool or body. In contact that point moves with the dent, which the body
//!   will stop: there a surface that gives way allows no more speed than one at rest.
//!
//! A saturated spring is as soft as its secant, `K e₀/|e|`, so its damper is weaker by the root of that,
//! `B √(e₀/|e|)`: the whole of it would let a small tool creep to its device at `F_max/B`, a few millimetres per second.
//!
//! A rigid tool follows its device through a clutch ([`super::clutch`]).
//!
//! A tool that turns is advanced in its orientation likewise ([`super::turning`]).
use super::{
    Coupling, ToolModel, ToolState, clutch,
    narrow::Pressed,
    spring::{SaturatingSpring, shortened},
    state::ToolContact,
    turning,
};
use glam::DVec3;

/// Depth, over R, whose foundation energy bounds the proxy's kinetic energy near the surface.
pub(super) const IMPACT_DEPTH: f64 = 0.4;
/// Largest motion in a substep, and width of the zone near the surface, both over R.
pub(super) const NEAR: f64 = 0.25;

/// Stretch (m) at which the coupling saturates where nothing is near: further than an arm reaches.
const FREE_STRETCH_M: f64 = 1.0;
/// Time constant (s) of the device's velocity for the coupling's damper.
pub(super) const SMOOTHED_S: f64 = 5e-3;
/// A device that stands still is at rest below this speed (m/s, rad/s): what is left of a smoothed velocity has no end.
const AT_REST: f64 = 1e-7;

/// The position of a substep within its tick.
#[derive(Debug, Clone, Copy)]
pub struct SubstepTime {
    /// Fraction of the tick that is done at the substep's end, 0..=1.
    pub fraction: f64,
    /// The substep's length (s); with 0 forces are evaluated where things are.
    pub dt_s: f64,
    /// The tick's length (s).
    pub tick_period_s: f64,
}

impl SubstepTime {
    /// Returns position (m) and velocity (m/s) of the device, which moves straight from target to target during a tick.
    fn device(&self, tool: &ToolState) -> (DVec3, DVec3) {
        let (from, to) = (tool.previous_target.position_m, tool.target.position_m);
        (from.lerp(to, self.fraction), (to - from) / self.tick_period_s)
    }

    /// Smooths, at a tick's beginning, its path into the velocities that dampers use:
    /// `v ← v + (1 − e^{−T/τ}) (Δ/T − v)`.
    pub(super) fn smooth(&self, tool: &mut ToolState) {
        let part = -(-self.tick_period_s / SMOOTHED_S).exp_m1();
        let smoothed = |old: DVec3, path: DVec3| {
            let new = old + (path - old) * part;
            if path == DVec3::ZERO && new.length() < AT_REST { DVec3::ZERO } else { new }
        };
        tool.device_m_per_s = smoothed(tool.device_m_per_s, self.device(tool).1);
        tool.device_rad_per_s = smoothed(tool.device_rad_per_s, self.device_turn(tool).1);
    }

    /// Returns the time at which this substep begins.
    fn at_start(&self) -> Self {
        Self { fraction: self.fraction - self.dt_s / self.tick_period_s, ..*self }
    }
}

impl ToolModel {
    /// Returns the coupling of position, `None` for a rigid tool.
    fn pull(&self) -> Option<Pull> {
        match (self.spec.coupling, self.spring()) {
            (Coupling::Spring { damping_n_s_per_m, mass_kg, .. }, Some(spring)) => {
                Some(Pull { spring, damping_n_s_per_m, mass_kg })
            }
            _ => None,
        }
    }
}

/// A coupling's spring and damper, and the mass that they move.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pull {
    pub(super) spring: SaturatingSpring,
    /// `B` (N s/m).
    pub(super) damping_n_s_per_m: f64,
    /// `m` (kg).
    pub(super) mass_kg: f64,
}

/// Force and torque of the coupling on the tool.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Coupled {
    /// Force (N).
    pub(super) force_n: DVec3,
    /// Torque (N m).
    pub(super) torque_nm: DVec3,
}

/// Does the first half of a substep, half kick and drift. Returns a bound (m) of how far any point of the tool's axis
/// moved.
pub(super) fn drift(model: &ToolModel, tool: &mut ToolState, contact: &ToolContact, time: &SubstepTime) -> f64 {
    let before = model.axis(tool);
    let (device_m, device_m_per_s) = time.device(tool);
    match model.pull() {
        None => {
            clutch::follow(model, tool, contact, (device_m, device_m_per_s), time.dt_s);
            turning::follow(model, tool, time);
        }
        Some(pull) => {
            let (at_start, half_s) = (time.at_start(), 0.5 * time.dt_s);
            let stretch_m = at_start.device(tool).0 - tool.centre_m;
            let pull = if contact.is_clear { pull.in_the_clear() } else { pull };
            pull.half_kick(&mut tool.velocity_m_per_s, contact.force_n, stretch_m, tool.device_m_per_s, half_s);
            turning::half_kick(model, tool, contact.torque_nm, &at_start, half_s);
            limit_speed(model, tool, NEAR * model.spec.radius_m / time.dt_s.max(f64::MIN_POSITIVE));
            tool.centre_m += tool.velocity_m_per_s * time.dt_s;
            turning::drift(model, tool, time.dt_s);
        }
    }
    before.centre_m.distance(tool.centre_m) + before.half_m.distance(model.axis(tool).half_m)
}

/// Returns whether nothing is within the zone near the surface.
pub(super) fn is_clear(model: &ToolModel, pressed: &Pressed) -> bool {
    pressed.to_surface_m.length() >= (1.0 + NEAR) * model.spec.radius_m
}

/// Does the second half of a substep, with the contact that the tool has now. Returns the coupling's force and torque
/// on the tool.
pub(super) fn finish(
    model: &ToolModel,
    tool: &mut ToolState,
    pressed: &Pressed,
    surface_m_per_s: DVec3,
    time: &SubstepTime,
) -> Coupled {
    let Some(pull) = model.pull() else { return Coupled::default() };
    let distance_m = pressed.to_surface_m.length();
    if !is_clear(model, pressed) {
        let limit_m_per_s = (2.0 * model.impact_energy_j / pull.mass_kg).sqrt();
        let towards = pressed.to_surface_m / distance_m;
        let recedes_m_per_s = surface_m_per_s.dot(towards);
        let base_m_per_s = if pressed.contacts > 0 { recedes_m_per_s.min(0.0) } else { recedes_m_per_s };
        let limit_m_per_s = base_m_per_s + limit_m_per_s;
        match model.spec.shape.as_capsule() {
            None => limit_approach(tool, towards, limit_m_per_s),
            Some(capsule) => {
                let inertia_kg_m2 = capsule.turning.inertia_kg_m2;
                turning::limit_approach(tool, pressed.arm_m, towards, limit_m_per_s, pull.mass_kg, inertia_kg_m2);
            }
        }
    }
    let (stretch_m, half_s) = (time.device(tool).0 - tool.centre_m, 0.5 * time.dt_s);
    let limit_n = pull.spring.limit_n;
    let pull = if is_clear(model, pressed) { pull.in_the_clear() } else { pull };
    let force_n = pull.half_kick(&mut tool.velocity_m_per_s, pressed.force_n, stretch_m, tool.device_m_per_s, half_s);
    Coupled {
        force_n: shortened(force_n, limit_n),
        torque_nm: turning::half_kick(model, tool, pressed.torque_nm, time, half_s),
    }
}

impl Pull {
    /// Returns the same, with a spring that saturates at [`FREE_STRETCH_M`] only.
    fn in_the_clear(self) -> Self {
        let limit_n = self.spring.limit_n.max(self.spring.stiffness_n_per_m * FREE_STRETCH_M);
        Self { spring: SaturatingSpring { limit_n, ..self.spring }, ..self }
    }

    /// Kicks the tool over `h_s`, with the contact's force (N), the stretch (m) and the device's velocity (m/s), and
    /// returns the coupling's mean force (N) over it.
    pub(super) fn half_kick(
        &self,
        velocity_m_per_s: &mut DVec3,
        contact_n: DVec3,
        stretch_m: DVec3,
        device_m_per_s: DVec3,
        h_s: f64,
    ) -> DVec3 {
        let Self { spring, damping_n_s_per_m, mass_kg } = *self;
        let (limit_n, spring_n) = (spring.limit_n, spring.force_n(stretch_m));
        if h_s == 0.0 {
            return spring_n;
        }
        // Mean force of the damper over h, with x = B h/m: m (1 − e^{−x})/h (ḋ − v) − (1 − (1 − e^{−x})/x) f
        let damping_n_s_per_m = damping_n_s_per_m * spring.secant(stretch_m).sqrt();
        let exponent = damping_n_s_per_m * h_s / mass_kg;
        let part = -(-exponent).exp_m1();
        let lost = if exponent > 0.0 { 1.0 - part / exponent } else { 0.0 };
        let damper_n = (device_m_per_s - *velocity_m_per_s) * (mass_kg * part / h_s) - (contact_n + spring_n) * lost;
        // |s + β d| ≤ limit and |s| ≤ limit: no more than twice the limit of the damper's force can be used.
        let damper_n = shortened(damper_n, 2.0 * limit_n);
        let damper_n = damper_n * fraction_within(spring_n, damper_n, limit_n);
        *velocity_m_per_s += (contact_n + spring_n + damper_n) * (h_s / mass_kg);
        spring_n + damper_n
    }
}

/// Returns the largest `β ≤ 1` with `|s + β d| ≤ limit`, for `|s| ≤ limit`. A damper shortened by it still only takes
/// energy.
fn fraction_within(s: DVec3, d: DVec3, limit: f64) -> f64 {
    // A saturated spring may be a rounding beyond the limit by itself: without a damper there is nothing to shorten.
    if (s + d).length_squared() <= limit * limit || d == DVec3::ZERO {
        return 1.0;
    }
    // d² β² + 2 s·d β + s² − limit² = 0
    let (square, half, rest) = (d.length_squared(), s.dot(d), (limit * limit - s.length_squared()).max(0.0));
    (((half * half + square * rest).sqrt() - half) / square).clamp(0.0, 1.0)
}

/// Cuts the velocity towards the surface, but no more than to a stop; `towards` is not a direction when the centre lies
/// on the surface.
fn limit_approach(tool: &mut ToolState, towards: DVec3, limit_m_per_s: f64) {
    let own = tool.velocity_m_per_s.dot(towards);
    let excess = (own - limit_m_per_s).min(own);
    if excess > 0.0 {
        tool.velocity_m_per_s -= towards * excess;
    }
}

fn limit_speed(model: &ToolModel, tool: &mut ToolState, limit_m_per_s: f64) {
    let Some(capsule) = model.spec.shape.as_capsule() else {
        tool.velocity_m_per_s = tool.velocity_m_per_s.clamp_length_max(limit_m_per_s);
        return;
    };
    // |v + ω × p| ≤ |v| + L|ω| on the axis
    let fastest = tool.velocity_m_per_s.length() + capsule.half_length_m * tool.angular_velocity_rad_per_s.length();
    if fastest > limit_m_per_s {
        tool.velocity_m_per_s *= limit_m_per_s / fastest;
        tool.angular_velocity_rad_per_s *= limit_m_per_s / fastest;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lets a tool go, 4 mm from a device that stands still; returns where it is (m) after so long.
    fn let_go_m(damping_n_s_per_m: f64, mass_kg: f64, after_s: f64, steps: u32) -> f64 {
        let spring = SaturatingSpring { stiffness_n_per_m: 50.0, limit_n: 10.0 };
        let pull = Pull { spring, damping_n_s_per_m, mass_kg };
        let (mut at_m, mut v, h_s) = (DVec3::X * 4e-3, DVec3::ZERO, after_s / f64::from(steps));
        for _ in 0..steps {
            pull.half_kick(&mut v, DVec3::ZERO, -at_m, DVec3::ZERO, 0.5 * h_s);
            at_m += v * h_s;
            pull.half_kick(&mut v, DVec3::ZERO, -at_m, DVec3::ZERO, 0.5 * h_s);
        }
        at_m.x
    }

    /// `m ẍ + B ẋ + K x = 0`; a tool of 0.18 g on a damper of 8 N s/m stood still beside its device for ever.
    #[test]
    fn a_light_tool_creeps_as_its_damper_lets_it() {
        let (k, b, m, t): (f64, f64, f64, f64) = (50.0, 8.0, 1.8e-4, 0.16);
        let root = (0.25 * b * b - m * k).sqrt();
        let (slow, fast) = ((-0.5 * b + root) / m, (-0.5 * b - root) / m);
        let exact_m = 4e-3 * (fast * (slow * t).exp() - slow * (fast * t).exp()) / (fast - slow);
        let error = let_go_m(b, m, t, 320) / exact_m - 1.0;
        // Where B h/m ≫ 1, a step is one of Euler's: ½ K h/B off in a time of B/K.
        assert!(error.abs() < 2e-3, "{error}");
    }

    #[test]
    fn coupling_is_of_second_order_with_its_damper() {
        let (b, m, t): (f64, f64, f64) = (0.4, 0.05, 0.1);
        let (decay, turn) = (0.5 * b / m, (50.0 / m - 0.25 * b * b / (m * m)).sqrt());
        let exact_m = 4e-3 * (-decay * t).exp() * ((turn * t).cos() + decay / turn * (turn * t).sin());
        let error_m = |steps: u32| (let_go_m(b, m, t, steps) - exact_m).abs();
        let order = (error_m(100) / error_m(200)).log2();
        assert!((order - 2.0).abs() < 0.05, "{order}");
    }

    #[test]
    fn the_damper_is_cut_at_the_limit_and_never_reversed() {
        for (s, d) in [(DVec3::X, DVec3::X * 5.0), (DVec3::X * 2.0, DVec3::Y), (DVec3::X * 2.0, DVec3::NEG_X * 9.0)] {
            let part = fraction_within(s, d, 2.0);
            assert!((0.0..=1.0).contains(&part));
            assert!((s + d * part).length() <= 2.0 + 1e-12, "{s} {d} {part}");
        }
        assert_eq!(fraction_within(DVec3::X, DVec3::X * 0.5, 2.0), 1.0);
        // Without damping, a spring that saturated at the limit and a rounding made the tool's velocity not a number.
        assert_eq!(fraction_within(DVec3::X * (2.0 + 1e-15), DVec3::ZERO, 2.0), 1.0);
    }
}
