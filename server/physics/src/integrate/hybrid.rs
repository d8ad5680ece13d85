//! Forces and kicks of a hybrid body, for leapfrog.
use super::{
    forces::{Evaluation, Tick},
    motion::holders_power_w,
};
use crate::{
    bodies::hybrid::{Hybrid, HybridScratch, SkinView},
    contact::{ContactScratch, SubstepTime, SurfaceNow},
    lanes::{kicks::Kick, vector_operations},
    world::{Model, State},
};
use glam::DVec3;

/// Total force at the present positions into `state.force_n`, its external part into `state.external_n`.
pub(super) fn evaluate(
    tick: &Tick<'_>,
    body: &Hybrid,
    state: &mut State,
    (own, contact_scratch): (&mut HybridScratch, &mut ContactScratch),
    now: &Evaluation,
) {
    let model = tick.model;
    let HybridScratch { patch, skin, .. } = own;
    patch.displace(body, &state.x);
    let tick_period_s = model.spec().settings.tick_period_s;
    let time = SubstepTime { fraction: now.fraction, dt_s: now.dt_s, tick_period_s };
    let rest_m = model.surface_rest_positions_m();
    let contact = model.contact();
    contact.move_tools(now.fastest_m_per_s * body.amplification(), &time, &mut state.tools, &mut state.contact);
    let mut view = SkinView::new(body, patch, rest_m);
    let mut renewed = contact.list_on_skin((&mut view, &mut skin.x), &state.tools, &mut state.contact, contact_scratch);
    renewed |= skin.is_outdated(patch);
    renewed |= tick.usable_points().any(|point| !skin.is_listed(point.node));
    if renewed {
        skin.start(patch);
        tick.list_touched(&state.contact, |vertex| skin.list(body, patch, rest_m, vertex));
        skin.finish();
    }
    skin.refresh(patch);
    tick.add_given_n(&state.load_factors, now, (rest_m, &skin.x), &mut skin.forces_n);
    let v = &state.v;
    let velocity = |vertex: u32| body.velocity_m_per_s(patch, vertex, v);
    let (tools, touching) = (&mut state.tools, &mut state.contact);
    let surface = SurfaceNow { x: &skin.x, velocity_m_per_s: &velocity };
    contact.press_tools(&surface, &time, tools, touching, &mut skin.forces_n, contact_scratch);
    state.external_n.fill(DVec3::ZERO);
    skin.hand_over(body.node_count(), patch, &mut state.external_n);
    let State { x, v, active, force_n, viscous, ledger, .. } = &mut *state;
    let every = model.substeps_per_long_step();
    let (mut viscous_w, mut taken_j) = (0.0, 0.0);
    active.fading.go_on(now.dt_s);
    let left = active.fading.left();
    active.long_steps.turn_with(body, x);
    if every > 1 && now.ends_long_step {
        let of_coarse = |forces_n: &mut [DVec3]| patch.add_coarse_forces_n(v, left, forces_n);
        let found = active.long_steps.evaluate(body.node_count(), of_coarse);
        viscous_w += f64::from(every) * found.viscous_w;
        taken_j += active.fading.take_along(0, found.fading_j, f64::from(every) * now.dt_s);
    }
    active.long_steps.start_with_steady_n(force_n);
    if every == 1 {
        let found = patch.add_coarse_forces_n(v, left, force_n);
        viscous_w += found.viscous_w;
        taken_j += active.fading.take_along(0, found.fading_j, now.dt_s);
    }
    let found = patch.add_cell_forces_n(body, v, left, force_n);
    viscous_w += found.viscous_w;
    taken_j += active.fading.take_along(1, found.fading_j, now.dt_s);
    viscous.record(viscous_w, now.dt_s > 0.0);
    ledger.dissipated_j += taken_j;
    active.given_j -= taken_j;
    if model.gravity_m_per_s2() != DVec3::ZERO {
        patch.metric().add_weight_n(model.gravity_m_per_s2(), &mut state.force_n);
    }
    vector_operations::add(&mut state.force_n, &state.external_n);
    own.balance.apply(body, state);
    state.force_is_current = true;
}

/// `v ← (v e^{−c h/2} + h M'⁻¹ f) e^{−c h/2}`, and the ledger's share of it, as of a body of tets.
pub(super) fn kick(
    model: &Model,
    body: &Hybrid,
    state: &mut State,
    own: &mut HybridScratch,
    (h_s, ends_long_step): (f64, bool),
) {
    let HybridScratch { patch, accelerations, momenta, of_free_j, kick_sq, balance, .. } = own;
    accelerations.clear();
    accelerations.extend_from_slice(&state.force_n);
    if ends_long_step {
        state.active.long_steps.add_beyond_n(f64::from(model.substeps_per_long_step()), accelerations);
    }
    let of_holders_w = holders_power_w(model, accelerations, &state.v);
    let damping = model.spec().settings.mass_damping_per_s;
    let factor = (-0.5 * damping * h_s).exp();
    let (mut before_j, mut with_holders_j, mut power_w) = (0.0, 0.0, 0.0);
    if damping > 0.0 {
        // Velocities are what the kick before left, once it is known what they have.
        (before_j, with_holders_j) = of_free_j.unwrap_or_else(|| patch.metric().of_free_j(body, &state.v, momenta));
        power_w = factor * (vector_operations::dot(&state.v, accelerations) + of_holders_w);
    }
    *kick_sq = [patch.metric_mut().accelerate(accelerations), kick_sq[0], kick_sq[1]];
    let inertia_w = patch.metric().of_holders(&state.v, accelerations);
    let taken_j = balance.work_j((&state.v, factor), accelerations, h_s);
    state.ledger.dissipated_j += taken_j;
    state.active.given_j -= taken_j;
    let free_parts = if factor < 1.0 { body.free_parts() } else { &[] };
    let (v, external_n) = (&mut state.v, &state.external_n);
    let external_w = Kick { v, accelerations, external_n, free_parts, factor, h_s }.give();
    if damping > 0.0 {
        // (v + h M'⁻¹f)ᵀ M' (v + h M'⁻¹f) = vᵀM'v + 2h v·f + h² fᵀM'⁻¹f
        let between_j = factor * factor * before_j + h_s * (2.0 * power_w + h_s * kick_sq[0]);
        state.ledger.dissipated_j += 0.5 * (before_j + between_j) * -(-damping * h_s).exp_m1();
        // What free velocities have with those of holders is linear in them.
        let between_holders_j = factor * with_holders_j + h_s * inertia_w;
        state.ledger.dissipated_j += (with_holders_j + between_holders_j) * (1.0 - factor);
        *of_free_j = Some((factor * factor * between_j, factor * between_holders_j));
    }
    state.ledger.external_work_j += h_s * external_w;
    state.ledger.dissipated_j += h_s * state.viscous.work_rate_w();
    state.ledger.external_work_j += h_s * (of_holders_w + inertia_w);
}
