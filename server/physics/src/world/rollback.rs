//! The state to which a tick that is refused or repeated goes back.
use super::{Model, State};
use crate::{
    contact::{ContactState, ToolState},
    integrate::StartOfTick,
    tick::{Ledger, MechanicalState, ViscousPower},
};
use glam::DVec3;

/// The state at the start of a tick, to which the tick may go back.
#[derive(Debug, Clone)]
pub(super) struct LastGood {
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    force_is_current: bool,
    contact: ContactState,
    tools: Vec<ToolState>,
    load_factors: Vec<f64>,
    ledger: Ledger,
    viscous: ViscousPower,
}

impl LastGood {
    pub(super) fn new(model: &Model) -> Self {
        let State { mechanical, .. } = State::at_rest(model);
        let MechanicalState { x, v, force_is_current, contact, tools, load_factors, ledger, viscous, .. } = mechanical;
        Self { x, v, force_is_current, contact, tools, load_factors, ledger, viscous }
    }

    /// Copies the state to which a quarantine goes back. Nothing is allocated.
    pub(super) fn keep(&mut self, state: &MechanicalState) {
        self.x.clone_from(&state.x);
        self.tools.clone_from_slice(&state.tools);
        self.load_factors.copy_from_slice(&state.load_factors);
        (self.ledger, self.viscous) = (state.ledger, state.viscous);
    }

    /// Copies what a tick of leapfrog changes besides, except its forces, so that the tick can be repeated. Nothing is
    /// allocated.
    pub(super) fn keep_for_repetition(&mut self, state: &MechanicalState) {
        self.v.clone_from(&state.v);
        self.force_is_current = state.force_is_current;
        self.contact.keep_memory_of(&state.contact);
    }

    /// Copies only the tools. Nothing is allocated.
    pub(super) fn keep_tools(&mut self, state: &MechanicalState) {
        self.tools.clone_from_slice(&state.tools);
    }

    pub(super) fn put_tools_back(&self, state: &mut MechanicalState) {
        state.tools.clone_from_slice(&self.tools);
    }

    /// Returns the positions, and the velocities where they were kept for a repetition.
    pub(super) fn start_of_tick(&self) -> StartOfTick<'_> {
        StartOfTick { x: &self.x, v: &self.v }
    }

    /// Puts everything back that [`Self::keep`] and [`Self::keep_for_repetition`] have copied.
    pub(super) fn put_all_back(&self, state: &mut MechanicalState) {
        self.put_back(state);
        state.v.copy_from_slice(&self.v);
        state.force_is_current = self.force_is_current;
        state.contact.copy_from(&self.contact);
    }

    pub(super) fn put_back(&self, state: &mut MechanicalState) {
        state.x.copy_from_slice(&self.x);
        state.tools.clone_from_slice(&self.tools);
        state.load_factors.copy_from_slice(&self.load_factors);
        (state.ledger, state.viscous) = (self.ledger, self.viscous);
    }
}
