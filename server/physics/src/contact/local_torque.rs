//! The local torque model: the torque of the contact of a tool that turns.
//!
//! A rotation `θ` of the tool about its centre moves a sample at `p` by `θ × p`: along the sample's normal by `l·θ`
//! with its lever `l = p × n`. So samples that share the contact's stiffnesses `K_n`, `K_t` (of [`super::local_model`],
//! before the coupling) by the forces they carry, `w = |f_n|/Σ|f_n|`, resist it with the torque `−C θ`:
//! ```text
//! C = k_n ⟨l⟩⟨l⟩ᵀ + K_n (⟨l lᵀ⟩ − ⟨l⟩⟨l⟩ᵀ) + k_t ⟨(p·p) I − p pᵀ − l lᵀ⟩,    1/k = 1/K + 1/K_vc
//! ```
//! (`θ·⟨…⟩θ` of the last term is the mean square of a sample's motion along the surface). A tool that is pressed at one
//! point moves against the coupling of its centre, too; one that is pressed on both sides of its centre does not. The
//! device turns it by the coupling's other half, in series for every direction:
//! ```text
//! K_θ = (C⁻¹ + I/K_r)⁻¹ = C (I + C/K_r)⁻¹
//! ```
//! It is symmetric, positive semi-definite, and never stiffer than `K_r`. An elastic body resists tilting more than its
//! pressure's spread says (a flat punch on a half space twice as much), a foundation just as much: the model is up to a
//! third too soft (`tests/local_model.rs`), which only delays, and a softer spring is stabler. The change of the torque
//! by the tool's translation, and that of the force by its rotation, are left to the next tick.
use super::narrow::Pressed;
use crate::linalg::tensor::outer;
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// A torque model holds within this angle (rad) at most: a rotation vector is no sum of smaller ones.
const LARGEST_ANGLE_RAD: f64 = 0.2;

/// Torque on the device near `orientation`: `τ(R) = torque_nm + stiffness θ`, with the rotation vector `θ` (rad, world)
/// of `R orientation⁻¹`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LocalTorqueModel {
    /// The device's orientation about which it is expanded.
    pub orientation: DQuat,
    /// Torque on the device there (N m).
    pub torque_nm: DVec3,
    /// `∂τ/∂θ = −K_θ` (N m/rad), symmetric.
    pub stiffness_nm_per_rad: DMat3,
    /// Angle inside which it may be used (rad).
    pub validity_angle_rad: f64,
}

impl LocalTorqueModel {
    pub(super) fn is_finite(&self) -> bool {
        self.orientation.is_finite()
            && self.torque_nm.is_finite()
            && self.stiffness_nm_per_rad.is_finite()
            && self.validity_angle_rad.is_finite()
    }
}

/// Moments of the samples in contact about the tool's centre, weighted by the forces that they carry.
#[derive(Debug, Clone, Copy)]
pub(super) struct Levers {
    /// `Σ |f_n| l` (N m).
    sum_nm: DVec3,
    /// `Σ |f_n| l lᵀ` (N m²).
    square: DMat3,
    /// `Σ |f_n| ((p·p) I − p pᵀ)` (N m²).
    reach: DMat3,
}

impl Default for Levers {
    /// Returns the levers of no samples. It is written out since a matrix is the identity by default.
    fn default() -> Self {
        Self { sum_nm: DVec3::ZERO, square: DMat3::ZERO, reach: DMat3::ZERO }
    }
}

impl Levers {
    /// Adds a sample at `p` (m) from the centre, with its normal, which carries the force `f_n` (N).
    pub(super) fn push(&mut self, p: DVec3, normal: DVec3, f_n: f64) {
        let lever_m = p.cross(normal);
        self.sum_nm += f_n * lever_m;
        self.square += f_n * outer(lever_m, lever_m);
        self.reach += f_n * (DMat3::from_diagonal(DVec3::splat(p.length_squared())) - outer(p, p));
    }

    pub(super) fn add(&mut self, other: &Self) {
        self.sum_nm += other.sum_nm;
        self.square += other.square;
        self.reach += other.reach;
    }

    pub(super) fn scaled(&self, by: f64) -> Self {
        Self { sum_nm: self.sum_nm * by, square: self.square * by, reach: self.reach * by }
    }
}

/// Stiffnesses (N/m) of contact and coupling.
#[derive(Debug, Clone, Copy)]
pub(super) struct Springs {
    /// `K_n` of the contact.
    pub(super) normal_n_per_m: f64,
    /// `k_n` and `k_t`: of the contact, along and across its normal, in series with the coupling.
    pub(super) coupled_n_per_m: (f64, f64),
    /// `K_r` (N m/rad); infinite where the device turns the tool itself.
    pub(super) turning_nm_per_rad: f64,
}

