//! What a static solve finds.
use super::{
    Progress,
    equilibrium::{Forces, Stage},
    newton::Solver,
    tet_model::TetModel,
};
use crate::{
    contact::{Pressing, ToolTarget},
    elements::linear_tet::RestTet,
    settings::PrescribedSpec,
    tick::Energies,
    world::{Model, State},
};
use glam::{BVec3, DVec3};
use std::fmt;

/// Forces up to so many times `rounding_n` are rounding: that bounds the free axes, and held ones have theirs too.
const ROUNDING_ONLY: f64 = 10.0;

/// A residual that rounding excuses is at most this part of the forces: what is left of them otherwise is told by nothing.
const MOST_ROUNDED: f64 = 0.01;

/// Forces that do not balance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Imbalance {
    /// `‖f_free‖₂` (N).
    pub residual_n: f64,
    /// The forces in play (N).
    pub reference_n: f64,
    /// What rounding of positions alone leaves (N).
    pub rounding_n: f64,
}

impl fmt::Display for Imbalance {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &Self { residual_n, reference_n, rounding_n } = self;
        write!(out, "{residual_n:.2e} N are left of forces of {reference_n:.2e} N")?;
        if rounding_n > MOST_ROUNDED * reference_n {
            write!(out, ", and rounding of positions alone makes {rounding_n:.2e} N: the forces are lost in it")?;
        }
        Ok(())
    }
}

/// An equilibrium.
#[derive(Debug, Clone, PartialEq)]
pub struct StaticSolution {
    /// Positions (m), one per node; of a hybrid body, of its coarse nodes and then of the particles that are awake.
    pub x: Vec<DVec3>,
    /// Of a hybrid body.
    pub awake: AwakeParticles,
    /// Force (N) of the holder on the body, summed over each prescribed set's axes.
    pub reactions_n: Vec<DVec3>,
    /// The same per node, zero on free axes.
    pub node_reactions_n: Vec<DVec3>,
    /// Every tool.
    pub tools: Vec<ToolAtRest>,
    /// Every Newton iteration, in order.
    pub history: Vec<Progress>,
    /// Newton iterations in all, failed load steps included.
    pub iterations: u32,
    /// Cholesky factorisations in all; none of a hybrid body.
    pub factorisations: u32,
    /// Load steps that converged.
    pub load_steps: u32,
    /// `‖f_free‖₂` (N) at `x`.
    pub residual_n: f64,
    /// The same over its reference. Above the wanted one only where rounding of the positions allows no better: see
    /// `rounding_n`.
    pub relative_residual: f64,
    /// What the residual is relative to (N): `max(‖f_internal‖₂, ‖f_external‖₂)` over all axes.
    pub reference_n: f64,
    /// Residual (N) that rounding of positions alone makes, `ε ‖diag K‖₂ max|x|`.
    pub rounding_n: f64,
    /// False when the tangent stiffness at `x` is not positive definite: the body would leave this equilibrium at the least push.
    pub stable: bool,
    /// Tets, or coarse tets and awake cells, with `det F ≤ 0`. An equilibrium with any is one of the formulas, hardly one of a body.
    pub inverted_tets: u32,
}

/// The particles awake in an equilibrium of a hybrid body.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct AwakeParticles {
    /// Ascending.
    pub ids: Vec<u32>,
    /// For every sample of every tool's axis, the rest position (m) of the vertex about which it keeps them awake; `None` where the
    /// tool is far from the body. Empty where the particles were given.
    pub middles_m: Vec<Option<DVec3>>,
    /// Loads that act on too much of the skin for all particles within a spacing of it to be awake, so that none is for them.
    pub spread_loads: u32,
}

/// A tool in equilibrium.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ToolAtRest {
    /// Where its device is (m).
    pub device_m: DVec3,
    /// Centre of the tool (m): the device's place if it is rigid.
    pub centre_m: DVec3,
    /// Force (N) of the body on it.
    pub contact_force_n: DVec3,
    /// Force (N) on its device: the coupling's, or the contact force of a rigid tool.
    pub device_force_n: DVec3,
    /// Contact samples that carry force.
    pub contacts: u32,
    /// Deepest penetration into the surface (m).
    pub penetration_m: f64,
    /// Energy stored in the contact's foundation (J).
    pub contact_energy_j: f64,
}

