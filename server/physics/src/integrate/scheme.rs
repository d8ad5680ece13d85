//! The integrator of a model with all that its rest state fixes.
use super::{
    backward_euler,
    forces::Tick,
    leapfrog, seed_body,
    seed_semi_implicit::{self, NodalImplicit},
    seed_verlet,
};
use crate::elements::rest_stiffness::{RestStiffness, nodal_stiffness_n_per_m};
use crate::linalg::pcg::PcgScratch;
use crate::{
    contact::ContactTangents,
    material::{Lame, Law, Material, Viscosity},
    settings::Integrator,
    world::{Model, Scratch, State},
};
use glam::DVec3;

/// An integrator, ready to run.
#[derive(Debug, Clone)]
pub(crate) enum Scheme {
    Leapfrog,
    SeedVerlet,
    SeedSemiImplicit(NodalImplicit),
    BackwardEuler(NodalImplicit),
    /// The steps of a seed body.
    Seed,
}

/// What it is made for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Body<'a> {
    pub(crate) at_rest: RestStiffness<'a>,
    pub(crate) mass_kg: &'a [f64],
    /// Zero on held axes.
    pub(crate) inverse_mass_per_kg: &'a [DVec3],
    /// Step (s).
    pub(crate) dt_s: f64,
}

impl Scheme {
    pub(crate) fn build(integrator: Integrator, body: &Body<'_>) -> Self {
        match integrator {
            Integrator::Leapfrog => Self::Leapfrog,
            Integrator::SeedVerlet => Self::SeedVerlet,
            Integrator::SeedSemiImplicit => {
                let nodal = nodal_stiffness_n_per_m(&body.at_rest);
                Self::SeedSemiImplicit(NodalImplicit::new(&nodal, None, body))
            }
            Integrator::BackwardEuler => {
                let nodal = nodal_stiffness_n_per_m(&body.at_rest);
                let as_elastic: Vec<Material> = body.at_rest.materials.iter().map(viscosity_as_stiffness).collect();
                let viscous = nodal_stiffness_n_per_m(&RestStiffness { materials: &as_elastic, ..body.at_rest });
                Self::BackwardEuler(NodalImplicit::new(&nodal, Some(&viscous), body))
            }
        }
    }

    /// All substeps of a tick.
    pub(super) fn run(&self, tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
        match self {
            Self::Leapfrog => leapfrog::run(tick, state, scratch),
            Self::SeedVerlet => seed_verlet::run(tick, state, scratch),
            Self::SeedSemiImplicit(nodal) => seed_semi_implicit::run(tick, nodal, state, scratch),
            Self::BackwardEuler(nodal) => backward_euler::run(tick, nodal, state, scratch),
            Self::Seed => seed_body::run(tick, state, scratch),
        }
    }
}

/// A material that at rest answers strain as this one's viscosity answers its rate: λ = φ, µ = ψ.
fn viscosity_as_stiffness(material: &Material) -> Material {
    let Viscosity { phi_pa_s, psi_pa_s } = material.viscosity;
    Material { lame: Lame { lambda_pa: phi_pa_s, mu_pa: psi_pa_s }, law: Law::StVenantKirchhoff, ..*material }
}

/// Buffers of implicit schemes; empty for others.
#[derive(Debug, Clone, Default)]
pub(crate) struct ImplicitScratch {
    pub(super) pcg: PcgScratch,
    pub(super) tangents: ContactTangents,
    /// Products with the matrix since this scratch was made.
    pub(crate) products: u64,
}

impl ImplicitScratch {
    pub(crate) fn new(model: &Model) -> Self {
        match model.spec().settings.integrator {
            Integrator::BackwardEuler => Self {
                pcg: PcgScratch::new(model.mass_kg().len()),
                tangents: ContactTangents::new(model.contact()),
                products: 0,
            },
            _ => Self::default(),
        }
    }
}
