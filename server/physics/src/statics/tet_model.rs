//! A body of tetrahedra in its environment: what its equilibrium is sought of.
use crate::{bodies::tet::TetBody, elements::free_axes::FreeAxes, tick::Environment};
use glam::BVec3;

/// A body of tetrahedra in its environment.
#[derive(Debug, Clone, Copy)]
pub(super) struct TetModel<'a> {
    pub(super) body: &'a TetBody,
    pub(super) environment: &'a Environment,
}

impl TetModel<'_> {
    /// Free axes of a configuration: the body's, then those of coupled tools.
    pub(super) fn free_axes(self) -> FreeAxes {
        let Environment { tools, contact, .. } = self.environment;
        let of_tools = (0..tools.len()).map(|tool| BVec3::splat(contact.spring(tool).is_some()));
        FreeAxes::numbered(self.body.free().chain(of_tools))
    }
}
