//! The model: constant after load.
use super::{ModelError, ModelSpec, State, sleep::SleepBound};
use crate::{
    bodies::{Body, MaterialPoint},
    contact::{ContactModel, ToolSpec},
    integrate::{Scheme, is_judged},
    mesh::Surface,
    settings::{LoadSpec, PrescribedSpec, Settings},
    tick::{Environment, EnvironmentSpec},
};
use glam::DVec3;

/// A body in its environment: loads, constraints and tools. Constant after [`Model::build`].
#[derive(Debug, Clone)]
pub struct Model {
    body: Body,
    environment: Environment,
    scheme: Scheme,
    sleep_bound: Option<SleepBound>,
}

impl Model {
    /// Checks the specification, precomputes all that the rest state fixes, and chooses the substeps.
    ///
    /// # Errors
    /// [`ModelError`], naming what is wrong; nothing is repaired silently.
    pub fn build(spec: ModelSpec) -> Result<Self, ModelError> {
        Self::build_with(spec, &mut |_| {})
    }

    /// The same; `progress` is told the part done of what takes long.
    ///
    /// # Errors
    /// As [`Self::build`].
    pub fn build_with(spec: ModelSpec, progress: &mut dyn FnMut(f64)) -> Result<Self, ModelError> {
        let ModelSpec { body, prescribed, loads, gravity_m_per_s2, tools, settings } = spec;
        let around = EnvironmentSpec { settings, prescribed, loads, gravity_m_per_s2, tools };
        let (body, environment) = Body::build(body, around, progress)?;
        let scheme = Scheme::build(&environment, &body);
        let sleep_bound =
            SleepBound::new(&environment, &body).map_err(|source| ModelError::Sleep { source: Box::new(source) })?;
        Ok(Self { body, environment, scheme, sleep_bound })
    }

    /// The body.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// What surrounds it.
    pub fn environment(&self) -> &Environment {
        &self.environment
    }

    /// Numerical settings.
    pub fn settings(&self) -> &Settings {
        &self.environment.settings
    }

    /// Tools.
    pub fn tools(&self) -> &[ToolSpec] {
        &self.environment.tools
    }

    /// Loads.
    pub fn loads(&self) -> &[LoadSpec] {
        &self.environment.loads
    }

    /// Prescribed displacements; of a hybrid body, with nodes in the middle of its coarse edges.
    pub fn prescribed(&self) -> &[PrescribedSpec] {
        &self.environment.prescribed
    }

    /// Gravity (m/s²).
    pub fn gravity_m_per_s2(&self) -> DVec3 {
        self.environment.gravity_m_per_s2
    }

    /// What tools touch and viewers see: the tets' boundary; of a hybrid body and of springs, their skin, whose vertices are their own
    /// nodes.
    pub fn surface(&self) -> &Surface {
        &self.environment.surface
    }

    /// Contact.
    pub fn contact(&self) -> &ContactModel {
        &self.environment.contact
    }

    /// Substeps per tick.
    pub fn substeps(&self) -> u32 {
        self.environment.steps.substeps
    }

    /// Substeps in a step of a hybrid body's coarse level.
    pub fn substeps_per_long_step(&self) -> u32 {
        self.environment.steps.substeps_per_long_step
    }

    /// Rest positions (m) of the nodes that masses and constraints are of.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        self.body.rest_positions_m()
    }

    /// Rest positions (m) of what the surface's nodes are numbered by.
    pub fn surface_rest_positions_m(&self) -> &[DVec3] {
        self.body.surface_rest_positions_m()
    }

    /// Where the surface is (m): writes one position for each of its vertices.
    pub fn surface_positions_m(&self, state: &State, positions_m: &mut Vec<DVec3>) {
        self.body.surface_positions_m(&self.environment, &state.body, &state.mechanical, positions_m);
    }

    /// How far (m) a point of the material has gone from rest.
    pub fn displacement_m(&self, state: &State, point: &MaterialPoint) -> DVec3 {
        self.body.displacement_m(&state.body, &state.mechanical, point)
    }

    pub(super) fn scheme(&self) -> &Scheme {
        &self.scheme
    }

    /// How near to rest the body is left alone; `None`: never.
    pub(super) fn sleep_bound(&self) -> Option<&SleepBound> {
        self.sleep_bound.as_ref()
    }

    /// Whether ticks whose step proves too long are taken back and repeated.
    pub(crate) fn is_judged(&self) -> bool {
        is_judged(&self.environment, self.body.can_be_judged())
    }
}