/// Returns `K_θ` (N m/rad).
pub(super) fn stiffness_nm_per_rad(pressed: &Pressed, springs: &Springs) -> DMat3 {
    let weight = 1.0 / pressed.pressing_n;
    let (mean_m, square) = (pressed.levers.sum_nm * weight, pressed.levers.square * weight);
    let (k_n, k_t) = springs.coupled_n_per_m;
    let at_one_place = outer(mean_m, mean_m);
    let along = pressed.levers.reach * weight - square;
    // C = k_n ⟨l⟩⟨l⟩ᵀ + K_n (⟨l lᵀ⟩ − ⟨l⟩⟨l⟩ᵀ) + k_t ⟨(p·p) I − p pᵀ − l lᵀ⟩
    let contact = at_one_place * k_n + (square - at_one_place) * springs.normal_n_per_m + along * k_t;
    // C (I + C/K_r)⁻¹
    let both = contact * (DMat3::IDENTITY + contact * (1.0 / springs.turning_nm_per_rad)).inverse();
    (both + both.transpose()) * 0.5
}

/// Returns the angle (rad) that moves an end of the tool as far as the force may be extrapolated.
pub(super) fn validity_angle_rad(radius_m: f64, half_length_m: f64) -> f64 {
    (radius_m / half_length_m).min(LARGEST_ANGLE_RAD)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn springs(k_n: f64, k_t: f64, coupling: f64, turning_nm_per_rad: f64) -> Springs {
        let series = |k: f64| if coupling.is_finite() { k * coupling / (k + coupling) } else { k };
        Springs { normal_n_per_m: k_n, coupled_n_per_m: (series(k_n), series(k_t)), turning_nm_per_rad }
    }

    fn of(samples: &[(DVec3, f64)]) -> Pressed {
        let mut pressed = Pressed::default();
        for &(p, f_n) in samples {
            pressed.levers.push(p, DVec3::NEG_Z, f_n);
            pressed.pressing_n += f_n;
        }
        pressed
    }

    #[test]
    fn one_place_turns_on_its_lever_and_the_coupling() {
        let pressed = of(&[(DVec3::new(0.02, 0.0, 0.0), 3.0)]);
        // (0.02 m)² · 500 N/m = 0.2 N m/rad about y; by the coupling of 500 N/m half of it.
        let rigid = stiffness_nm_per_rad(&pressed, &springs(500.0, 0.0, f64::INFINITY, f64::INFINITY));
        assert!((rigid - DMat3::from_diagonal(DVec3::Y * 0.2)).abs_diff_eq(DMat3::ZERO, 1e-15), "{rigid}");
        let coupled = stiffness_nm_per_rad(&pressed, &springs(500.0, 0.0, 500.0, 0.1));
        assert!((coupled.y_axis.y - 0.05).abs() < 1e-15, "0.1 in series with 0.1: {coupled}");
    }

    #[test]
    fn two_places_beside_the_centre_do_not_move_it() {
        let at = |x: f64| (DVec3::new(x, 0.0, 0.0), 1.0);
        let told = stiffness_nm_per_rad(&of(&[at(0.02), at(-0.02)]), &springs(500.0, 0.0, 10.0, f64::INFINITY));
        assert!((told.y_axis.y - 0.2).abs() < 1e-15, "{told}");
    }

    #[test]
    fn what_sticks_resists_a_spin_and_what_slides_does_not() {
        let pressed = of(&[(DVec3::new(0.0, 0.0, -0.01), 1.0)]);
        let sliding = stiffness_nm_per_rad(&pressed, &springs(500.0, 0.0, f64::INFINITY, f64::INFINITY));
        assert_eq!(sliding, DMat3::ZERO);
        let sticking = stiffness_nm_per_rad(&pressed, &springs(500.0, 300.0, f64::INFINITY, f64::INFINITY));
        // (0.01 m)² · 300 N/m about both axes along the surface.
        let expected = DMat3::from_diagonal(DVec3::new(0.03, 0.03, 0.0));
        assert!((sticking - expected).abs_diff_eq(DMat3::ZERO, 1e-15), "{sticking}");
    }

    proptest! {
        #[test]
        fn it_is_a_spring_no_stiffer_than_the_coupling(
            samples in prop::collection::vec((prop::array::uniform3(-0.03..0.03_f64), 0.01..2.0_f64), 1..20),
            (k_n, k_t, k_r) in (1.0..2000.0_f64, 0.0..1500.0_f64, 0.01..1.0_f64),
            v in prop::array::uniform3(-1.0..1.0_f64),
        ) {
            let samples: Vec<_> = samples.into_iter().map(|(p, f_n)| (DVec3::from(p), f_n)).collect();
            let k = stiffness_nm_per_rad(&of(&samples), &springs(k_n, k_t, 400.0, k_r));
            let v = DVec3::from(v);
            let energy = v.dot(k * v);
            prop_assert!(energy >= -1e-12 && energy <= k_r * v.length_squared() * (1.0 + 1e-9), "{k}");
        }
    }
}
