//! The integrator of a model with all that its rest state fixes.
use super::{
    forces::Tick,
    leapfrog,
    seed_semi_implicit::{self, NodalImplicit, nodal_stiffness_n_per_m},
    seed_verlet,
};
use crate::{
    integrate::spectrum::RestStiffness,
    world::{Integrator, Scratch, State},
};
use glam::DVec3;

/// An integrator, ready to run.
#[derive(Debug, Clone)]
pub(crate) enum Scheme {
    Leapfrog,
    SeedVerlet,
    SeedSemiImplicit(NodalImplicit),
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
                Self::SeedSemiImplicit(NodalImplicit::new(&nodal, body.inverse_mass_per_kg, body.mass_kg, body.dt_s))
            }
        }
    }

    /// All substeps of a tick.
    pub(super) fn run(&self, tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
        match self {
            Self::Leapfrog => leapfrog::run(tick, state, scratch),
            Self::SeedVerlet => seed_verlet::run(tick, state, scratch),
            Self::SeedSemiImplicit(nodal) => seed_semi_implicit::run(tick, nodal, state, scratch),
        }
    }
}
