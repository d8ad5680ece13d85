//! The bits of models, states and ticks that a hash covers, and their order ([`Chain`]).
use super::{Model, Quarantine, Scratch, State, StepReport};
use crate::{
    contact::{LocalContactModel, ToolState, ToolTarget},
    hash::Chain,
    tick::{Energies, MechanicalState},
};

impl Chain {
    /// Adds the whole state after a tick, the reactions at its end, and what the tick reported.
    pub fn tick(&mut self, state: &State, scratch: &Scratch, report: &StepReport) {
        self.whole(u64::from(report.substeps));
        self.whole(u64::from(report.repeated));
        self.whole(u64::from(report.inputs_rejected));
        self.maybe(report.quarantined, Self::quarantine);
        self.state(state);
        self.vectors(scratch.reactions_n());
    }

    /// Adds a state.
    pub fn state(&mut self, state: &State) {
        self.mechanical(&state.mechanical);
        self.whole(u64::from(state.pace.substeps));
        self.whole(u64::from(state.pace.settled_ticks));
        self.real(state.pace.settled_quotient);
        self.whole(u64::from(state.pace.too_few));
        self.flag(state.pace.before_is_usable);
        self.vectors(&state.pace.before.total_n);
        self.vectors(&state.pace.before.external_n);
        self.flag(state.sleep.asleep);
        self.whole(u64::from(state.sleep.still_checks));
        self.vectors(&state.sleep.held_m);
        self.maybe(state.quarantine, Self::quarantine);
        state.body.chain(self);
    }

    fn mechanical(&mut self, state: &MechanicalState) {
        self.whole(state.tick);
        for list in [&state.x, &state.v, &state.force_n, &state.external_n] {
            self.vectors(list);
        }
        self.flag(state.force_is_current);
        self.list(&state.tools, Self::tool);
        state.contact.chain(self);
        self.reals(&state.load_factors);
        let (ledger, viscous) = (&state.ledger, &state.viscous);
        for energy_j in [ledger.external_work_j, ledger.dissipated_j] {
            self.real(energy_j);
        }
        for power_w in [viscous.latest_w, viscous.before_w] {
            self.real(power_w);
        }
    }

    fn quarantine(&mut self, quarantine: Quarantine) {
        self.whole(quarantine.tick);
        self.whole(u64::from(quarantine.node));
    }

    fn tool(&mut self, tool: &ToolState) {
        self.vector(tool.centre_m);
        self.vector(tool.velocity_m_per_s);
        self.rotation(tool.orientation);
        self.vector(tool.angular_velocity_rad_per_s);
        self.target(&tool.target);
        self.target(&tool.previous_target);
        for vector in [
            tool.slip_m,
            tool.device_m_per_s,
            tool.device_rad_per_s,
            tool.contact_force_n,
            tool.device_force_n,
            tool.contact_torque_nm,
            tool.device_torque_nm,
        ] {
            self.vector(vector);
        }
        self.whole(u64::from(tool.contacts));
        for n in [tool.penetration_m, tool.contact_energy_j, tool.friction_heat_j] {
            self.real(n);
        }
        self.maybe(tool.local_model.as_ref(), Self::local_model);
    }

    fn target(&mut self, target: &ToolTarget) {
        self.vector(target.position_m);
        self.vector(target.velocity_m_per_s);
        self.rotation(target.orientation);
        self.vector(target.angular_velocity_rad_per_s);
    }

    fn local_model(&mut self, local: &LocalContactModel) {
        self.vector(local.point_m);
        self.vector(local.normal);
        self.vector(local.force_n);
        self.matrix(&local.stiffness_n_per_m);
        self.real(local.validity_radius_m);
        self.maybe(local.torque.as_ref(), |chain, torque| {
            chain.rotation(torque.orientation);
            chain.vector(torque.torque_nm);
            chain.matrix(&torque.stiffness_nm_per_rad);
            chain.real(torque.validity_angle_rad);
        });
    }

    /// Adds the energies of a state.
    pub fn energies(&mut self, energies: &Energies) {
        let Energies { kinetic_j, elastic_j, gravitational_j, external_work_j, dissipated_j } = *energies;
        for energy_j in [kinetic_j, elastic_j, gravitational_j, external_work_j, dissipated_j] {
            self.real(energy_j);
        }
    }

    /// Adds what the rest state fixes of a model: steps, masses, rest positions, and the stiffness of contact at nodes.
    pub fn model(&mut self, model: &Model) {
        self.whole(u64::from(model.substeps()));
        self.whole(u64::from(model.substeps_per_long_step()));
        let body = model.body();
        self.real(body.max_natural_frequency_rad_per_s());
        self.reals(body.mass_kg());
        body.chain_inverse_mass(model.prescribed(), self);
        self.vectors(body.rest_positions_m());
        self.vectors(body.surface_rest_positions_m());
        self.wholes(&model.surface().nodes);
        let triangles = (0..model.surface().triangles.len()).map(|triangle| model.surface().triangle_nodes(triangle));
        triangles.for_each(|nodes| self.wholes(&nodes));
        self.reals(&model.contact().nodal_stiffness_n_per_m);
        self.real(model.contact().tool_frequency_sq);
        (0..model.tools().len()).for_each(|tool| self.real(model.contact().force_limit_n(tool)));
        self.whole(body.particle_count() as u64);
        self.whole(body.most_awake_particles() as u64);
        self.real(body.particle_spacing_m());
        body.chain(self);
    }
}

#[cfg(test)]
mod tests;
