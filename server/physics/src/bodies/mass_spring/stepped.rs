//! Forces on a mass-spring surface, and its kicks.
use super::{MassSpringBody, MassSpringScratch, MassSpringState, skin::SpringSkin};
use crate::{
    contact::ContactScratch,
    lanes::kicks::LumpedKick,
    tick::{Environment, Evaluation, Judged, MechanicalState, PointForce, Stepped, Tick, Touch, touch_skin},
};
use glam::DVec3;

/// A mass-spring surface with its own state and buffers, while it is stepped.
#[derive(Debug)]
pub(crate) struct SteppedMassSpring<'a> {
    pub(crate) body: &'a MassSpringBody,
    pub(crate) own: &'a mut MassSpringState,
    pub(crate) scratch: &'a mut MassSpringScratch,
}

impl<'a> Stepped<'a> for SteppedMassSpring<'a> {
    fn evaluate(
        &mut self,
        tick: &Tick<'_>,
        now: &Evaluation,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        let Self { body, own, scratch } = self;
        let MassSpringScratch { springs, skin, .. } = &mut **scratch;
        let MechanicalState { x, v, external_n, tools, contact: touched, load_factors, .. } = state;
        let touch = Touch {
            tools,
            contact: touched,
            load_factors,
            external_n,
            scratch: contact,
            fastest_m_per_s: now.fastest_m_per_s,
        };
        let mut view = SpringSkin::new(body, &own.motion, springs, x).moving(v);
        touch_skin(tick, now, body.model().rest_m(), &mut view, skin, touch);
        state.force_n.copy_from_slice(&state.external_n);
        springs.add_forces_n(body.model(), &own.motion, &state.x, &mut state.force_n);
        let gravity = tick.environment.gravity_m_per_s2;
        if gravity != DVec3::ZERO {
            for (force, mass) in state.force_n.iter_mut().zip(springs.mass_kg()).filter(|(_, mass)| mass.is_finite()) {
                *force += gravity * *mass;
            }
        }
        state.force_is_current = true;
    }

    /// Gives the awake nodes a kick of length `h`, `v ← (v e^{−c h/2} + h f/m) e^{−c h/2}`, and adds its work and
    /// dissipation to the ledger.
    fn kick(&mut self, environment: &Environment, state: &mut MechanicalState, h_s: f64, _ends_long_step: bool) {
        let damping = environment.settings.mass_damping_per_s;
        let [external_w, before_sq, between_sq] = LumpedKick {
            v: &mut state.v,
            forces_n: &state.force_n,
            external_n: &state.external_n,
            mass_kg: &self.scratch.mass_kg,
            inverse_mass_per_kg: &self.scratch.inverse_mass_per_kg,
            factor: (-0.5 * damping * h_s).exp(),
            h_s,
        }
        .give();
        state.ledger.external_work_j += h_s * external_w;
        // Half of the damping acts before the force, and half of it after.
        state.ledger.dissipated_j += 0.5 * (before_sq + between_sq) * -(-damping * h_s).exp_m1();
    }

    /// Returns the force (N) that holds a node, which is zero while the node sleeps.
    fn reaction_n(&self, node: usize, state: &MechanicalState) -> DVec3 {
        self.scratch.place(node as u32).map_or(DVec3::ZERO, |place| -state.force_n[place])
    }

    fn judged(&mut self) -> Option<&mut dyn Judged> {
        Some(self)
    }

    /// Returns the node at a place among the awake nodes.
    fn node_at(&self, place: u32) -> Option<u32> {
        self.own.motion.ids.get(place as usize).copied()
    }

    fn prepare(&mut self, environment: &Environment, state: &mut MechanicalState, forces: &[PointForce]) {
        self.wake_and_refine(environment, state, forces);
    }
}
