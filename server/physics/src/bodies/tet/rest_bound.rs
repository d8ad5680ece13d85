//! How far a body of tetrahedra is from rest at most, now and later.
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
//! `ω₁` is that of the body at rest; a load that softens it (towards buckling) makes (1) too small by the square of the ratio of
//! frequencies.
use super::{ModesError, TetBody, natural_modes};
use crate::{
    mesh::Surface,
    tick::{MechanicalState, relaxation_time_s},
};
use glam::DVec3;
use std::f64::consts::TAU;

/// The constants of (1).
#[derive(Debug, Clone, Copy)]
pub(crate) struct RestBound {
    lowest_rad_per_s: f64,
    /// `τ ω_max²` (1/s).
    viscous_per_s: f64,
    root_of_smallest_mass: f64,
}

impl RestBound {
    /// Finds them for a body with this surface.
    ///
    /// # Errors
    /// A body that is not held, or whose modes are not found.
    pub(crate) fn new(body: &TetBody, surface: &Surface) -> Result<Self, ModesError> {
        let free = |inverse_mass: &&DVec3| **inverse_mass != DVec3::ZERO;
        let largest = body.inverse_mass_per_kg().iter().filter(free).map(|m| m.max_element()).fold(0.0, f64::max);
        // Without a free node there is no mode, and nothing that could move.
        let lowest = natural_modes(body, surface, 1)?.first().map_or(f64::INFINITY, |mode| TAU * mode.frequency_hz);
        let relaxation_s = body.materials().iter().map(relaxation_time_s).fold(0.0, f64::max);
        Ok(Self {
            lowest_rad_per_s: lowest,
            viscous_per_s: relaxation_s * body.max_natural_frequency_rad_per_s().powi(2),
            root_of_smallest_mass: largest.sqrt().recip(),
        })
    }

    /// The right side of (1) (m).
    pub(crate) fn distance_m(&self, body: &TetBody, state: &MechanicalState) -> f64 {
        let (mut residual_sq, mut speed_sq) = (0.0, 0.0);
        for (((force, v), mass), inverse_mass) in
            state.force_n.iter().zip(&state.v).zip(body.mass_kg()).zip(body.inverse_mass_per_kg())
        {
            residual_sq += (*force * *force).dot(*inverse_mass);
            speed_sq += mass * v.length_squared();
        }
        let (omega, speed) = (self.lowest_rad_per_s, speed_sq.sqrt());
        let residual = residual_sq.sqrt() + self.viscous_per_s * speed;
        (residual / (omega * omega) + speed / omega) / self.root_of_smallest_mass
    }
}
