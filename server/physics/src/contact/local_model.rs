//! The local contact model: what the servo loop beside the arm needs to render the contact between two ticks.
//!
//! Along the contact's normal three springs stand in series: coupling, foundation, body.
//! ```text
//! 1/K_n = 1/K_vc + 1/(s K₀),    1/K₀ = 1/(2 E* a) + 1/K_f,    E* = E/(1 − ν²)
//! ```
//! - Body: `dF/dδ = 2 E* a` holds for every axisymmetric punch on an elastic half space (Bulychev, Alekhin & Shorshorov
//!   1975; Pharr, Oliver & Brotzen 1992), with the contact radius `a`.
//! - Contact radius, from force and energy of the foundation, which vary smoothly while the number of samples jumps:
//!   `π a² = F²/(c k_f Φ)`, with c = 16/9 for Hertz's pressure and 3/2 for a parabolic one; `c = 1.65` is 4 % off
//!   either radius.
//! - Foundation: `K_f = k_f π a²`.
//! - `s` corrects for what the half space leaves out (thin walls, bonded layers, large strain, the mesh): it is the
//!   ratio of measured secants `ΔF/Δδ` of recent ticks to `K₀`, averaged in its logarithm and limited to
//!   [1/[`MOST_CORRECTION`], [`MOST_CORRECTION`]].
//!
//! Across the normal the stiffness of the sticking part of the contact is `2(1 − ν)/(2 − ν) ≈ 0.75` of that (Mindlin);
//! without friction it is zero. A capsule that is pressed at `p` from its centre gives way by turning, too: the
//! coupling's compliance there is `1/K_vc + |p × n|²/K_r`.
//!
//! The stiffness is `−K_n nnᵀ − K_t (I − nnᵀ)`: symmetric, negative semi-definite, never stiffer than the coupling, and
//! smoothed over some ten ticks. A tool that turns has a torque, too ([`super::local_torque`]).
use super::{
    Capsule, Coupling, LocalContactModel, LocalTorqueModel, ToolModel, ToolState,
    friction::TANGENTIAL_RATIO,
    local_torque::{self, Springs},
    narrow::Pressed,
    turning::rotation_vector,
};
use crate::linalg::tensor::outer;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// `c` in the formula of the contact radius.
const PRESSURE_SHAPE: f64 = 1.65;
/// Bound of the correction `s` and of its inverse.
pub(super) const MOST_CORRECTION: f64 = 8.0;
/// Weight of a new secant in `ln s`.
const SECANT_FRACTION: f64 = 0.3;
/// Least motion (over R) over which a secant is measured.
const SECANT_MOTION: f64 = 0.01;
/// Number of ticks after which a secant's start is too old.
const SECANT_TICKS: u32 = 100;
/// Weight of a tick's stiffness in the smoothed one.
const SMOOTHING: f64 = 0.15;

/// The estimate of the contact's stiffness, which the local model keeps from tick to tick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct StiffnessEstimate {
    /// `ln s`.
    pub(super) log_correction: f64,
    /// Smoothed `K_n` and, below, `K_t` (N/m); 0 out of contact.
    pub(super) normal_n_per_m: f64,
    pub(super) tangential_n_per_m: f64,
    /// Smoothed `K_θ` (N m/rad).
    pub(super) turning_nm_per_rad: DMat3,
    /// Where the present secant starts (m), its force there (N), and its age in ticks; there is none where the age is
    /// 0.
    pub(super) start_centre_m: DVec3,
    pub(super) start_force_n: f64,
    pub(super) age_ticks: u32,
}

/// Contact of a tool, as the mean over a tick.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeanContact {
    pub(super) pressed: Pressed,
    /// Force on the device (N).
    pub(super) device_force_n: DVec3,
    /// Torque on the device (N m).
    pub(super) device_torque_nm: DVec3,
}

impl Default for StiffnessEstimate {
    /// Returns the estimate out of contact, with nothing learnt. It is written out since a matrix is the identity by
    /// default.
    fn default() -> Self {
        Self {
            log_correction: 0.0,
            normal_n_per_m: 0.0,
            tangential_n_per_m: 0.0,
            turning_nm_per_rad: DMat3::ZERO,
            start_centre_m: DVec3::ZERO,
            start_force_n: 0.0,
            age_ticks: 0,
        }
    }
}

impl StiffnessEstimate {
    pub(super) fn is_finite(&self) -> bool {
        let numbers = [self.log_correction, self.normal_n_per_m, self.tangential_n_per_m, self.start_force_n];
        numbers.iter().all(|n| n.is_finite()) && self.start_centre_m.is_finite() && self.turning_nm_per_rad.is_finite()
    }

    /// Forgets the contact, and keeps what was learnt of the body.
    fn leave(&mut self) {
        *self = Self { log_correction: self.log_correction, ..Self::default() };
    }

