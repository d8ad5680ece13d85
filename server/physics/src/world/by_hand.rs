//! Waking of particles and refinement by hand, for experiments and tests.
use super::{Model, Scratch, State};
use crate::bodies::SteppedBody;

/// Makes the given particles of a hybrid body active and no others, as tools would. Particles that were active keep
/// their motion, and those that wake start as the coarse nodes have moved them. Particles that may not wake, and those
/// for which there is no room, are left out. Bodies of other kinds have no particles that wake.
pub fn wake_only(model: &Model, state: &mut State, scratch: &mut Scratch, particles: impl IntoIterator<Item = u32>) {
    let State { mechanical, body: own, .. } = state;
    if let Some(mut body) = SteppedBody::of(model.body(), own, &mut scratch.body) {
        body.wake_only(model.environment(), mechanical, &mut particles.into_iter());
    }
}

/// Refines `rings` rings around the vertices `centres` of a mass-spring surface and nothing else, where it is refined
/// by hand ([`crate::bodies::mass_spring::Refining::ByHand`]). As with tools, levels change from tick to tick.
/// Triangles for which there is no room are left out. Bodies of other kinds are not refined.
pub fn refine_only(model: &Model, state: &mut State, centres: &[u32], rings: u32) {
    state.body.refine_only(model.body(), centres, rings);
}
