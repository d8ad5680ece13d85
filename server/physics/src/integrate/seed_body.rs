//! Ticks of a seed body: the papers' own steps, with contact, loads and injected forces as their external forces.
//!
//! ```text
//! f at t        from the last step: what tools, loads and injections do to the surface's vertices, and the triangle that tools touch
//! step          region of that triangle, forces, motion, exchange, surface (`seed::step`)
//! f at t + dt   tools follow, contact is looked at anew
//! ```
//! Which triangle is touched: the one nearest to the centre of the tool that is pressed hardest, as long as samples of the surface are
//! inside it. Without tools it stays what it is set to.
//!
//! Ledger: forces work along what their vertices went. What the scheme, viscosity and exchange take is not known.
use super::forces::Tick;
use crate::{
    bodies::seed::{AtVertex, SeedContact, SeedModel, SeedScratch},
    world::{Scratch, State},
};

/// Buffers, sized once.
#[derive(Debug, Clone)]
pub(crate) struct SeedBodyScratch {
    step: SeedScratch,
    /// External forces on vertices that have one.
    forces_n: Vec<AtVertex>,
}

impl SeedBodyScratch {
    pub(crate) fn new(seed: &SeedModel) -> Self {
        Self { step: SeedScratch::new(seed), forces_n: Vec::with_capacity(seed.surface_rest_m().len()) }
    }
}

/// All steps of a tick.
pub(super) fn run(tick: &Tick<'_>, state: &mut State, scratch: &mut Scratch) {
    let Some(seed) = tick.model.seed() else { return };
    let stale = !state.force_is_current;
    tick.make_force_current(state, scratch);
    if stale {
        note_touch(tick, state, scratch);
    }
    for number in 1..=tick.substeps {
        let fastest_m_per_s = advance(tick, seed, state, scratch);
        tick.evaluate_after(number, fastest_m_per_s, state, scratch);
        note_touch(tick, state, scratch);
    }
}

fn note_touch(tick: &Tick<'_>, state: &mut State, scratch: &Scratch) {
    if state.tools.is_empty() {
        return;
    }
    let touched = tick.model.contact().touched_triangle(&state.contact, &scratch.contact);
    if let Some(motion) = &mut state.seed {
        motion.touched = touched;
    }
}

/// One step. Returns a bound (m/s) of how fast any node came to where it is: of what is put there, too.
fn advance(tick: &Tick<'_>, seed: &SeedModel, state: &mut State, scratch: &mut Scratch) -> f64 {
    let State { x, v, force_n, external_n, ledger, seed: Some(motion), .. } = state else { return 0.0 };
    let Some(SeedBodyScratch { step, forces_n }) = scratch.seed.as_deref_mut() else { return 0.0 };
    let surface = tick.model.surface();
    forces_n.clear();
    for (vertex, &node) in surface.nodes.iter().enumerate() {
        let value = external_n[node as usize];
        if value != glam::DVec3::ZERO {
            forces_n.push(AtVertex { vertex: vertex as u32, value });
        }
    }
    let contact = SeedContact { triangle: motion.touched, forces_n, displaced_m: &[] };
    let report = seed.step(&mut motion.now, step, &contact);
    motion.awake = report.particles_touched;
    let of_core = step.core_forces_n();
    force_n[..of_core.len()].copy_from_slice(of_core);
    force_n[of_core.len()..].copy_from_slice(&external_n[of_core.len()..]);
    let now = &motion.now;
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
