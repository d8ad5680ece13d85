//! Why a model cannot be built.
use crate::{
    bodies::{hybrid::HybridError, mass_spring::SpringBodyError, seed::SeedError},
    material::ParameterError,
    mesh::MeshError,
    statics::SolveError,
};
use glam::DVec3;
use thiserror::Error;

/// Why a model cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// The mesh's boundary is bad.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// An index points nowhere.
    #[error("{what} {index} is out of range: there are {count}")]
    OutOfRange {
        /// What is indexed.
        what: &'static str,
        /// The index.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// Lengths that must agree do not.
    #[error("tet_region has {found} entries for {expected} tets")]
    RegionCount {
        /// Entries given.
        found: usize,
        /// Tets in the mesh.
        expected: usize,
    },
    /// A material's constants are impossible.
    #[error("region \"{region}\": {source}")]
    Material {
        /// Name of the region.
        region: String,
        /// Which constant and why.
        source: ParameterError,
    },
    /// A setting outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// A body that cannot tell how near to rest it is.
    #[error(
        "whether a body may sleep follows from its lowest natural frequency, which it has where it is held (or let it never sleep)"
    )]
    Sleep {
        /// Why there is none.
        source: Box<SolveError>,
    },
    /// Two prescriptions for one degree of freedom.
    #[error("node {node} is prescribed along axis {axis} by both \"{first}\" and \"{second}\"")]
    PrescribedTwice {
        /// Node.
        node: u32,
        /// `x`, `y` or `z`.
        axis: char,
        /// First set.
        first: String,
        /// Second set.
        second: String,
    },
    /// A triangle of the surface is too large for a tool to be felt between its contact samples.
    #[error(
        "tool \"{tool}\" (radius {radius_m} m) is too small for the surface: triangle {triangle}, at {}, is {size_m:.4} m long, and at \
         most {largest_m:.4} m can be sampled; refine the surface there or take a larger tool", point(*centre_m)
    )]
    SurfaceTooCoarse {
        /// Name of the tool.
        tool: String,
        /// Its radius (m).
        radius_m: f64,
        /// Index of the triangle in the surface.
        triangle: usize,
        /// Its centroid (m).
        centre_m: DVec3,
        /// Its longest edge (m).
        size_m: f64,
        /// The longest that this tool allows (m).
        largest_m: f64,
    },
    /// A capsule where there may only be spheres.
    #[error("tool \"{tool}\" is a capsule, and a capsule cannot press {what}: make it a sphere")]
    SpheresOnly {
        /// Name of the tool.
        tool: String,
        /// What it cannot press.
        what: &'static str,
    },
    /// The particles cannot be made.
    #[error(transparent)]
    Hybrid(#[from] HybridError),
    /// The papers' hybrid cannot be made.
    #[error(transparent)]
    Seed(#[from] SeedError),
    /// The mass-spring surface cannot be made.
    #[error(transparent)]
    Springs(#[from] SpringBodyError),
    /// A seed body cannot have it.
    #[error("a body of the papers' hybrid (seed) cannot have {what}: {instead}")]
    NotForSeeds {
        /// What.
        what: &'static str,
        /// What to do.
        instead: &'static str,
    },
    /// A tool's coupling and contact, as a mass on springs, need a shorter step than the body's.
    #[error(
        "the tools' couplings need steps of {longest_s:.2e} s at most, and the seed body takes {dt_s:.2e} s: make them softer or the tools \
         heavier, take rigid tools, or shorten its step"
    )]
    CouplingTooStiff {
        /// The body's step (s).
        dt_s: f64,
        /// The longest that couplings bear (s).
        longest_s: f64,
    },
    /// More substeps than any tick can bear.
    #[error(
        "the body needs {substeps:.3e} substeps per tick (largest natural frequency {omega_rad_per_s:.3e} rad/s); \
         coarsen or improve the mesh, soften the material, or lengthen the tick (limit {limit})"
    )]
    TooStiff {
        /// Substeps needed.
        substeps: f64,
        /// ω_max (rad/s).
        omega_rad_per_s: f64,
        /// Largest number allowed.
        limit: u32,
    },
}

fn point(p: DVec3) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", p.x, p.y, p.z)
}
