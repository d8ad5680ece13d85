//! Forces and kicks of a body of tetrahedra.
use super::TetBody;
use crate::{
    contact::{ContactModel, ContactScratch, ContactTangents},
    kernels::KernelScratch,
    linalg::pcg::PcgScratch,
    settings::Integrator,
    tick::{Environment, Evaluation, Judged, MechanicalState, PrescribedNodes, Stepped, Tick, touch_nodes},
};
use glam::DVec3;

/// A body of tetrahedra with its buffers, while it is stepped.
#[derive(Debug)]
pub(crate) struct SteppedTet<'a> {
    pub(crate) body: &'a TetBody,
    pub(crate) scratch: &'a mut TetScratch,
}

/// Buffers, sized once.
#[derive(Debug, Clone)]
pub(crate) struct TetScratch {
    pub(crate) kernel: KernelScratch,
    /// Empty unless the scheme is implicit.
    pub(crate) pcg: PcgScratch,
    /// Empty unless the scheme is implicit.
    pub(crate) tangents: ContactTangents,
}

impl TetScratch {
    /// For a body in its environment.
    pub(crate) fn new(body: &TetBody, environment: &Environment) -> Self {
        let kernel = body.kernel();
        match environment.settings.integrator {
            Integrator::BackwardEuler => Self {
                kernel: kernel.scratch_for_products(),
                pcg: PcgScratch::new(body.mass_kg().len()),
                tangents: ContactTangents::new(&environment.contact),
            },
            _ => Self {
                kernel: kernel.scratch(),
                pcg: PcgScratch::default(),
                tangents: ContactTangents::new(&ContactModel::default()),
            },
        }
    }
}

impl<'a> Stepped<'a> for SteppedTet<'a> {
    fn evaluate(
        &mut self,
        tick: &Tick<'_>,
        now: &Evaluation,
        state: &mut MechanicalState,
        contact: &mut ContactScratch,
    ) {
        let rest_m = self.body.rest_positions_m();
        touch_nodes(tick, now, rest_m, state, contact);
        let MechanicalState { x, v, force_n, external_n, viscous, .. } = state;
        let viscous_power_w = self.body.kernel().forces_n(rest_m, x, v, force_n, &mut self.scratch.kernel);
        viscous.record(viscous_power_w, now.dt_s > 0.0);
        let gravity = tick.environment.gravity_m_per_s2;
        for ((force, external), mass) in force_n.iter_mut().zip(external_n.iter()).zip(self.body.mass_kg()) {
            *force += *external + gravity * *mass;
        }
    }

    fn kick(&mut self, environment: &Environment, state: &mut MechanicalState, h_s: f64, _ends_long_step: bool) {
        self.body.lumped_mass(environment).kick(environment.settings.mass_damping_per_s, state, h_s);
    }

    fn reaction_n(&self, node: usize, state: &MechanicalState) -> DVec3 {
        let held = self.body.inverse_mass_per_kg()[node].cmpeq(DVec3::ZERO);
        DVec3::select(held, -state.force_n[node], DVec3::ZERO)
    }

    fn judged(&mut self) -> Option<&mut dyn Judged> {
        Some(self)
    }

    fn prescribed_nodes(&self) -> Option<PrescribedNodes<'a>> {
        Some(self.body.prescribed_nodes())
    }
}
