//! Loads and constraints.
use glam::DVec3;

/// A load at factor 1; every tick scales it ([`TickInput::load_factors`]).
#[derive(Debug, Clone, PartialEq)]
pub enum LoadSpec {
    /// Forces on nodes (N, world).
    NodalForces(Vec<(u32, DVec3)>),
    /// Dead traction on surface triangles (Pa, world), per rest area.
    Traction {
        /// Surface triangle indices.
        triangles: Vec<u32>,
        /// Traction (Pa).
        traction_pa: DVec3,
    },
    /// Pressure on surface triangles (Pa, positive pushes inwards).
    Pressure {
        /// Surface triangle indices.
        triangles: Vec<u32>,
        /// Pressure (Pa).
        pressure_pa: f64,
        /// Follows the deformed surface, or acts as at rest (dead).
        follower: bool,
    },
}

/// Nodes whose displacement is prescribed along some axes ([`TickInput::prescribed_displacements_m`]); fixed ones are prescribed zero.
#[derive(Debug, Clone, PartialEq)]
pub struct PrescribedSpec {
    /// Name for reactions.
    pub name: String,
    /// Nodes.
    pub nodes: Vec<u32>,
    /// Which of x, y, z are prescribed.
    pub axes: [bool; 3],
    /// Whether what is prescribed is always zero, so that sets of different axes hold what lies between them together.
    pub is_fixed: bool,
}
