//! What a model is built from.
use crate::{
    bodies::BodySpec,
    contact::ToolSpec,
    settings::{LoadSpec, PrescribedSpec, Settings},
};
use glam::DVec3;

/// Everything a [`crate::Model`] is built from.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelSpec {
    /// The body.
    pub body: BodySpec,
    /// Prescribed displacements; a node's axis may be prescribed once. Of springs and of the papers' hybrid what is prescribed is held.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads, on nodes of the surface or, of a body of tetrahedra alone, on any.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
    /// Numerical settings.
    pub settings: Settings,
}
