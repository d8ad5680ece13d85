//! The model: constant after load.
mod kinds;

use super::{ModelError, ModelSpec, State};
use crate::{
    bodies::{
        hybrid::Hybrid,
        mass_spring::SpringBody,
        seed::{SeedModel, layer::Layer},
    },
    contact::{ContactModel, ToolState},
    elements::linear_tet::RestTet,
    integrate::{RestBound, Scheme},
    kernels::ForceKernel,
    material::Material,
    mesh::{Surface, TetMesh},
};
use glam::DVec3;

/// A body with its loads, constraints and tools. Constant after [`Model::build`].
#[derive(Debug, Clone)]
pub struct Model {
    spec: ModelSpec,
    surface: Surface,
    materials: Vec<Material>,
    rest_tets: Vec<RestTet>,
    mass_kg: Vec<f64>,
    inverse_mass_per_kg: Vec<DVec3>,
    kernel: ForceKernel,
    contact: ContactModel,
    max_natural_frequency_rad_per_s: f64,
    substeps: u32,
    substeps_per_long_step: u32,
    scheme: Scheme,
    rest_bound: Option<RestBound>,
    hybrid: Option<Box<Hybrid>>,
    seed: Option<Box<SeedModel>>,
    /// Of a seed body: rest positions (m) of core and skin.
    seed_rest_m: Vec<DVec3>,
    springs: Option<Box<SpringBody>>,
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
    pub fn build_with(mut spec: ModelSpec, progress: &mut dyn FnMut(f64)) -> Result<Self, ModelError> {
        if let Some(springs) = spec.springs.take() {
            return Self::of_springs(spec, springs);
        }
        let surface = Surface::of(&spec.mesh)?;
        match (spec.particles.clone(), spec.seed.clone()) {
            (None, None) => Self::of_tets(spec, surface, progress),
            (Some(particles), None) => Self::of_particles(spec, &surface, &particles, progress),
            (None, Some(seed)) => Self::of_seed(spec, seed),
            (Some(_), Some(_)) => Err(ModelError::NotForSeeds {
                what: "particles on a lattice",
                instead: "choose one of the two hybrids",
            }),
        }
    }

