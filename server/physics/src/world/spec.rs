//! What a model is built from.
use crate::LoadSpec;
use crate::PrescribedSpec;
use crate::Settings;
use crate::{
    bodies::{hybrid::ParticleSpec, mass_spring::SpringBodySpec, seed::SeedBodySpec},
    contact::ToolSpec,
    material::Material,
    mesh::TetMesh,
};
use glam::DVec3;

/// A material and density shared by some tets.
#[derive(Debug, Clone, PartialEq)]
pub struct Region {
    /// Name for messages.
    pub name: String,
    /// Constitutive law and constants.
    pub material: Material,
    /// Density (kg/m³).
    pub density_kg_per_m3: f64,
}

/// Everything a [`Model`] is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    /// Rest mesh; of a hybrid body, the coarse one.
    pub mesh: TetMesh,
    /// Particles that make it a hybrid body. Its surface is their skin: loads are at the skin's vertices and triangles.
    pub particles: Option<ParticleSpec>,
    /// Makes its tets the core of the papers' hybrid; there is one material then, and what is prescribed is held.
    pub seed: Option<SeedBodySpec>,
    /// Makes it a mass-spring surface: its mesh has no tets then ([`TetMesh::of_points`]), it has no materials, and what is prescribed is held.
    pub springs: Option<SpringBodySpec>,
    /// Materials.
    pub regions: Vec<Region>,
    /// Region of each tet.
    pub tet_region: Vec<u16>,
    /// Prescribed displacements; a node's axis may be prescribed once.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
    /// Numerical settings.
    pub settings: Settings,
}
