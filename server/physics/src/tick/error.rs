//! Why a body cannot have the surroundings that are asked for.
use glam::DVec3;
use thiserror::Error;

/// Why a body cannot have the surroundings that are asked for.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum EnvironmentError {
    /// An index is out of range.
    #[error("{what} {index} is out of range: there are {count}")]
    OutOfRange {
        /// What is indexed.
        what: &'static str,
        /// The index.
        index: usize,
        /// Number of what may be indexed.
        count: usize,
    },
    /// A setting is outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// Two sets prescribe one degree of freedom.
    #[error("node {node} is prescribed along axis {axis} by both \"{first}\" and \"{second}\"")]
    PrescribedTwice {
        /// The node.
        node: u32,
        /// Axis `x`, `y` or `z`.
        axis: char,
        /// Name of the first set.
        first: String,
        /// Name of the second set.
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
        /// The longest edge that this tool allows (m).
        largest_m: f64,
    },
    /// A tool is a capsule where only spheres are possible.
    #[error("tool \"{tool}\" is a capsule, and a capsule cannot press {what}: make it a sphere")]
    SpheresOnly {
        /// Name of the tool.
        tool: String,
        /// What it cannot press.
        what: &'static str,
    },
    /// The body needs more substeps than a tick may have.
    #[error(
        "the body needs {substeps:.3e} substeps per tick (largest natural frequency {omega_rad_per_s:.3e} rad/s); \
         coarsen or improve the mesh, soften the material, or lengthen the tick (limit {limit})"
    )]
    TooStiff {
        /// Number of substeps needed.
        substeps: f64,
        /// Largest natural frequency ω_max (rad/s).
        omega_rad_per_s: f64,
        /// Largest number of substeps allowed.
        limit: u32,
    },
}

fn point(p: DVec3) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", p.x, p.y, p.z)
}