    /// Updates `s` by a tick's motion; `prior_n_per_m` is `K₀`.
    fn learn(&mut self, centre_m: DVec3, normal: DVec3, force_n: f64, prior_n_per_m: f64, radius_m: f64) {
        let deeper_m = (self.start_centre_m - centre_m).dot(normal);
        if self.age_ticks > 0 && deeper_m.abs() >= SECANT_MOTION * radius_m {
            let ratio = (force_n - self.start_force_n) / deeper_m / prior_n_per_m;
            if ratio > 0.0 {
                let measured = ratio.ln().clamp(-MOST_CORRECTION.ln(), MOST_CORRECTION.ln());
                self.log_correction += SECANT_FRACTION * (measured - self.log_correction);
            }
            self.age_ticks = 0;
        }
        if self.age_ticks == 0 || self.age_ticks >= SECANT_TICKS {
            (self.start_centre_m, self.start_force_n, self.age_ticks) = (centre_m, force_n, 0);
        }
        self.age_ticks += 1;
    }

    fn smooth(&mut self, normal_n_per_m: f64, tangential_n_per_m: f64) {
        // The first tick of a contact starts from nothing: its radius, and so its stiffness, begins at zero anyway.
        self.normal_n_per_m += SMOOTHING * (normal_n_per_m - self.normal_n_per_m);
        self.tangential_n_per_m += SMOOTHING * (tangential_n_per_m - self.tangential_n_per_m);
    }
}

/// Updates the estimate and returns the model about the device's position, `None` out of contact.
pub(super) fn update(
    model: &ToolModel,
    tool: &ToolState,
    estimate: &mut StiffnessEstimate,
    mean: &MeanContact,
) -> Option<LocalContactModel> {
    let pressed = &mean.pressed;
    let (Some(normal), true) = (pressed.normal_n.try_normalize(), pressed.energy_j > 0.0) else {
        estimate.leave();
        return None;
    };
    let force_n = pressed.pressing_n;
    let (k_f, modulus_pa) = (pressed.force_times_k_f / force_n, pressed.force_times_modulus / force_n);
    // π a² = F²/(c k_f Φ)
    let area_m2 = force_n * force_n / (PRESSURE_SHAPE * k_f * pressed.energy_j);
    let contact_radius_m = (area_m2 / PI).sqrt().min(largest_radius_m(model));
    let prior = series(2.0 * modulus_pa * contact_radius_m, k_f * area_m2);
    let arm_m = pressed_at_m(model, tool, pressed);
    estimate.learn(tool.centre_m + arm_m, normal, pressed.normal_n.dot(normal), prior, model.spec.radius_m);
    let contact = prior * estimate.log_correction.exp();
    let sticking = TANGENTIAL_RATIO * contact * pressed.sticking_n / force_n;
    let (moving, turning) = coupling_stiffnesses(model, tool);
    // 1/K_vc + |p × n|²/K_r
    let coupling = series(moving, turning / arm_m.cross(normal).length_squared());
    estimate.smooth(series(contact, coupling), series(sticking, coupling));
    let (k_n, k_t) = (estimate.normal_n_per_m, estimate.tangential_n_per_m);
    let stiffness_n_per_m = outer(normal, normal) * (k_t - k_n) - DMat3::from_diagonal(DVec3::splat(k_t));
    // Hertz's force, linearised about δ = a²/R, is wrong by (3/8)(r/δ)² of itself at a distance r: 5 % at r = 0.35 δ.
    // The device moves further than the tool, by the coupling's stretch.
    let half_width_m = half_width_m(model, contact_radius_m);
    let body_radius_m = 0.35 * half_width_m * half_width_m / model.spec.radius_m;
    let validity_radius_m = body_radius_m * (contact / series(contact, coupling));
    let validity_radius_m = validity_radius_m.clamp(0.02 * model.spec.radius_m, model.spec.radius_m);
    let torque = model.spec.shape.as_capsule().map(|capsule| {
        let springs = Springs {
            normal_n_per_m: contact,
            coupled_n_per_m: (series(contact, moving), series(sticking, moving)),
            turning_nm_per_rad: turning,
        };
        let k_theta = local_torque::stiffness_nm_per_rad(pressed, &springs);
        estimate.turning_nm_per_rad += (k_theta - estimate.turning_nm_per_rad) * SMOOTHING;
        let stiffness_nm_per_rad = -estimate.turning_nm_per_rad;
        LocalTorqueModel {
            orientation: tool.target.orientation,
            torque_nm: torque_at_end_of_tick(model, tool, mean, &stiffness_nm_per_rad),
            stiffness_nm_per_rad,
            validity_angle_rad: local_torque::validity_angle_rad(validity_radius_m, capsule.half_length_m),
        }
    });
    Some(LocalContactModel {
        point_m: tool.target.position_m,
        normal,
        force_n: at_end_of_tick(model, tool, mean, &stiffness_n_per_m),
        stiffness_n_per_m,
        validity_radius_m,
        torque,
    })
}

