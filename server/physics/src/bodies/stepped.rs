//! How a body is stepped, whichever kind it is.
use super::{SteppedBody, of_kind};
use crate::{
    contact::ContactScratch,
    tick::{Evaluation, MechanicalState, Stepped, Tick},
};
use std::ops::{Deref, DerefMut};

impl<'a> Deref for SteppedBody<'a> {
    type Target = dyn Stepped<'a> + 'a;

    fn deref(&self) -> &Self::Target {
        of_kind!(SteppedBody, self, body => body)
    }
}

impl DerefMut for SteppedBody<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        of_kind!(SteppedBody, self, body => body)
    }
}

impl SteppedBody<'_> {
    /// Works forces out at the start of a tick, unless the last tick left them.
    pub(crate) fn make_force_current(
        &mut self,
        tick: &Tick<'_>,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        if !state.force_is_current {
            state.contact.forget_untracked_geometry();
            self.evaluate(tick, &Evaluation::at_start(), state, contact);
        }
    }
}
