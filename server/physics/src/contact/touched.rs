//! Finds the triangle of the surface that is touched.
use super::{ContactModel, ContactScratch, ContactState};

impl ContactModel {
    /// Returns the triangle of the surface that the hardest pressed tool is nearest to; `None` where no tool has any of
    /// the surface inside it. The buffers must be those with which contact was evaluated last.
    pub(crate) fn touched_triangle(&self, contact: &ContactState, scratch: &ContactScratch) -> Option<u32> {
        let touching = (0..self.tools.len()).filter(|&tool| contact.touches(tool));
        let force_sq = |tool: usize| contact.tools[tool].force_n.length_squared();
        let hardest = touching.reduce(|a, b| if force_sq(b) > force_sq(a) { b } else { a })?;
        Some(self.triangles.surface_triangle[scratch.tools[hardest].nearest])
    }
}
