//! Energy ledger, inversion, and quarantine of non-finite state.
use crate::world::{Model, State};
use serde::{Deserialize, Serialize};

/// What only time integration knows: work and dissipation since reset (J).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ledger {
    /// Work done on the body by tools, loads, injected forces and prescribed motion (J).
    pub external_work_j: f64,
    /// Energy taken by viscous stress and mass damping (J).
    pub dissipated_j: f64,
}

/// The ledger with the energies of a state (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energies {
    /// `Σ ½ m v²`.
    pub kinetic_j: f64,
    /// `Σ V Ψ(F)`.
    pub elastic_j: f64,
    /// `−Σ m g·(x − X)`.
    pub gravitational_j: f64,
    /// See [`Ledger::external_work_j`].
    pub external_work_j: f64,
    /// See [`Ledger::dissipated_j`].
    pub dissipated_j: f64,
}

impl Energies {
    /// Kinetic, elastic and gravitational energy now (O(tets)), beside the ledger's work and dissipation.
    pub fn of(model: &Model, state: &State) -> Self {
        let kinetic_j = (0..state.x.len()).map(|i| 0.5 * model.mass_kg()[i] * state.v[i].length_squared()).sum();
        let gravitational_j = (0..state.x.len())
            .map(|i| -model.mass_kg()[i] * model.gravity_m_per_s2().dot(state.x[i] - model.rest_positions_m()[i]))
            .sum();
        Self {
            kinetic_j,
            elastic_j: elastic_energy_j(model, state),
            gravitational_j,
            external_work_j: state.ledger.external_work_j,
            dissipated_j: state.ledger.dissipated_j,
        }
    }

    /// `K + U + G`: what the body holds (J).
    pub fn held_j(&self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }

    /// `K + U + G − W + D` (J): constant in exact arithmetic and exact time.
    pub fn balance_j(&self) -> f64 {
        self.held_j() - self.external_work_j + self.dissipated_j
    }
}

/// `Σ V Ψ(F)` (J).
pub fn elastic_energy_j(model: &Model, state: &State) -> f64 {
    (0..model.mesh().tets().len())
        .map(|tet| {
            let corners = model.mesh().tets()[tet].map(|n| state.x[n as usize]);
            model.rest_tets()[tet].energy_j(model.material_of(tet), &corners)
        })
        .sum()
}

/// Smallest `J = det F` over all tets, and its tet. Below zero: inverted.
pub fn min_volume_ratio(model: &Model, state: &State) -> (f64, usize) {
    let mut worst = (f64::INFINITY, 0);
    for (tet, nodes) in model.mesh().tets().iter().enumerate() {
        let corners = nodes.map(|n| state.x[n as usize]);
        let j = model.rest_tets()[tet].gradient_of(&corners).determinant();
        if j < worst.0 {
            worst = (j, tet);
        }
    }
    worst
}

/// A state that became non-finite: it was put back to the last good tick, and stays there until reset or restore.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quarantine {
    /// Tick whose result was refused.
    pub tick: u64,
    /// First node that was not finite.
    pub node: u32,
}

/// First node whose position or velocity is not finite.
pub fn first_non_finite(state: &State) -> Option<u32> {
    // One pass of additions: a sum is finite only if every term is (overflow of finite terms is caught as well).
    let sum: glam::DVec3 = state.x.iter().zip(&state.v).map(|(x, v)| *x + *v).sum();
    if sum.is_finite() {
        return None;
    }
    let node = state.x.iter().zip(&state.v).position(|(x, v)| !x.is_finite() || !v.is_finite());
    Some(node.unwrap_or(0) as u32)
}
