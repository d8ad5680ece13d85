//! Why a seed model cannot be built.
use crate::{elements::solid::SolidError, mesh::MeshError, tick::EnvironmentError};
use thiserror::Error;

/// Why a seed model cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SeedError {
    /// The core's regions or their constants are wrong.
    #[error(transparent)]
    Solid(#[from] SolidError),
    /// Settings, constraints, loads or tools are wrong.
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    /// A seed body cannot have something.
    #[error("a body of the papers' hybrid (seed) cannot have {what}: {instead}")]
    NotForSeeds {
        /// What it cannot have.
        what: &'static str,
        /// What to do instead.
        instead: &'static str,
    },
    /// A tool on its coupling and in contact, a mass on springs, needs a shorter step than the body's.
    #[error(
        "the tools' couplings need steps of {longest_s:.2e} s at most, and the seed body takes {dt_s:.2e} s: make them softer or the tools \
         heavier, take rigid tools, or shorten its step"
    )]
    CouplingTooStiff {
        /// The body's step (s).
        dt_s: f64,
        /// Longest step (s) with which couplings are stable.
        longest_s: f64,
    },
    /// The core's boundary is no valid surface.
    #[error("the core: {0}")]
    Core(#[from] MeshError),
    /// A parameter is outside its range.
    #[error("{name} = {value}: {rule}")]
    Parameter {
        /// Its name, with its unit.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// An index is out of range.
    #[error("{what} names {index}, but there are only {count} (counting from 0)")]
    OutOfRange {
        /// What names it.
        what: &'static str,
        /// The index.
        index: u32,
        /// Number of what it may name.
        count: usize,
    },
    /// A triangle does not face away from the mass centre.
    #[error(
        "triangle {triangle} of the {surface} does not face away from the mass centre: the papers project along rays from it, so \
         every ray must leave the {surface} once; use a shape like a shell between ellipsoids"
    )]
    NotStarShaped {
        /// Which surface.
        surface: &'static str,
        /// Index of the triangle.
        triangle: usize,
    },
    /// The skin is not closed.
    #[error("the skin is not closed: {edges} of its edges do not belong to two triangles; close it, without holes")]
    Open {
        /// Number of edges that are open.
        edges: usize,
    },
    /// There is no room for the particles.
    #[error(
        "between core and skin there are {found} voxels for {wanted} particles (layer {volume_m3:e} m³); make the skin larger than \
         the core, or ask for more particles"
    )]
    NoLayer {
        /// Number of voxels found.
        found: usize,
        /// Number of particles wanted.
        wanted: u32,
        /// Volume (m³) between core and skin.
        volume_m3: f64,
    },
    /// A region has no particles.
    #[error(
        "no particle lies under triangle {triangle} of the skin and its neighbours; ask for more particles or fewer triangles"
    )]
    EmptyRegion {
        /// Index of the triangle.
        triangle: usize,
    },
}