    /// What it was built from, but the springs, which [`Self::springs`] has.
    pub fn spec(&self) -> &ModelSpec {
        &self.spec
    }
    /// Rest mesh; of a hybrid body, the coarse one.
    pub fn mesh(&self) -> &TetMesh {
        &self.spec.mesh
    }
    /// What tools touch and viewers see: the mesh's boundary; of a hybrid body, its skin, whose vertices are their own nodes.
    pub fn surface(&self) -> &Surface {
        &self.surface
    }
    /// Rest positions (m) of what the surface's nodes are numbered by.
    pub fn surface_rest_positions_m(&self) -> &[DVec3] {
        match (&self.spec.particles, &self.springs) {
            (Some(particles), _) => particles.skin.positions_m(),
            (None, Some(springs)) => springs.model().rest_m(),
            (None, None) => self.rest_positions_m(),
        }
    }
    /// Where the surface is (m): writes one position for each of its vertices. Of a hybrid body, each is worked out from some particles.
    pub fn surface_positions_m(&self, state: &State, positions_m: &mut Vec<DVec3>) {
        positions_m.clear();
        if let (Some(body), Some(springs)) = (&self.springs, &state.springs) {
            let vertices = 0..self.surface.nodes.len() as u32;
            positions_m.extend(vertices.map(|vertex| body.vertex_m(&springs.motion, vertex, &state.x)));
            return;
        }
        match &self.hybrid {
            None => positions_m.extend(self.surface.nodes.iter().map(|&node| state.x[node as usize])),
            Some(hybrid) => {
                let rest = self.surface_rest_positions_m().iter().zip(0..);
                positions_m.extend(rest.map(|(rest_m, vertex)| hybrid.vertex_m(vertex, *rest_m, state)));
            }
        }
    }
    /// Rest positions (m) per node; of a hybrid body, of its coarse nodes; of a seed body, of its core's and then its skin's; of springs, of the coarse vertices.
    pub fn rest_positions_m(&self) -> &[DVec3] {
        if let Some(springs) = &self.springs {
            return &springs.model().rest_m()[..springs.model().vertices() as usize];
        }
        match &self.hybrid {
            None if self.seed.is_some() => &self.seed_rest_m,
            None => self.spec.mesh.positions_m(),
            Some(hybrid) => hybrid.partition().coarse().positions_m(),
        }
    }
    /// Rest positions (m) of the nodes that every state has: all of [`Self::rest_positions_m`], but of springs none, as they may sleep.
    pub fn always_awake_m(&self) -> &[DVec3] {
        if self.springs.is_some() { &[] } else { self.rest_positions_m() }
    }
    /// The mass-spring surface, where the body is one.
    pub fn springs(&self) -> Option<&SpringBody> {
        self.springs.as_deref()
    }
    /// The particles, where there are some.
    pub fn hybrid(&self) -> Option<&Hybrid> {
        self.hybrid.as_deref()
    }
    /// The papers' hybrid, where the body is one.
    pub fn seed(&self) -> Option<&SeedModel> {
        self.seed.as_deref()
    }
    /// Particles, awake or not.
    pub fn particle_count(&self) -> usize {
        let of_seed = self.seed().and_then(SeedModel::layer).map_or(0, Layer::particle_count);
        self.hybrid().map_or(of_seed, |hybrid| hybrid.partition().particle_count())
    }
    /// Most particles awake at once.
    pub fn most_awake_particles(&self) -> usize {
        let of_seed = self.seed().map_or(0, SeedModel::most_awake);
        self.spec.particles.as_ref().map_or(of_seed, |particles| particles.most_active)
    }
    /// How far particles are apart (m); 0 where there are none.
    pub fn particle_spacing_m(&self) -> f64 {
        let of_seed = self.seed().and_then(SeedModel::layer).map_or(0.0, |layer| layer.voxels.spacing_m);
        self.spec.particles.as_ref().map_or(of_seed, |particles| particles.spacing_m)
    }
    /// Rest data of every tet.
    pub fn rest_tets(&self) -> &[RestTet] {
        &self.rest_tets
    }
    /// Material of a tet.
    pub fn material_of(&self, tet: usize) -> &Material {
        &self.materials[self.spec.tet_region[tet] as usize]
    }
    /// Lumped mass (kg) per node.
    pub fn mass_kg(&self) -> &[f64] {
        &self.mass_kg
    }
    /// `1/m` (1/kg) per node and axis, zero where prescribed.
    pub fn inverse_mass_per_kg(&self) -> &[DVec3] {
        &self.inverse_mass_per_kg
    }
    /// The force kernel of the tets; of a hybrid body, of none.
    pub fn kernel(&self) -> &ForceKernel {
        &self.kernel
    }
    /// Contact.
    pub fn contact(&self) -> &ContactModel {
        &self.contact
    }
    /// Gravity (m/s²).
    pub fn gravity_m_per_s2(&self) -> DVec3 {
        self.spec.gravity_m_per_s2
    }
    /// Largest natural frequency (rad/s) at rest.
    pub fn max_natural_frequency_rad_per_s(&self) -> f64 {
        self.max_natural_frequency_rad_per_s
    }
    pub(super) fn tools_at_start(&self) -> Vec<ToolState> {
        self.spec.tools.iter().map(ToolState::at_start).collect()
    }
    pub(crate) fn scheme(&self) -> &Scheme {
        &self.scheme
    }
    /// How near to rest the body is left alone; `None`: never.
    pub(crate) fn rest_bound(&self) -> Option<&RestBound> {
        self.rest_bound.as_ref()
    }
    /// Substeps per tick.
    pub fn substeps(&self) -> u32 {
        self.substeps
    }
    /// Substeps in a step of a hybrid body's coarse level.
    pub fn substeps_per_long_step(&self) -> u32 {
        self.substeps_per_long_step
    }
}
