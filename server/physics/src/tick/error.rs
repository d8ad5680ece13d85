//! Why a body cannot have the surroundings that are asked for.
use glam::DVec3;
use std::fmt;
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
    /// The scene needs more substeps than a tick may have.
    #[error(
        "{asked_by} needs {substeps:.3e} substeps per tick (largest natural frequency {omega_rad_per_s:.3e} rad/s); {}, or shorten the \
         tick (limit {limit})",
        asked_by.advice()
    )]
    TooStiff {
        /// That without which there would be few enough, or the body.
        asked_by: AskedBy,
        /// Number of substeps needed.
        substeps: f64,
        /// Largest natural frequency ω_max (rad/s).
        omega_rad_per_s: f64,
        /// Largest number of substeps allowed.
        limit: u32,
    },
}

/// What asks for too many substeps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AskedBy {
    /// The body's stiffness over its mass.
    Body,
    /// Its viscosity.
    Viscosity,
    /// Tools: their couplings, and contact on their masses.
    Tools,
}

impl AskedBy {
    fn advice(self) -> &'static str {
        match self {
            Self::Body => "coarsen or improve the mesh, soften the material",
            Self::Viscosity => "lower the viscosity, which is large for so soft a material or so fine a mesh",
            Self::Tools => "give tools on springs more mass_kg or less stiffness_n_per_m",
        }
    }
}

impl fmt::Display for AskedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Body => "the body",
            Self::Viscosity => "the viscosity of the body",
            Self::Tools => "a tool on its spring",
        })
    }
}

fn point(p: DVec3) -> String {
    format!("({:.4}, {:.4}, {:.4}) m", p.x, p.y, p.z)
}
