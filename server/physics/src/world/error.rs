//! Why a model cannot be built.
use crate::mesh::MeshError;
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
    /// More substeps than any tick can bear.
    #[error(
        "the body needs {substeps} substeps per tick (largest natural frequency {omega_rad_per_s:.3e} rad/s); \
         coarsen or improve the mesh, soften the material, or lengthen the tick (limit {limit})"
    )]
    TooStiff {
        /// Substeps needed.
        substeps: u64,
        /// ω_max (rad/s).
        omega_rad_per_s: f64,
        /// Largest number allowed.
        limit: u32,
    },
}
