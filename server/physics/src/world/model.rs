//! The model, which does not change after it is loaded.
use super::{ModelError, ModelSpec, State, sleep::SleepBound};
use crate::{
    bodies::{Body, MaterialPoint},
    contact::{ContactModel, SelfContact, ToolSpec},
    integrate::{Scheme, is_judged},
    mesh::Surface,
    settings::{LoadSpec, PrescribedSpec, Settings},
    tick::{Environment, EnvironmentSpec},
};
use glam::DVec3;

/// A body in its environment of loads, constraints and tools. It does not change after [`Model::build`].
#[derive(Debug, Clone)]
pub struct Model {
    body: Body,
    environment: Environment,
    scheme: Scheme,
    sleep_bound: Option<SleepBound>,
}

impl Model {
    /// Checks the specification, computes everything that the rest state fixes, and chooses the substeps.
    ///
    /// # Errors
    /// [`ModelError`], naming what is wrong; nothing is repaired silently.
    pub fn build(spec: ModelSpec) -> Result<Self, ModelError> {
        Self::build_with(spec, &mut |_| {})
    }

    /// Does the same as [`Self::build`], and calls `progress` with the fraction that is done of what takes long.
    ///
    /// # Errors
    /// The same as of [`Self::build`].
    pub fn build_with(spec: ModelSpec, progress: &mut dyn FnMut(f64)) -> Result<Self, ModelError> {
        let ModelSpec { body, prescribed, loads, gravity_m_per_s2, tools, settings } = spec;
        let around = EnvironmentSpec { settings, prescribed, loads, gravity_m_per_s2, tools };
        let (body, environment) = Body::build(body, around, progress)?;
        let scheme = Scheme::build(&environment, &body);
        let sleep_bound =
            SleepBound::new(&environment, &body).map_err(|source| ModelError::Sleep { source: Box::new(source) })?;
        Ok(Self { body, environment, scheme, sleep_bound })
    }

    /// Returns the body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Returns the body's surroundings.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// Returns the numerical settings.
    pub fn settings(&self) -> &Settings {
        &self.environment.settings
    }

    /// Returns the tools.
    pub fn tools(&self) -> &[ToolSpec] {
        &self.environment.tools
    }

    /// Returns the loads.
    pub fn loads(&self) -> &[LoadSpec] {
        &self.environment.loads
    }

    /// Returns the prescribed displacements; those of a hybrid body include nodes in the middle of its coarse edges.
    pub fn prescribed(&self) -> &[PrescribedSpec] {
        &self.environment.prescribed
    }

    /// Returns gravity (m/s²).
    pub fn gravity_m_per_s2(&self) -> DVec3 {
        self.environment.gravity_m_per_s2
    }

    /// Returns the surface that tools touch and viewers see: the tets' boundary, or the skin of a hybrid body or of
    /// springs, whose vertices are numbered by themselves.
    pub fn surface(&self) -> &Surface {
        &self.environment.surface
    }

    /// Returns the contact model.
    pub fn contact(&self) -> &ContactModel {
        &self.environment.contact
    }

    /// Returns the number of substeps per tick.
    pub fn substeps(&self) -> u32 {
        self.environment.steps.substeps
    }

    /// Returns how many times as many substeps a tick has as it would have without viscosity.
    pub fn substeps_for_viscosity(&self) -> f64 {
        self.environment.steps.for_viscosity
    }

    /// Returns the number of substeps in a step of a hybrid body's coarse level.
    pub fn substeps_per_long_step(&self) -> u32 {
        self.environment.steps.substeps_per_long_step
    }

    /// Returns the rest positions (m) of the nodes that have masses and constraints.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        self.body.rest_positions_m()
    }

    /// Returns the rest positions (m) of the nodes that the surface refers to.
    pub fn surface_rest_positions_m(&self) -> &[DVec3] {
        self.body.surface_rest_positions_m()
    }

    /// Writes the position (m) of each of the surface's vertices into `positions_m`.
    pub fn surface_positions_m(&self, state: &State, positions_m: &mut Vec<DVec3>) {
        self.body.surface_positions_m(&self.environment, &state.body, &state.mechanical, positions_m);
    }

    /// Returns the displacement (m) of a point of the material from rest.
    pub fn displacement_m(&self, state: &State, point: &MaterialPoint) -> DVec3 {
        self.body.displacement_m(&state.body, &state.mechanical, point)
    }

    /// Returns whether walls of the body press each other where they meet.
    pub fn has_self_contact(&self) -> bool {
        self.contact().walls().is_some()
    }

    /// Returns the number of triangles that walls are made of, which are fewer than the surface's where it is cut more finely than what moves
    /// it; 0 where walls pass through each other.
    pub fn wall_triangles(&self) -> usize {
        self.contact().walls().map_or(0, |walls| walls.triangles().len())
    }

    /// Returns the number of the surface's vertices that press no walls, because the body lies against itself there at
    /// rest.
    pub fn vertices_against_themselves(&self) -> usize {
        self.contact().walls().map_or(0, SelfContact::left_out)
    }

    pub(super) fn scheme(&self) -> &Scheme {
        &self.scheme
    }

    /// Returns the bound of the distance to rest below which the body sleeps, or `None` where it never sleeps.
    pub(super) fn sleep_bound(&self) -> Option<&SleepBound> {
        self.sleep_bound.as_ref()
    }

    /// Returns whether ticks whose step proves too long are taken back and repeated.
    pub(crate) fn is_judged(&self) -> bool {
        is_judged(&self.environment, self.body.can_be_judged())
    }
}
