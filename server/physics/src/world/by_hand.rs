//! Waking and refining by hand, for experiments and tests.
use super::{Model, Scratch, State};
use crate::bodies::SteppedBody;

/// Wakes these particles of a hybrid body and no others, as tools would: what was active goes on, what wakes moves as the coarse nodes
/// have moved it. Particles that may not wake, and those for which there is no room, are left out. Other bodies have none.
pub fn wake_only(model: &Model, state: &mut State, scratch: &mut Scratch, particles: impl IntoIterator<Item = u32>) {
    let State { mechanical, body: own, .. } = state;
    if let Some(mut body) = SteppedBody::of(model.body(), own, &mut scratch.body) {
        body.wake_only(model.environment(), mechanical, &mut particles.into_iter());
    }
}

/// Refines so many rings around vertices of a mass-spring surface and nothing else, where it is refined by hand
/// ([`crate::bodies::mass_spring::Refining::ByHand`]): as with tools, levels go there from tick to tick. What there is no room for is
/// left out. Other bodies are not refined.
pub fn refine_only(model: &Model, state: &mut State, centres: &[u32], rings: u32) {
    state.body.refine_only(model.body(), centres, rings);
}
