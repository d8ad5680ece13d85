//! What goes into a tick and what comes out of it, beside the state; and the buffers it works in.
use super::Model;
use crate::settings::Integrator;
use crate::{
    bodies::hybrid::HybridScratch,
    contact::{ContactScratch, ToolTarget},
    health::{LastGood, Quarantine},
    integrate::{ForceHistory, ImplicitScratch, SeedBodyScratch, SpringBodyScratch},
    kernels::KernelScratch,
};
use glam::DVec3;

/// A force injected on a node for one tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointForce {
    /// Node of the surface ([`Model::surface`]) or, of a body of tets alone, any.
    pub node: u32,
    /// Force (N, world).
    pub force_n: DVec3,
}

/// What acts during a tick; values are those at its end, and are reached linearly from the previous tick's.
#[derive(Debug, Clone, Copy)]
pub struct TickInput<'a> {
    /// One per tool.
    pub tools: &'a [ToolTarget],
    /// One per load.
    pub load_factors: &'a [f64],
    /// One per prescribed set: displacement from rest (m).
    pub prescribed_displacements_m: &'a [DVec3],
    /// Forces held constant during the tick.
    pub point_forces: &'a [PointForce],
}

/// What a tick did.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepReport {
    /// Substeps that the tick was taken in; 0 while quarantined or asleep.
    pub substeps: u32,
    /// How often it was taken back and repeated in more substeps, because it proved unstable.
    pub repeated: u32,
    /// Inputs that were not finite or of the wrong length, and so were replaced by the previous tick's.
    pub inputs_rejected: u32,
    /// Set when this tick's result was refused.
    pub quarantined: Option<Quarantine>,
}

/// Buffers of [`crate::step`], sized once.
#[derive(Debug, Clone)]
pub struct Scratch {
    /// Reaction forces (N) of constrained axes at the end of the tick.
    pub(crate) reaction_n: Vec<DVec3>,
    pub(crate) last_good: LastGood,
    pub(crate) history: ForceHistory,
    pub(crate) kernel: KernelScratch,
    pub(crate) contact: ContactScratch,
    pub(crate) implicit: ImplicitScratch,
    pub(crate) hybrid: Option<Box<HybridScratch>>,
    pub(crate) seed: Option<Box<SeedBodyScratch>>,
    pub(crate) springs: Option<Box<SpringBodyScratch>>,
}

impl Scratch {
    /// Buffers for a model.
    pub fn new(model: &Model) -> Self {
        let nodes = model.rest_positions_m().len();
        Self {
            reaction_n: vec![DVec3::ZERO; nodes],
            last_good: LastGood::new(model),
            history: ForceHistory::new(model),
            kernel: match model.spec().settings.integrator {
                Integrator::BackwardEuler => model.kernel().scratch_for_products(),
                _ => model.kernel().scratch(),
            },
            contact: model.contact().scratch(model.spec().settings.skips.distant_contact),
            implicit: ImplicitScratch::new(model),
            hybrid: HybridScratch::new(model).map(Box::new),
            seed: model.seed().map(|seed| Box::new(SeedBodyScratch::new(seed))),
            springs: SpringBodyScratch::new(model).map(Box::new),
        }
    }

    /// Products with the matrix of implicit schemes since this scratch was made: the solver's iterations.
    pub fn solver_products(&self) -> u64 {
        self.implicit.products
    }

    /// Force (N) that holds each prescribed degree of freedom, at the end of the last tick; zero on free ones.
    pub fn reactions_n(&self) -> &[DVec3] {
        &self.reaction_n
    }

    /// Takes the reactions of another scratch of the same model, without allocating: with a copy of the state, all that
    /// probes need.
    pub fn copy_reactions_from(&mut self, other: &Self) {
        self.reaction_n.clone_from(&other.reaction_n);
    }
}
