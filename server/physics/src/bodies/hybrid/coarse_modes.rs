//! The lowest natural frequency of the coarse level, while all particles sleep.
//!
//! A coarse tet at the body's boundary may hold next to nothing of the body. Its nodes can then move, together, so that no material
//! moves and nothing resists: a mode of 0.0006 Hz on a ventricle whose first is 3.3 Hz. What it moves of the material is told by its
//! part of the consistent masses,
//! ```text
//! q = Σ_p m_p |Σ_i ζ_pi φ_i|²        φᵀ M φ = 1
//! ```
//! 0.1 to 1 of a body's modes, and 1e-10 of such ones. They are not felt, and not counted.
use super::body::HybridBody;
use crate::{
    elements::{
        free_axes::{FreeAxes, NONE},
        natural_modes::{Mode, ModesError, lowest_modes},
    },
    linalg::cholesky::LowerTriangle,
};
use glam::DVec3;
use std::f64::consts::TAU;

/// Number of modes among which the lowest that is felt is looked for.
const MODES: usize = 8;
/// `q` up to which a mode is not felt.
const UNFELT: f64 = 1e-6;

/// The lowest modes of the coarse level.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CoarseModes {
    /// `ω₁` (rad/s) of the lowest one that is felt; infinite where no node may move.
    pub(super) lowest_rad_per_s: f64,
    /// Shapes `φ` (1/√kg) of those below it.
    pub(super) unfelt: Vec<Vec<DVec3>>,
}

impl HybridBody {
    /// Returns the lowest modes.
    ///
    /// # Errors
    /// The coarse level is not held, or its lowest modes are not found.
    pub(super) fn coarse_modes(&self) -> Result<CoarseModes, ModesError> {
        let mut modes = self.sleeping_modes(MODES)?;
        // Where none of them is felt, the lowest is as good as any, and nothing will be found at rest.
        let first_felt = modes
            .iter()
            .position(|mode| self.particles_kinetic_share(&mode.shape_per_sqrt_kg) > UNFELT)
            .unwrap_or_default();
        let lowest_rad_per_s = modes.get(first_felt).map_or(f64::INFINITY, |mode| TAU * mode.frequency_hz);
        let unfelt = modes.drain(..first_felt).map(|mode| mode.shape_per_sqrt_kg).collect();
        Ok(CoarseModes { lowest_rad_per_s, unfelt })
    }

    /// Returns the `count` lowest modes of the coarse level, ascending, with the masses that are lumped on its nodes.
    ///
    /// # Errors
    /// It is not held, or its lowest modes are not found.
    pub fn sleeping_modes(&self, count: usize) -> Result<Vec<Mode>, ModesError> {
        if let Some(part) = self.first_free_part() {
            return Err(ModesError::UnderConstrained(part));
        }
        let free = self.inverse_mass_per_kg.iter().map(|inverse_mass| inverse_mass.cmpne(DVec3::ZERO));
        let axes = FreeAxes::numbered(free);
        lowest_modes(&self.coarse_stiffness(&axes), &axes, &self.masses.node_kg, count)
    }

    /// Returns `q` of a mode's shape (1/√kg): the kinetic energy of the particles, where the coarse nodes move so, over that
    /// of the lumped masses. With the former, the mode's frequency would be nearly `1/√q` times as high.
    pub fn particles_kinetic_share(&self, shape_per_sqrt_kg: &[DVec3]) -> f64 {
        let of_particle = |(particle, mass): (u32, &f64)| {
            mass * self.partition.anchor(particle).of(shape_per_sqrt_kg).length_squared()
        };
        (0..).zip(&self.masses.particle_kg).map(of_particle).sum()
    }

    /// Returns `K = Σ_e K_e` (N/m) at rest over free axes, column after column of each residual element: `K_e a` of a unit `a`.
    fn coarse_stiffness(&self, axes: &FreeAxes) -> LowerTriangle {
        let at_rest_m = self.rest_positions_m();
        let mut entries = Vec::new();
        let (mut unit, mut product) = (vec![DVec3::ZERO; at_rest_m.len()], vec![DVec3::ZERO; at_rest_m.len()]);
        for (tet, residual) in self.partition.residual_elements().iter().enumerate() {
            let material = self.material_of_tet(tet as u32);
            for &node in &residual.nodes {
                for (axis, &column) in
                    axes.number[node as usize].iter().enumerate().filter(|(_, column)| **column != NONE)
                {
                    unit[node as usize][axis] = 1.0;
                    residual.add_products_n(material, at_rest_m, &unit, &mut product);
                    unit[node as usize][axis] = 0.0;
                    for &other in &residual.nodes {
                        let minus_n_per_m = std::mem::take(&mut product[other as usize]).to_array();
                        for (&row, minus) in axes.number[other as usize].iter().zip(minus_n_per_m) {
                            if row != NONE && row >= column {
                                entries.push(([column, row], -minus));
                            }
                        }
                    }
                }
            }
        }
        LowerTriangle::summed(axes.count, entries)
    }
}
