//! The integrator of a model, with all that the rest state fixes of it.
use super::{
    ForceHistory, backward_euler, leapfrog,
    seed_semi_implicit::{self, NodalImplicit},
    seed_verlet,
};
use crate::{
    bodies::{Body, SteppedBody, tet::TetBody},
    contact::ContactScratch,
    elements::rest_stiffness::nodal_stiffness_n_per_m,
    material::Material,
    settings::Integrator,
    tick::{Environment, MechanicalState, Tick},
};

/// An integrator, ready to run.
#[derive(Debug, Clone)]
pub(crate) enum Scheme {
    Leapfrog,
    SeedVerlet,
    /// Of a body of tetrahedra alone.
    SeedSemiImplicit(NodalImplicit),
    /// Of a body of tetrahedra alone.
    BackwardEuler(NodalImplicit),
    /// The body's own steps.
    OfBody,
}

impl Scheme {
    /// That of the settings, for a body.
    pub(crate) fn build(environment: &Environment, body: &Body) -> Self {
        let settings = &environment.settings;
        let dt_s = settings.tick_period_s / f64::from(environment.steps.substeps);
        if body.has_own_scheme() {
            return Self::OfBody;
        }
        match (settings.integrator, body.as_tet()) {
            (Integrator::SeedVerlet, _) => Self::SeedVerlet,
            (Integrator::SeedSemiImplicit, Some(body)) => Self::SeedSemiImplicit(nodal_implicit(body, dt_s)),
            (Integrator::BackwardEuler, Some(body)) => {
                let (points, nodes) = (body.points(), body.mass_kg().len());
                let viscous = nodal_stiffness_n_per_m(&points.with_materials(Material::viscosity_as_stiffness), nodes);
                let nodal = nodal_stiffness_n_per_m(points, nodes);
                Self::BackwardEuler(NodalImplicit::new(&nodal, Some(&viscous), body, dt_s))
            }
            // Other bodies refuse other integrators as they are built.
            (Integrator::Leapfrog | Integrator::SeedSemiImplicit | Integrator::BackwardEuler, _) => Self::Leapfrog,
        }
    }

    /// All substeps of a tick.
    pub(crate) fn run(
        &self,
        tick: &Tick<'_>,
        body: &mut SteppedBody<'_>,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
        history: &mut ForceHistory,
    ) {
        match (self, body) {
            (Self::OfBody, body) => body.run_own_scheme(tick, state, contact),
            (Self::SeedSemiImplicit(nodal), SteppedBody::Tet(body)) => {
                seed_semi_implicit::run(tick, nodal, body, state, contact);
            }
            (Self::BackwardEuler(nodal), SteppedBody::Tet(body)) => {
                backward_euler::run(tick, nodal, body, state, contact);
            }
            (Self::SeedVerlet, body) => seed_verlet::run(tick, body, state, contact),
            (_, body) => leapfrog::run(tick, body, state, contact, history),
        }
    }
}

fn nodal_implicit(body: &TetBody, dt_s: f64) -> NodalImplicit {
    NodalImplicit::new(&nodal_stiffness_n_per_m(body.points(), body.mass_kg().len()), None, body, dt_s)
}
