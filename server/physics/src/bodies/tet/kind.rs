//! What a body of tetrahedra is as a kind of body.
use super::{TetBody, TetElements, TetSpec, natural_modes};
use crate::{
    elements::{natural_modes::ModesError, solid::Solid},
    hash::{Chain, Fnv},
    material::Law,
    mesh::{Surface, TetMesh},
    settings::PrescribedSpec,
    tick::{BodyKind, Energies, Environment, KindSpec, KindState, MechanicalState, NaturalBand, RestBound},
};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::{f64::consts::TAU, fmt::Write};

impl KindSpec for TetSpec {
    fn solid(&self) -> Option<&Solid> {
        Some(&self.solid)
    }

    fn solid_mut(&mut self) -> Option<&mut Solid> {
        Some(&mut self.solid)
    }
}

impl BodyKind for TetBody {
    type State = TetState;

    fn rest_positions_m(&self) -> &[DVec3] {
        self.mesh().positions_m()
    }

    fn mass_kg(&self) -> &[f64] {
        self.mass_kg()
    }

    fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s()
    }

    fn energies(&self, gravity_m_per_s2: DVec3, _: &TetState, state: &MechanicalState) -> Energies {
        let MechanicalState { x, v, ledger, .. } = state;
        let (mass_kg, rest_m) = (self.mass_kg(), self.rest_positions_m());
        let kinetic_j = (0..x.len()).map(|i| 0.5 * mass_kg[i] * v[i].length_squared()).sum();
        let fallen_j: f64 = (0..x.len()).map(|i| mass_kg[i] * gravity_m_per_s2.dot(x[i] - rest_m[i])).sum();
        Energies {
            kinetic_j,
            elastic_j: self.elastic_energy_j(x),
            gravitational_j: 0.0 - fallen_j,
            external_work_j: ledger.external_work_j,
            dissipated_j: ledger.dissipated_j,
        }
    }

    fn fingerprint_into(&self, hash: &mut Fnv) {
        // A float prints as the shortest text that reads back to its bits. Writing to the hash cannot fail.
        let _ = write!(hash, "tet {:?}", self.solid());
        if self.elements() != TetElements::Linear {
            let _ = write!(hash, " {:?}", self.elements());
        }
    }

    fn tets(&self) -> Option<&TetMesh> {
        Some(self.mesh())
    }

    fn filling_tets(&self) -> Option<&Solid> {
        Some(self.solid())
    }

    fn can_be_judged(&self) -> bool {
        true
    }

    fn rest_bound(&self, surface: &Surface) -> Result<Option<RestBound>, ModesError> {
        // Without a free node there is no mode, and nothing that could move.
        let lowest = natural_modes(self, surface, 1)?.first().map_or(f64::INFINITY, |mode| TAU * mode.frequency_hz);
        let band = NaturalBand {
            lowest_rad_per_s: lowest,
            highest_rad_per_s: self.max_natural_frequency_rad_per_s(),
            left_out: Vec::new(),
        };
        Ok(Some(RestBound::new(self.node_masses(), band, self.materials())))
    }

    fn distance_from_rest_m(&self, bound: &RestBound, _: &TetState, state: &MechanicalState) -> f64 {
        bound.distance_m(self.node_masses(), |node| state.force_n[node], |node| state.v[node])
    }

    fn each_gradient(&self, _: &TetState, x: &[DVec3], each: &mut dyn FnMut(&DMat3, Law, usize)) {
        for (tet, (nodes, rest)) in self.mesh().tets().iter().zip(self.rest_tets()).enumerate() {
            each(&rest.gradient_of(&nodes.map(|n| x[n as usize])), self.material_of(tet).law, tet);
        }
    }

    fn chain_inverse_mass(&self, _: &[PrescribedSpec], chain: &mut Chain) {
        chain.vectors(self.inverse_mass_per_kg());
    }
}

/// What a tick changes of a body of tetrahedra beside [`MechanicalState`]: nothing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TetState;

impl KindState for TetState {
    type Body = TetBody;

    fn at_rest(_: &TetBody, _: &Environment) -> Self {
        Self
    }

    fn reset(&mut self, _: &TetBody) {}

    fn copy_from(&mut self, _: &Self) {}

    fn fits(&self, _: &TetBody, _: &Environment, _: &MechanicalState) -> bool {
        true
    }

    fn chain(&self, _: &mut Chain) {}
}
