//! How far a body with lumped masses is from rest at most, now and later.
//!
//! Near an equilibrium `x*` the body obeys `M δẍ + C δẋ + K δx = 0`, `δx = x − x*`, with `C` of viscous stress and mass damping. The energy
//! `½ v·M v + ½ δx·K δx` does not grow, and `K ≥ ω₁² M` with the lowest natural frequency `ω₁`. So with the residual `r = −K δx` on free axes:
//! ```text
//! ω₁² ‖M^½ δx(t)‖² ≤ δx(t)·K δx(t) ≤ ‖M^½ v‖² + r·K⁻¹ r ≤ ‖M^½ v‖² + ‖M^-½ r‖²/ω₁²
//! |δx_i(t)| ≤ (‖M^-½ r‖/ω₁² + ‖M^½ v‖/ω₁)/√m_min         of every node, now and later                           (1)
//! ```
//! The force that is at hand is `f = r − C_v v`, with the viscous stress' part. `C_v ≤ τ K` with the largest ratio `τ` of viscosity to stiffness, so
//! `‖M^-½ r‖ ≤ ‖M^-½ f‖ + τ ω_max² ‖M^½ v‖`: a viscous body that creeps is not taken for one at rest.
//!
//! Modes `φ` that move next to none of the material are left out, if the body names any: `ω₁` is the lowest of the others, and with
//! `φ·Mφ = 1` the squares above are less by `(φ·Mv)²` and `(φ·f)²`.
//!
//! `ω₁` is that of the body at rest; a load that softens it (towards buckling) makes (1) too small by the square of the ratio of
//! frequencies.
use super::relaxation_time_s;
use crate::material::Material;
use glam::DVec3;

/// Masses of a body's nodes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct NodeMasses<'a> {
    /// Lumped mass (kg) of every node.
    pub(crate) mass_kg: &'a [f64],
    /// `1/m` (1/kg) per node and axis, zero where prescribed.
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
}

/// Natural frequencies of a body at rest.
#[derive(Debug, Clone)]
pub(crate) struct NaturalBand {
    /// `ω₁` (rad/s); infinite where no node may move.
    pub(crate) lowest_rad_per_s: f64,
    /// `ω_max` (rad/s).
    pub(crate) highest_rad_per_s: f64,
    /// Shapes `φ` (1/√kg) of the modes that are left out.
    pub(crate) left_out: Vec<Vec<DVec3>>,
}

/// Part of a square that is lost where most of it is taken away.
const LOST: f64 = 1e-12;

/// The constants of (1).
#[derive(Debug, Clone)]
pub(crate) struct RestBound {
    lowest_rad_per_s: f64,
    /// `τ ω_max²` (1/s).
    viscous_per_s: f64,
    root_of_smallest_mass: f64,
    left_out: Vec<Vec<DVec3>>,
}

impl RestBound {
    /// Returns them.
    pub(crate) fn new(nodes: NodeMasses<'_>, band: NaturalBand, materials: &[Material]) -> Self {
        let free = |inverse_mass: &&DVec3| **inverse_mass != DVec3::ZERO;
        let largest = nodes.inverse_mass_per_kg.iter().filter(free).map(|m| m.max_element()).fold(0.0, f64::max);
        let relaxation_s = materials.iter().map(relaxation_time_s).fold(0.0, f64::max);
        Self {
            lowest_rad_per_s: band.lowest_rad_per_s,
            viscous_per_s: relaxation_s * band.highest_rad_per_s.powi(2),
            root_of_smallest_mass: largest.sqrt().recip(),
            left_out: band.left_out,
        }
    }

    /// Returns the right side of (1) (m) of nodes with these forces (N) and velocities (m/s).
    pub(crate) fn distance_m(
        &self,
        nodes: NodeMasses<'_>,
        force_n: impl Fn(usize) -> DVec3,
        v: impl Fn(usize) -> DVec3,
    ) -> f64 {
        let NodeMasses { mass_kg, inverse_mass_per_kg } = nodes;
        let all = || 0..mass_kg.len();
        let [residual_sq, speed_sq] = all().fold([0.0; 2], |[residual_sq, speed_sq], node| {
            let force = force_n(node);
            let of_force = (force * force).dot(inverse_mass_per_kg[node]);
            [residual_sq + of_force, speed_sq + mass_kg[node] * v(node).length_squared()]
        });
        let along_sq = |shape: &[DVec3]| {
            let of_force: f64 = all().map(|node| shape[node].dot(force_n(node))).sum();
            let of_momentum: f64 = all().map(|node| shape[node].dot(v(node)) * mass_kg[node]).sum();
            [of_force, of_momentum].map(|along| along * along)
        };
        let left = self.left_out.iter().fold([residual_sq, speed_sq], |[residual_sq, speed_sq], shape| {
            let [of_force, of_momentum] = along_sq(shape);
            [residual_sq - of_force, speed_sq - of_momentum]
        });
        let speed = left[1].max(LOST * speed_sq).sqrt();
        let residual = left[0].max(LOST * residual_sq).sqrt() + self.viscous_per_s * speed;
        let omega = self.lowest_rad_per_s;
        (residual / (omega * omega) + speed / omega) / self.root_of_smallest_mass
    }
}
