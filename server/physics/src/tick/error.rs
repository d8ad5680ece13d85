//! Why a body cannot have the surroundings that are asked for.
use glam::DVec3;
use thiserror::Error;

/// Why a body cannot have the surroundings that are asked for.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EnvironmentError {
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
