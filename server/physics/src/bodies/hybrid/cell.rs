//! The cell between eight particles, with one point of integration.
//!
//! `F = Σ_p y_p b_pᵀ` is blind to four patterns of motion per component (hourglasses): `ηζ`, `ζξ`, `ξη`, `ξηζ` in the
//! cell's coordinates. With `γ_k` those patterns over eight, less their linear part (Flanagan & Belytschko 1981),
//! `q_k = Σ_p γ_kp y_p` is their amplitude (m), zero for affine motion, and turns with the body:
//! ```text
//! U_c = V Ψ(F) + ½ κ Q ε        Q = Σ_k w_k |q_k|²,  κ = χ (4/3) µ V/h²,  w = (1, 1, 1, ½)
//! f_p = −V P b_p − κ φ Σ_k w_k γ_kp q_k
//! ```
//! `χ = 2` is what the first three cost in shear when they bend a cell out of its plane. A cell then is too stiff in
//! bending; [`HOURGLASS`] is a quarter of it. `ε` and `φ`, 1 at small amplitudes, are those of
//! [`super::hourglass_growth`].
use super::{
    hourglass_growth::{self, GROWTH, energy_factor, force_factor},
    moments::Moments,
    sites::CORNERS,
    sizes::Hanging,
};
use crate::{
    linalg::tensor::outer,
    material::{Lame, Material, viscous},
};
use glam::{DMat3, DVec3};

/// `χ`, the stiffness of hourglasses.
pub const HOURGLASS: f64 = 0.5;
/// `w_k`, the weights of the four hourglass patterns.
pub const MODE_WEIGHTS: [f64; 4] = [1.0, 1.0, 1.0, 0.5];

/// A cell at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestCell {
    /// `V` (m³), the volume of the body that the cell answers for.
    pub volume_m3: f64,
    /// `b_p` (1/m).
    pub gradients_per_m: [DVec3; 8],
    /// `γ_kp`.
    pub modes: [[f64; 8]; 4],
    /// `κ/µ` (m).
    pub hourglass_m: f64,
    /// `β/h²` (1/m²).
    pub growth_per_m2: f64,
}

impl RestCell {
    /// Makes the rest data of a cell from the moments of the part of it that is body; it answers for `fraction` of
    /// that.
    pub fn new(edge_m: f64, fraction: f64, moments: &Moments) -> Self {
        Self::with_hanging(edge_m, fraction, moments, Hanging::NONE)
    }

    /// Does the same for a cell with hanging corners. The moments refer to the cell's particles, not to its corners.
    pub fn with_hanging(
        edge_m: f64,
        fraction: f64,
        Moments { volume_m3, gradients_m2 }: &Moments,
        hanging: Hanging,
    ) -> Self {
        let gradients_per_m = gradients_m2.map(|g| g * (1.0 / volume_m3));
        let patterns: [fn(DVec3) -> f64; 4] = [|s| s.y * s.z, |s| s.z * s.x, |s| s.x * s.y, |s| s.x * s.y * s.z];
        let modes = patterns.map(|pattern| {
            let raw = CORNERS.map(|corner| pattern(corner * 2.0 - DVec3::ONE) / 8.0);
            let linear: DVec3 = raw.iter().zip(CORNERS).map(|(r, corner)| corner * (*r * edge_m)).sum();
            let raw = hanging.to_particles(raw);
            std::array::from_fn(|p| raw[p] - linear.dot(gradients_per_m[p]))
        });
        let volume_m3 = fraction * volume_m3;
        let hourglass_m = HOURGLASS * 4.0 / 3.0 * volume_m3 / (edge_m * edge_m);
        Self { volume_m3, gradients_per_m, modes, hourglass_m, growth_per_m2: GROWTH / (edge_m * edge_m) }
    }

    /// Returns `Σ_p a_p b_pᵀ`, computed with differences to the first particle.
    pub fn gradient_of(&self, a: &[DVec3; 8]) -> DMat3 {
        let terms = a.iter().zip(self.gradients_per_m).skip(1);
        terms.fold(DMat3::ZERO, |sum, (a_p, b)| sum + outer(*a_p - a[0], b))
    }

