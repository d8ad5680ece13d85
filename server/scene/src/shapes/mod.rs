//! Built-in bodies: box, sphere and ellipsoid shells, the truncated-ellipsoid ventricle, and the seeds' models.
//!
//! Shells are layers of prisms over one triangulation of the wall's middle surface, so that a coarse mesh still has a
//! whole number of layers through the wall. All lengths in metres, z is the long axis, the apex lies at negative z.
mod block;
mod rings;
pub mod seeds;
mod shell;

pub use block::box_mesh;
pub use shell::{ellipsoid_shell, sphere_shell, ventricle};
pub(crate) use shell::{ellipsoid_shell_skin, graded, layers_for, sphere_shell_skin, ventricle_skin};

use palpate_physics::{MeshError, TetMesh};
use std::collections::BTreeSet;
use thiserror::Error;

/// A body with its named boundary parts.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// The tetrahedra.
    pub mesh: TetMesh,
    /// Named parts of the boundary: `inner`, `outer`, `base` for shells; `x_min`, `x_max`, … `z_max` for a box.
    pub regions: Vec<BoundaryRegion>,
    /// Prism layers through the wall; 0 for a box.
    pub layers: u32,
}

impl Shape {
    /// The boundary part of this name.
    pub fn region(&self, name: &str) -> Option<&BoundaryRegion> {
        self.regions.iter().find(|region| region.name == name)
    }
}

/// A named part of a mesh's boundary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoundaryRegion {
    /// Its name.
    pub name: &'static str,
    /// Boundary triangles as node indices, counter-clockwise seen from outside the body.
    pub triangles: Vec<[u32; 3]>,
}

impl BoundaryRegion {
    /// Nodes of the region, ascending.
    pub fn nodes(&self) -> Vec<u32> {
        self.triangles.iter().flatten().copied().collect::<BTreeSet<u32>>().into_iter().collect()
    }
}

/// Why a shape cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ShapeError {
    /// A length, count or position outside its range.
    #[error("{name} = {value}: {rule}")]
    Parameter {
        /// Name of the parameter, with its unit.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it must satisfy.
        rule: String,
    },
    /// No mesh of about the wanted count exists.
    #[error("no {shape} of about {wanted} tets can be built; the nearest has {nearest}")]
    Count {
        /// The shape.
        shape: &'static str,
        /// Tets asked for.
        wanted: u32,
        /// Tets of the nearest possible mesh.
        nearest: u32,
    },
    /// The mesh built is bad.
    #[error("the {shape} is too thin or too distorted for this number of tets: {source}")]
    Mesh {
        /// The shape.
        shape: &'static str,
        /// What is wrong with it.
        source: MeshError,
    },
}

fn check(name: &'static str, value: f64, ok: bool, rule: impl Into<String>) -> Result<(), ShapeError> {
    if ok && value.is_finite() { Ok(()) } else { Err(ShapeError::Parameter { name, value, rule: rule.into() }) }
}
