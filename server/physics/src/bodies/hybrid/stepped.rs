//! Forces and kicks of a hybrid body.
use super::{HybridBody, HybridScratch, HybridState, carried_skin::SkinView};
use crate::{
    contact::{ContactScratch, Drifted, Skin, SubstepTime},
    lanes::{kicks::Kick, vector_operations},
    tick::{
        Environment, Evaluation, Judged, MechanicalState, PointForce, PrescribedNodes, Stepped, Tick, Touch,
        any_tool_is_near, lumped::holders_power_w, touch_skin,
    },
};
use glam::DVec3;

/// A hybrid body with its own state and buffers, while it is stepped.
#[derive(Debug)]
pub(crate) struct SteppedHybrid<'a> {
    pub(crate) body: &'a HybridBody,
    pub(crate) own: &'a mut HybridState,
    pub(crate) scratch: &'a mut HybridScratch,
}

impl<'a> Stepped<'a> for SteppedHybrid<'a> {
    fn evaluate(
        &mut self,
        tick: &Tick<'_>,
        now: &Evaluation,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        let Self { body, own, scratch } = self;
        let HybridScratch { patch, skin, .. } = &mut **scratch;
        let MechanicalState { x, v, external_n, tools, contact: touched, load_factors, .. } = state;
        patch.displace(body, x);
        let mut view = SkinView::new(body, patch).moving(v);
        let touch = Touch {
            tools,
            contact: touched,
            load_factors,
            external_n,
            scratch: contact,
            fastest_m_per_s: if now.fastest_m_per_s > 0.0 { view.fastest_m_per_s() } else { 0.0 },
        };
        touch_skin(tick, now, body.skin_rest_m(), &mut view, skin, touch);
        let MechanicalState { x, v, force_n, viscous, ledger, .. } = &mut *state;
        let every = tick.environment.steps.substeps_per_long_step;
        let (mut viscous_w, mut taken_j) = (0.0, 0.0);
        own.prestrain.advance(now.dt_s);
        let left = own.prestrain.left();
        own.long_steps.turn_with(body, x);
        if every > 1 && now.ends_long_step {
            let of_coarse = |forces_n: &mut [DVec3]| patch.add_coarse_forces_n(v, left, forces_n);
            let found = own.long_steps.evaluate(body.node_count(), of_coarse);
            viscous_w += f64::from(every) * found.viscous_w;
            taken_j += own.prestrain.take_along(0, found.prestrain_j, f64::from(every) * now.dt_s);
        }
        own.long_steps.start_with_steady_n(force_n);
        if every == 1 {
            let found = patch.add_coarse_forces_n(v, left, force_n);
            viscous_w += found.viscous_w;
            taken_j += own.prestrain.take_along(0, found.prestrain_j, now.dt_s);
        }
        let found = patch.add_cell_forces_n(body, v, left, force_n);
        viscous_w += found.viscous_w;
        taken_j += own.prestrain.take_along(1, found.prestrain_j, now.dt_s);
        viscous.record(viscous_w, now.dt_s > 0.0);
        ledger.dissipated_j += taken_j;
        own.given_j -= taken_j;
        let gravity = tick.environment.gravity_m_per_s2;
        if gravity != DVec3::ZERO {
            patch.mass_matrix().add_weight_n(gravity, &mut state.force_n);
        }
        vector_operations::add(&mut state.force_n, &state.external_n);
        scratch.transition.apply(body, own, state);
        state.force_is_current = true;
    }

    /// Forgets the energy that the last kick left: velocities have changed since. Keeps the transition force, which is known by now, for
    /// a repetition.
    fn begin_kicks(&mut self) {
        self.scratch.of_free_j = None;
        self.scratch.transition.keep(self.own);
    }

    /// Kicks, `v ← (v e^{−c h/2} + h M'⁻¹ f) e^{−c h/2}`, and books the work in the ledger, as for a body of tets.
    fn kick(&mut self, environment: &Environment, state: &mut MechanicalState, h_s: f64, ends_long_step: bool) {
        let Self { body, own, scratch } = self;
        let HybridScratch { patch, accelerations, momenta, of_free_j, kick_sq, .. } = &mut **scratch;
        accelerations.clear();
        accelerations.extend_from_slice(&state.force_n);
        if ends_long_step {
            let every = environment.steps.substeps_per_long_step;
            own.long_steps.add_beyond_n(f64::from(every), accelerations);
        }
        let of_holders_w = holders_power_w(&environment.prescribed, accelerations, &state.v);
        let damping = environment.settings.mass_damping_per_s;
        let factor = (-0.5 * damping * h_s).exp();
        let (mut before_j, mut with_holders_j, mut power_w) = (0.0, 0.0, 0.0);
        if damping > 0.0 {
            // Velocities are those that the kick before left, of which the energy is known from there.
            (before_j, with_holders_j) =
                of_free_j.unwrap_or_else(|| patch.mass_matrix().of_free_j(body, &state.v, momenta));
            power_w = factor * (vector_operations::dot(&state.v, accelerations) + of_holders_w);
        }
        *kick_sq = [patch.mass_matrix_mut().accelerate(accelerations), kick_sq[0], kick_sq[1]];
        let inertia_w = patch.mass_matrix().of_holders(&state.v, accelerations);
        let taken_j = own.transition_work_j(&state.v, factor, accelerations, h_s);
        state.ledger.dissipated_j += taken_j;
        own.given_j -= taken_j;
        let free_parts = if factor < 1.0 { body.free_parts() } else { &[] };
        let (v, external_n) = (&mut state.v, &state.external_n);
        let external_w = Kick { v, accelerations, external_n, free_parts, factor, h_s }.give();
        if damping > 0.0 {
            // (v + h M'⁻¹f)ᵀ M' (v + h M'⁻¹f) = vᵀM'v + 2h v·f + h² fᵀM'⁻¹f
            let between_j = factor * factor * before_j + h_s * (2.0 * power_w + h_s * kick_sq[0]);
            state.ledger.dissipated_j += 0.5 * (before_j + between_j) * -(-damping * h_s).exp_m1();
            // The energy that free velocities have with those of held nodes is linear in the former.
            let between_holders_j = factor * with_holders_j + h_s * inertia_w;
            state.ledger.dissipated_j += (with_holders_j + between_holders_j) * (1.0 - factor);
            *of_free_j = Some((factor * factor * between_j, factor * between_holders_j));
        }
        state.ledger.external_work_j += h_s * external_w;
        state.ledger.dissipated_j += h_s * state.viscous.work_rate_w();
        state.ledger.external_work_j += h_s * (of_holders_w + inertia_w);
    }

    /// Returns the kinetic energy (J) that velocities of held axes have by themselves and with free ones.
    fn held_kinetic_j(&self, state: &MechanicalState) -> f64 {
        self.scratch.patch.mass_matrix().of_held_j(self.body, &state.v)
    }

    fn reaction_n(&self, node: usize, state: &MechanicalState) -> DVec3 {
        let held = self.body.inverse_mass_per_kg()[node].cmpeq(DVec3::ZERO);
        let total_n = state.force_n[node] + self.own.long_steps.beyond_of(node);
        DVec3::select(held, -total_n, DVec3::ZERO)
    }

    fn move_reactions_to_faces(&self, reactions_n: &mut [DVec3]) {
        self.body.move_reactions_to_faces(reactions_n);
    }

    fn prepare(&mut self, environment: &Environment, state: &mut MechanicalState, points: &[PointForce]) {
        self.switch_if_due(environment, state, points);
    }

    fn wake_only(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        particles: &mut dyn Iterator<Item = u32>,
    ) {
        self.wake_only(environment, state, particles);
    }

    fn sleeps_on(&self) -> bool {
        self.own.is_settled()
    }

    fn is_apart(&mut self, environment: &Environment, state: &MechanicalState) -> bool {
        let Self { body, scratch, .. } = self;
        scratch.patch.displace(body, &state.x);
        let view = SkinView::new(body, &scratch.patch);
        environment.contact.is_apart_at(&|vertex| view.position_m(vertex), &state.tools, &state.contact)
    }

    fn tools_stay_apart(
        &mut self,
        environment: &Environment,
        time: &SubstepTime,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) -> bool {
        let Self { body, scratch, .. } = self;
        let HybridScratch { patch, skin, .. } = &mut **scratch;
        let model = &environment.contact;
        let apart = match model.drift_apart(time, &mut state.tools, &mut state.contact, contact) {
            Drifted::Pushed => false,
            Drifted::Away => true,
            Drifted::PerhapsNear => {
                patch.displace(body, &state.x);
                !any_tool_is_near(model, &mut SkinView::new(body, patch), skin, state, contact)
            }
        };
        if apart {
            model.finish_apart(time, &mut state.tools, &mut state.contact, contact);
        }
        apart
    }

    fn judged(&mut self) -> Option<&mut dyn Judged> {
        Some(self)
    }

    fn prescribed_nodes(&self) -> Option<PrescribedNodes<'a>> {
        Some(self.body.prescribed_nodes())
    }

    fn keep_last_good(&mut self) {
        self.scratch.keep_decay(self.own);
    }

    /// Nothing accelerates any more, so no transition force is left.
    fn stop_at_last_good(&mut self) {
        self.scratch.put_decay_back(self.own);
        self.own.forget_transition_force();
        self.own.long_steps.forget();
    }
}
