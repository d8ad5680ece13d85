//! The specification from which a model is built.
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
    /// Prescribed displacements; each axis of a node may be prescribed once. Prescribed nodes of springs and of the
    /// papers' hybrid are held.
    pub prescribed: Vec<PrescribedSpec>,
    /// Loads on nodes of the surface, or on any nodes of a body of tetrahedra alone.
    pub loads: Vec<LoadSpec>,
    /// Gravity (m/s²).
    pub gravity_m_per_s2: DVec3,
    /// Tools.
    pub tools: Vec<ToolSpec>,
    /// Numerical settings.
    pub settings: Settings,
}