    /// Returns the hourglass amplitudes `q_k` (m).
    pub fn amplitudes(&self, a: &[DVec3; 8]) -> [DVec3; 4] {
        self.modes.map(|mode| mode.iter().zip(a).skip(1).map(|(g, a_p)| (*a_p - a[0]) * *g).sum())
    }

    /// Returns the elastic energy `U_c` (J).
    pub fn energy_j(&self, material: &Material, y: &[DVec3; 8]) -> f64 {
        let kappa = self.hourglass_m * material.lame.mu_pa;
        let modes_m2 = self.modes_m2(&self.amplitudes(y));
        self.volume_m3 * material.energy_density(&self.gradient_of(y)) + 0.5 * kappa * modes_m2
    }

    /// Returns `Q ε(β Q/h²)` (m²) of hourglass amplitudes.
    pub fn modes_m2(&self, amplitudes: &[DVec3; 4]) -> f64 {
        let squares_m2 = squares_m2(amplitudes);
        squares_m2 * energy_factor(self.growth_per_m2 * squares_m2)
    }

    /// Returns the forces `f_p` (N) of elastic and viscous stress, and the power (W) that viscous stress takes.
    pub fn forces_n(&self, material: &Material, y: &[DVec3; 8], rate: &[DVec3; 8]) -> ([DVec3; 8], f64) {
        let f = self.gradient_of(y);
        let mut stress = material.piola(&f);
        let mut power_w = 0.0;
        if !material.viscosity.is_zero() {
            let f_dot = self.gradient_of(rate);
            stress += viscous::piola(material.viscosity, &f, &f_dot);
            power_w = self.volume_m3 * viscous::power_density(material.viscosity, &f, &f_dot);
        }
        (self.corner_forces_n(material.lame.mu_pa, &stress, &self.stiffened(&self.amplitudes(y))), power_w)
    }

    /// Returns `−K a` (N), the change of the elastic forces along `a`.
    pub fn products_n(&self, material: &Material, y: &[DVec3; 8], a: &[DVec3; 8]) -> [DVec3; 8] {
        let change = material.piola_differential(&self.gradient_of(y), &self.gradient_of(a));
        // δ(φ q_k) = φ δq_k + φ' (2 β/h²) (Σ_l w_l q_l·δq_l) q_k
        let (q, dq) = (self.amplitudes(y), self.amplitudes(a));
        let along: f64 = q.iter().zip(&dq).zip(MODE_WEIGHTS).map(|((q, dq), w)| w * q.dot(*dq)).sum();
        let growth = self.growth_per_m2 * squares_m2(&q);
        let stiffened = force_factor(growth);
        let grown = hourglass_growth::slope(growth) * 2.0 * self.growth_per_m2 * along;
        let changes = std::array::from_fn(|k| dq[k] * stiffened + q[k] * grown);
        self.corner_forces_n(material.lame.mu_pa, &change, &changes)
    }

    /// Returns `φ q_k` (m).
    pub(super) fn stiffened(&self, amplitudes: &[DVec3; 4]) -> [DVec3; 4] {
        let factor = force_factor(self.growth_per_m2 * squares_m2(amplitudes));
        amplitudes.map(|q| q * factor)
    }

    /// Returns the diagonal blocks (N/m) of the stiffness at rest,
    /// `V ((λ + µ) b_p b_pᵀ + µ |b_p|² I) + κ Σ_k w_k γ_kp² I`.
    pub fn diagonal_n_per_m(&self, material: &Material) -> [DMat3; 8] {
        let Lame { lambda_pa, mu_pa } = material.lame;
        std::array::from_fn(|p| {
            let b = self.gradients_per_m[p];
            let modes: f64 = (0..4).map(|k| MODE_WEIGHTS[k] * self.modes[k][p] * self.modes[k][p]).sum();
            let all_round = mu_pa * (self.volume_m3 * b.length_squared() + self.hourglass_m * modes);
            outer(b, b) * (self.volume_m3 * (lambda_pa + mu_pa)) + DMat3::from_diagonal(DVec3::splat(all_round))
        })
    }

