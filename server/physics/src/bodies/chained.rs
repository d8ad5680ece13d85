//! Which bits of a body's own a hash is of ([`Chain`]).
use super::{Body, BodyState, mass_spring::SpringModel};
use crate::{hash::Chain, settings::PrescribedSpec, tick::free_inverse_mass};

impl Body {
    /// Adds `1/m` (1/kg) of every node and axis, zero where it is prescribed.
    pub(crate) fn chain_inverse_mass(&self, prescribed: &[PrescribedSpec], chain: &mut Chain) {
        match self {
            Self::Tet(body) => chain.vectors(body.inverse_mass_per_kg()),
            Self::Hybrid(body) => chain.vectors(body.inverse_mass_per_kg()),
            Self::MassSpring(_) => {
                // A node that is prescribed twice is refused when the model is built.
                chain.vectors(&free_inverse_mass(self.mass_kg(), prescribed).unwrap_or_default());
            }
            Self::Seed(body) => chain.vectors(body.inverse_mass_per_kg()),
        }
    }

    /// Adds what of its rest state no function that every body has tells.
    pub(crate) fn chain(&self, chain: &mut Chain) {
        if let Self::MassSpring(body) = self {
            springs(body.model(), chain);
        }
    }
}

impl BodyState {
    /// Adds all of it.
    pub(crate) fn chain(&self, chain: &mut Chain) {
        match self {
            Self::Tet => {}
            Self::Hybrid(own) => own.chain(chain),
            Self::MassSpring(own) => own.chain(chain),
            Self::Seed(own) => own.chain(chain),
        }
    }
}

fn springs(model: &SpringModel, chain: &mut Chain) {
    chain.reals(&model.spec().mass_kg);
    for constants in [model.spec().coarse, model.spec().fine] {
        chain.real(constants.mesh_n_per_m);
        chain.real(constants.anchor_n_per_m);
    }
    chain.wholes(&model.spec().held);
}