/// Returns `K_vc` (N/m) and `K_r` (N m/rad). Both are infinite for a rigid tool, the latter for one that does not turn,
/// too; a tool that slips from its device is not moved by it.
fn coupling_stiffnesses(model: &ToolModel, tool: &ToolState) -> (f64, f64) {
    let turning = |capsule: &Capsule| capsule.turning.stiffness_nm_per_rad;
    match model.spec.coupling {
        Coupling::Rigid if tool.slip_m != DVec3::ZERO => (0.0, f64::INFINITY),
        Coupling::Rigid => (f64::INFINITY, f64::INFINITY),
        Coupling::Spring { stiffness_n_per_m, .. } => {
            (stiffness_n_per_m, model.spec.shape.as_capsule().map_or(f64::INFINITY, turning))
        }
    }
}

/// Returns the radius (m) of a disc as large as the tool's outline.
fn largest_radius_m(model: &ToolModel) -> f64 {
    let radius_m = model.spec.radius_m;
    model
        .spec
        .shape
        .as_capsule()
        .map_or(radius_m, |capsule| (radius_m * radius_m + 4.0 / PI * radius_m * capsule.half_length_m).sqrt())
}

/// Returns half the width (m) of a contact that has the area of a disc; with a capsule the contact may reach all along
/// it, `π a² = 2b 2L`.
fn half_width_m(model: &ToolModel, radius_m: f64) -> f64 {
    let capsule = model.spec.shape.as_capsule();
    capsule.map_or(radius_m, |capsule| radius_m.min(PI * radius_m * radius_m / (4.0 * capsule.half_length_m)))
}

/// Returns where on its axis, from its centre (m), a tool is pressed: `p = s h` with `p × F = τ` as far as the axis
/// allows, or an end of the axis when it is pressed along it.
fn pressed_at_m(model: &ToolModel, tool: &ToolState, pressed: &Pressed) -> DVec3 {
    let half_m = model.axis(tool).half_m;
    let across = half_m.cross(pressed.force_n);
    let along = half_m.dot(pressed.force_n);
    if across.length_squared() <= 1e-12 * along * along {
        return half_m * -along.signum() * f64::from(u8::from(along != 0.0));
    }
    half_m * (pressed.torque_nm.dot(across) / across.length_squared()).clamp(-1.0, 1.0)
}

/// Returns the force (N) at the end of the tick: the mean force is that of the middle of the tick, and the device has
/// moved on since.
fn at_end_of_tick(model: &ToolModel, tool: &ToolState, mean: &MeanContact, stiffness_n_per_m: &DMat3) -> DVec3 {
    match model.spec.coupling {
        Coupling::Rigid => {
            let half_way = (tool.target.position_m - tool.previous_target.position_m) * 0.5;
            mean.device_force_n + *stiffness_n_per_m * half_way
        }
        Coupling::Spring { .. } => mean.device_force_n,
    }
}

/// Returns the torque (N m) at the end of the tick likewise.
fn torque_at_end_of_tick(
    model: &ToolModel,
    tool: &ToolState,
    mean: &MeanContact,
    stiffness_nm_per_rad: &DMat3,
) -> DVec3 {
    match model.spec.coupling {
        Coupling::Rigid => {
            let turn = tool.target.orientation * tool.previous_target.orientation.conjugate();
            mean.device_torque_nm + *stiffness_nm_per_rad * (rotation_vector(turn) * 0.5)
        }
        Coupling::Spring { .. } => mean.device_torque_nm,
    }
}

/// Returns the stiffness of two springs in series; either may be zero or infinite.
fn series(a: f64, b: f64) -> f64 {
    let (soft, stiff) = (a.min(b), a.max(b));
    if soft <= 0.0 || soft.is_infinite() { soft.max(0.0) } else { soft / (1.0 + soft / stiff) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_of_springs() {
        assert_eq!(series(2.0, 2.0), 1.0);
        assert_eq!(series(2.0, f64::INFINITY), 2.0);
        assert_eq!(series(0.0, 5.0), 0.0);
        assert_eq!(series(0.0, f64::INFINITY), 0.0);
        assert_eq!(series(f64::INFINITY, f64::INFINITY), f64::INFINITY);
    }

    #[test]
    fn secants_teach_the_correction() {
        let (mut estimate, radius, truth, prior) = (StiffnessEstimate::default(), 0.01, 300.0, 100.0);
        for step in 1..200 {
            let depth = 2e-5 * f64::from(step);
            estimate.learn(DVec3::NEG_Z * depth, DVec3::Z, truth * depth, prior, radius);
        }
        assert!((estimate.log_correction.exp() - 3.0).abs() < 0.01, "{}", estimate.log_correction.exp());
    }

    #[test]
    fn a_resting_tool_teaches_nothing() {
        let mut estimate = StiffnessEstimate::default();
        for step in 0..1000 {
            estimate.learn(DVec3::ZERO, DVec3::Z, f64::from(step).sin(), 100.0, 0.01);
        }
        assert_eq!(estimate.log_correction, 0.0);
    }
}