    pub(super) fn corner_forces_n(&self, hourglass_pa: f64, stress: &DMat3, amplitudes: &[DVec3; 4]) -> [DVec3; 8] {
        let kappa = self.hourglass_m * hourglass_pa;
        std::array::from_fn(|p| {
            let modes: DVec3 = (0..4).map(|k| amplitudes[k] * (MODE_WEIGHTS[k] * self.modes[k][p])).sum();
            *stress * self.gradients_per_m[p] * -self.volume_m3 - modes * kappa
        })
    }
}

/// Returns `Q = Σ_k w_k |q_k|²` (m²).
fn squares_m2(amplitudes: &[DVec3; 4]) -> f64 {
    amplitudes.iter().zip(MODE_WEIGHTS).map(|(q, w)| w * q.length_squared()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{Random, tissue};

    fn cell() -> RestCell {
        let h = 2.5e-3_f64;
        RestCell::new(h, 1.0, &Moments::full(h))
    }

    #[test]
    fn hourglasses_do_not_see_affine_motion_and_nothing_else_is_missed() {
        let (cell, mut random) = (cell(), Random(1));
        let rest = CORNERS.map(|c| c * 2.5e-3);
        let f = DMat3::from_cols(random.vector(), random.vector(), random.vector());
        let moved = rest.map(|p| f * p + DVec3::splat(0.3));
        assert!(cell.amplitudes(&moved).iter().all(|q| q.length() < 1e-15));
        assert!((cell.gradient_of(&moved) - f).abs_diff_eq(DMat3::ZERO, 1e-12));
        // 1 translation + 3 gradients + 4 amplitudes: a motion without any of them is none.
        let a: [DVec3; 8] = std::array::from_fn(|_| random.vector());
        let (g, q) = (cell.gradient_of(&a), cell.amplitudes(&a));
        let mean: DVec3 = a.iter().sum::<DVec3>() / 8.0;
        for p in 0..8 {
            let s = CORNERS[p] * 2.0 - DVec3::ONE;
            let patterns = [s.y * s.z, s.z * s.x, s.x * s.y, s.x * s.y * s.z];
            let modes: DVec3 = q.iter().zip(patterns).map(|(q, pattern)| *q * pattern).sum();
            let back = mean + g * (s * 1.25e-3) + modes;
            assert!((back - a[p]).length() < 1e-12);
        }
    }

    #[test]
    fn forces_are_the_energys_gradient_and_products_theirs() {
        let mut random = Random(2);
        for material in tissue() {
            let cell = cell();
            let y: [DVec3; 8] = std::array::from_fn(|p| (CORNERS[p] + random.vector() * 0.1) * 2.5e-3);
            let a: [DVec3; 8] = std::array::from_fn(|_| random.vector() * 1e-3);
            let at = |s: f64| std::array::from_fn::<DVec3, 8, _>(|p| y[p] + a[p] * s);
            let rest = [DVec3::ZERO; 8];
            let s = 1e-4;
            let slope = (cell.energy_j(&material, &at(s)) - cell.energy_j(&material, &at(-s))) / (2.0 * s);
            let (forces, _) = cell.forces_n(&material, &y, &rest);
            let work: f64 = forces.iter().zip(a).map(|(f, a)| f.dot(a)).sum();
            assert!((slope + work).abs() < 1e-6 * work.abs(), "{slope} {work}");
            let (ahead, behind) =
                (cell.forces_n(&material, &at(s), &rest).0, cell.forces_n(&material, &at(-s), &rest).0);
            let products = cell.products_n(&material, &y, &a);
            for p in 0..8 {
                let slope = (ahead[p] - behind[p]) / (2.0 * s);
                assert!((slope - products[p]).length() < 1e-5 * products[p].length(), "{slope} {}", products[p]);
            }
        }
    }
}
