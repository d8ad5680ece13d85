//! Which elements of a state are strained the most.
use super::{Model, Scratch, State};
use crate::elements::{linear_tet::VolumeRatio, strained::Strained};

/// Returns the smallest `J = det F` over all tets, or of a hybrid body over the means of coarse tets and the awake
/// cells. A surface of springs has none.
pub fn min_volume_ratio(model: &Model, state: &State) -> Option<VolumeRatio> {
    strained(model, state).map(|strained| strained.volume)
}

/// Returns the elements that are strained the most, by the same elements as [`min_volume_ratio`].
pub fn strained(model: &Model, state: &State) -> Option<Strained> {
    let mut found = Strained::nothing();
    model.body().each_gradient(&state.body, &state.mechanical.x, &mut |f, law, tet| found.look_at(f, law, tet));
    found.volume.ratio.is_finite().then_some(found)
}

/// Returns the same of a state that [`crate::step`] left with these buffers, to rounding. Of a hybrid body they have the
/// awake cells ready, which [`strained`] makes anew: that takes longer than a tick.
pub fn strained_in(model: &Model, state: &State, scratch: &mut Scratch) -> Option<Strained> {
    let mut found = Strained::nothing();
    let each = &mut |f: &_, law, tet| found.look_at(f, law, tet);
    model.body().each_gradient_in(&state.body, &mut scratch.body, &state.mechanical.x, each);
    found.volume.ratio.is_finite().then_some(found)
}
