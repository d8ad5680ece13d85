//! Ticks of a seed body: the papers' own steps, with contact, loads and injected forces as their external forces.
//!
//! ```text
//! f at t        from the last step: what tools, loads and injections do to the surface's vertices, and the triangle that tools touch
//! step          region of that triangle, forces, motion, exchange, surface (`seed::step`)
//! f at t + dt   tools follow, contact is evaluated anew
//! ```
//! The touched triangle is the one nearest to the centre of the tool that is pressed hardest, while samples of the
//! surface are inside that tool. Without tools it stays what it is set to.
//!
//! Ledger: forces work along the displacement of their vertices. What the scheme, viscosity and exchange dissipate is
//! not known.
use super::{AtVertex, SeedBody, SeedBodyState, SeedContact, SeedModel, SeedScratch};
use crate::{
    contact::ContactScratch,
    tick::{Environment, Evaluation, KindState, MechanicalState, Stepped, Tick, touch_nodes},
};
use glam::DVec3;

/// A seed body with its own state and buffers, while it is stepped.
#[derive(Debug)]
pub(crate) struct SteppedSeed<'a> {
    pub(crate) body: &'a SeedBody,
    pub(crate) own: &'a mut SeedBodyState,
    pub(crate) scratch: &'a mut SeedBodyScratch,
}

/// Buffers, which are allocated once.
#[derive(Debug, Clone)]
pub(crate) struct SeedBodyScratch {
    step: SeedScratch,
    /// External forces on vertices that have one.
    forces_n: Vec<AtVertex>,
    /// The state at the tick's start.
    last_good: SeedBodyState,
}

impl SeedBodyScratch {
    /// Returns buffers for a model.
    pub(crate) fn new(seed: &SeedModel) -> Self {
        Self {
            step: SeedScratch::new(seed),
            forces_n: Vec::with_capacity(seed.surface_rest_m().len()),
            last_good: SeedBodyState::of(seed),
        }
    }
}

impl<'a> Stepped<'a> for SteppedSeed<'a> {
    /// Works out what tools, loads and injections do to nodes; its steps make the other forces.
    fn evaluate(
        &mut self,
        tick: &Tick<'_>,
        now: &Evaluation,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        touch_nodes(tick, now, self.body.rest_positions_m(), state, contact);
    }

    /// Does nothing: its own steps move it.
    fn kick(&mut self, _: &Environment, _: &mut MechanicalState, _: f64, _: bool) {}

    fn reaction_n(&self, node: usize, state: &MechanicalState) -> DVec3 {
        let held = self.body.inverse_mass_per_kg()[node].cmpeq(DVec3::ZERO);
        DVec3::select(held, -state.force_n[node], DVec3::ZERO)
    }

    fn run_own_scheme(&mut self, tick: &Tick<'_>, state: &mut MechanicalState, contact: &mut ContactScratch) {
        if !state.force_is_current {
            state.contact.forget_untracked_geometry();
            self.evaluate(tick, &Evaluation::at_start(), state, contact);
            self.note_touch(tick, state, contact);
        }
        for number in 1..=tick.substeps {
            let fastest_m_per_s = self.advance(tick, state);
            self.evaluate(tick, &tick.after_substep(number, fastest_m_per_s), state, contact);
            self.note_touch(tick, state, contact);
        }
    }

    fn keep_last_good(&mut self) {
        self.scratch.last_good.copy_from(self.own);
    }

    fn stop_at_last_good(&mut self) {
        self.own.copy_from(&self.scratch.last_good);
        self.own.stop();
    }

    fn is_finite(&self) -> bool {
        self.own.is_finite()
    }
}

impl SteppedSeed<'_> {
    fn note_touch(&mut self, tick: &Tick<'_>, state: &MechanicalState, contact: &ContactScratch) {
        if !state.tools.is_empty() {
            self.own.touched = tick.environment.contact.touched_triangle(&state.contact, contact);
        }
    }

    /// Takes one step. Returns an upper bound (m/s) of the speed with which any node came to where it is, including
    /// nodes that are put there.
    fn advance(&mut self, tick: &Tick<'_>, state: &mut MechanicalState) -> f64 {
        let Self { body, own, scratch } = self;
        let MechanicalState { x, v, force_n, external_n, ledger, .. } = state;
        let SeedBodyScratch { step, forces_n, .. } = &mut **scratch;
        forces_n.clear();
        for (vertex, &node) in tick.environment.surface.nodes.iter().enumerate() {
            let value = external_n[node as usize];
            if value != DVec3::ZERO {
                forces_n.push(AtVertex { vertex: vertex as u32, value });
            }
        }
        let contact = SeedContact { triangle: own.touched, forces_n, displaced_m: &[] };
        let report = body.model().step(&mut own.now, step, &contact);
        own.awake = report.particles_touched;
        let of_core = step.core_forces_n();
        force_n[..of_core.len()].copy_from_slice(of_core);
        force_n[of_core.len()..].copy_from_slice(&external_n[of_core.len()..]);
        let now = &own.now;
        let mut farthest_sq = 0.0_f64;
        for (node, at) in now.core.x.iter().chain(&now.skin.x).enumerate() {
            let by = *at - x[node];
            ledger.external_work_j += external_n[node].dot(by);
            farthest_sq = farthest_sq.max(by.length_squared());
            x[node] = *at;
        }
        v.iter_mut().zip(now.core.v.iter().chain(&now.skin.v)).for_each(|(v, of)| *v = *of);
        farthest_sq.sqrt() / tick.dt_s()
    }
}
