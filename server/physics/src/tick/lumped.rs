//! Drift, kick and damping of nodes with lumped masses, and their entries in the ledger.
use super::MechanicalState;
use crate::{lanes::vector_operations, settings::PrescribedSpec};
use glam::DVec3;

/// Lumped masses of all nodes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LumpedMass<'a> {
    /// Mass (kg) per node.
    pub(crate) mass_kg: &'a [f64],
    /// Inverse mass `1/m` (1/kg) per node and axis, zero where the displacement is prescribed.
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
    /// Prescribed displacements.
    pub(crate) prescribed: &'a [PrescribedSpec],
}

/// Moves the nodes by `x ← x + dt v`. Returns an upper bound (m/s) of their speeds.
pub(crate) fn drift(state: &mut MechanicalState, dt_s: f64) -> f64 {
    vector_operations::drift(&mut state.x, &state.v, dt_s)
}

/// Returns the power (W) of the holders' reactions, which are `−f` on prescribed axes; a kick does not change the
/// velocity there.
pub(crate) fn holders_power_w(prescribed: &[PrescribedSpec], forces_n: &[DVec3], v: &[DVec3]) -> f64 {
    let mut power_w = 0.0;
    for set in prescribed {
        let held = DVec3::from(set.axes.map(|axis| f64::from(u8::from(axis))));
        for &node in &set.nodes {
            power_w -= forces_n[node as usize].dot(held * v[node as usize]);
        }
    }
    power_w
}

impl LumpedMass<'_> {
    /// Gives the nodes a kick of length `h`, `v ← (v e^{−c h/2} + h f/m) e^{−c h/2}` with the mass damping `c` (1/s),
    /// and adds its work and dissipation to the ledger. Damping takes `½ (1 − e^{−c h}) m v²` of the velocity before
    /// the force and as much of that after it.
    pub(crate) fn kick(&self, damping_per_s: f64, state: &mut MechanicalState, h_s: f64) {
        let mut power_w = DVec3::ZERO;
        let nodes = state.v.iter_mut().zip(&state.force_n).zip(self.inverse_mass_per_kg).zip(&state.external_n);
        if damping_per_s > 0.0 {
            let factor = (-0.5 * damping_per_s * h_s).exp();
            let mut twice_kinetic_j = [DVec3::ZERO; 2];
            for ((((v, force), inverse_mass), external), mass) in nodes.zip(self.mass_kg) {
                let held = inverse_mass.cmpeq(DVec3::ZERO);
                let (factor, mass) = (
                    DVec3::select(held, DVec3::ONE, DVec3::splat(factor)),
                    DVec3::select(held, DVec3::ZERO, DVec3::splat(*mass)),
                );
                twice_kinetic_j[0] += *v * *v * mass;
                let damped = *v * factor;
                let change = *force * *inverse_mass * h_s;
                power_w += *external * (damped + change * 0.5);
                let kicked = damped + change;
                twice_kinetic_j[1] += kicked * kicked * mass;
                *v = kicked * factor;
            }
            let taken = -(-damping_per_s * h_s).exp_m1();
            state.ledger.dissipated_j += 0.5 * taken * (twice_kinetic_j[0] + twice_kinetic_j[1]).element_sum();
        } else {
            for (((v, force), inverse_mass), external) in nodes {
                let change = *force * *inverse_mass * h_s;
                power_w += *external * (*v + change * 0.5);
                *v += change;
            }
        }
        state.ledger.external_work_j += h_s * power_w.element_sum();
        state.ledger.dissipated_j += h_s * state.viscous.work_rate_w();
        state.ledger.external_work_j += h_s * self.holders_power_w(&state.force_n, &state.v);
    }

    /// Returns the power (W) of the holders' reactions.
    pub(crate) fn holders_power_w(&self, forces_n: &[DVec3], v: &[DVec3]) -> f64 {
        holders_power_w(self.prescribed, forces_n, v)
    }

    /// Multiplies the velocities on free axes by a factor; the ledger counts the energy that this takes as dissipated.
    pub(crate) fn damp(&self, state: &mut MechanicalState, factor: f64) {
        let mut taken_j = 0.0;
        for ((v, inverse_mass), mass) in state.v.iter_mut().zip(self.inverse_mass_per_kg).zip(self.mass_kg) {
            let damped = DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), *v, *v * factor);
            taken_j += 0.5 * mass * (v.length_squared() - damped.length_squared());
            *v = damped;
        }
        state.ledger.dissipated_j += taken_j;
    }
}