impl ToolAtRest {
    /// A tool that presses; `spring_n` is the force (N) of its coupling, if it has one.
    pub(super) fn pressing(device_m: DVec3, centre_m: DVec3, pressing: &Pressing, spring_n: Option<DVec3>) -> Self {
        Self {
            device_m,
            centre_m,
            contact_force_n: pressing.force_n,
            device_force_n: spring_n.map_or(pressing.force_n, |spring_n| DVec3::ZERO - spring_n),
            contacts: pressing.contacts,
            penetration_m: pressing.penetration_m,
            contact_energy_j: pressing.energy_j,
        }
    }
}

impl StaticSolution {
    /// Whether there is no force above rounding: `relative_residual` then compares rounding with itself, and `residual_n` is to be
    /// held against `rounding_n`.
    pub fn is_unloaded(&self) -> bool {
        self.reference_n <= ROUNDING_ONLY * self.rounding_n
    }

    /// Why the forces do not balance as well as is wanted, `relative_residual` of them; `None` where they do, or where only rounding of
    /// positions stands between.
    pub fn imbalance(&self, relative_residual: f64) -> Option<Imbalance> {
        let rounded = self.residual_n <= self.rounding_n && self.relative_residual <= MOST_ROUNDED;
        let is_met = self.relative_residual <= relative_residual || rounded || self.is_unloaded();
        let &Self { residual_n, reference_n, rounding_n, .. } = self;
        (!is_met).then_some(Imbalance { residual_n, reference_n, rounding_n })
    }

    /// The equilibrium under `load_factors` as a state at tick 0, from which [`crate::step`] goes on without moving. Its ledger
    /// holds the work of a slow loading, which is what the body holds: `W = U + G`.
    pub fn state(&self, model: &Model, load_factors: &[f64]) -> State {
        let mut state = State::at_rest(model);
        let State { mechanical, body: own, .. } = &mut state;
        own.wake_at_rest(&self.awake.ids, &self.awake.middles_m, mechanical);
        mechanical.x.copy_from_slice(&self.x);
        mechanical.load_factors.copy_from_slice(load_factors);
        for (tool, found) in mechanical.tools.iter_mut().zip(&self.tools) {
            tool.target = ToolTarget::at(found.device_m);
            tool.previous_target = tool.target;
            tool.centre_m = found.centre_m;
            tool.contact_force_n = found.contact_force_n;
            tool.device_force_n = found.device_force_n;
            tool.contacts = found.contacts;
            tool.penetration_m = found.penetration_m;
            tool.contact_energy_j = found.contact_energy_j;
        }
        state.mechanical.ledger.external_work_j = Energies::of(model, &state).held_j();
        state
    }

    /// What the solver found in its last stage.
    pub(super) fn of(solver: &mut Solver<'_>, stage: &Stage, mut configuration: Vec<DVec3>, load_steps: u32) -> Self {
        let model = solver.model;
        let forces = Forces::at(model, stage, &configuration);
        let stable = solver.is_stable(stage, &configuration);
        let residual = forces.free(&solver.axes);
        let (residual_n, relative_residual) = forces.residual(&residual);
        // The holder supplies what the other forces lack.
        let hold = |(inverse_mass, f): (&DVec3, DVec3)| DVec3::select(inverse_mass.cmpeq(DVec3::ZERO), -f, DVec3::ZERO);
        let node_reactions_n: Vec<DVec3> =
            model.body.inverse_mass_per_kg().iter().zip(forces.total_n()).map(hold).collect();
        let of_set = |set: &PrescribedSpec| {
            let sum: DVec3 = set.nodes.iter().map(|&n| node_reactions_n[n as usize]).sum();
            DVec3::select(BVec3::from_array(set.axes), sum, DVec3::ZERO)
        };
        Self {
            reactions_n: model.environment.prescribed.iter().map(of_set).collect(),
            tools: stage.tools_at_rest(model, &forces, &configuration),
            iterations: solver.history.len() as u32,
            factorisations: solver.factorisations,
            load_steps,
            residual_n,
            relative_residual,
            reference_n: forces.reference_n(),
            rounding_n: solver.rounding_n,
            stable,
            inverted_tets: inverted_tets(model, &configuration),
            awake: AwakeParticles::default(),
            history: std::mem::take(&mut solver.history),
            x: {
                configuration.truncate(model.body.mass_kg().len());
                configuration
            },
            node_reactions_n,
        }
    }
}

fn inverted_tets(model: TetModel<'_>, x: &[DVec3]) -> u32 {
    let volume_ratio =
        |(rest, nodes): (&RestTet, &[u32; 4])| rest.gradient_of(&nodes.map(|n| x[n as usize])).determinant();
    model.body.rest_tets().iter().zip(model.body.mesh().tets()).map(volume_ratio).filter(|&j| j <= 0.0).count() as u32
}
