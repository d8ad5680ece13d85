//! The state: everything that a tick changes.
use super::{Model, Quarantine, Sleep};
use crate::{
    bodies::BodyState,
    contact::ToolTarget,
    integrate::Pace,
    tick::{AwakeFor, MechanicalState, PointForce},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Everything that a tick changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Positions, velocities, forces, tools, and the ledger, which every kind of body has.
    pub mechanical: MechanicalState,
    /// State that only this kind of body has.
    pub body: BodyState,
    /// Number of substeps in which ticks are taken.
    pub pace: Pace,
    /// Whether the body sleeps.
    pub sleep: Sleep,
    /// The quarantine, where a tick's result was not finite.
    pub quarantine: Option<Quarantine>,
}

impl State {
    /// Returns the state at rest, at tick 0.
    pub fn at_rest(model: &Model) -> Self {
        let (environment, body) = (model.environment(), model.body());
        let own = BodyState::at_rest(body, environment);
        let mut x = Vec::with_capacity(body.most_positions());
        x.extend(own.rest_m(body));
        let nodes = x.len();
        Self {
            mechanical: MechanicalState::at_rest(environment, x),
            body: own,
            pace: Pace::at_start(environment, model.is_judged(), nodes, body.most_positions()),
            sleep: Sleep::at_start(environment),
            quarantine: None,
        }
    }

    /// Copies another state of the same model into the buffers it has. Nothing is allocated.
    pub fn copy_from(&mut self, other: &Self) {
        self.mechanical.copy_from(&other.mechanical);
        self.body.copy_from(&other.body);
        self.pace.copy_from(&other.pace);
        self.sleep.copy_from(&other.sleep);
        self.quarantine = other.quarantine;
    }

    /// Does the same as [`Self::copy_from`], and returns true. Returns false and copies nothing where the other state
    /// cannot be one of the same model by its lengths, or has more awake nodes than there is room for.
    pub fn try_copy_from(&mut self, other: &Self) -> bool {
        let (own, from) = (&self.mechanical, &other.mechanical);
        let fits = self.body.is_alike(&other.body)
            && self.body.always_there(own.x.len()) == other.body.always_there(from.x.len())
            && from.x.len() <= own.room()
            && from.tools.len() == own.tools.len()
            && from.load_factors.len() == own.load_factors.len();
        if fits {
            self.copy_from(other);
        }
        fits
    }

    /// Brings the state back to rest at tick 0, as [`Self::at_rest`], in the buffers it has. Nothing is allocated.
    pub fn reset(&mut self, model: &Model) {
        let (environment, body) = (model.environment(), model.body());
        self.body.reset(body);
        self.mechanical.reset(environment, self.body.rest_m(body));
        self.pace.reset(environment, model.is_judged(), self.mechanical.x.len());
        self.sleep.reset();
        self.quarantine = None;
    }

    /// Puts a tool and its device at rest in a pose, as if they had always been there: the tool neither sweeps what
    /// lies between nor keeps its contact. Where it is put into the surface it presses nothing yet; it resists from
    /// that depth on, and as from the outside once it has left. A pose that is not finite, or a tool that does not
    /// exist, changes nothing. Nothing is allocated.
    pub fn place_tool(&mut self, tool: usize, pose: ToolTarget) {
        self.mechanical.place_tool(tool, pose);
    }

    /// Returns the number of awake particles.
    pub fn awake_particles(&self) -> usize {
        self.body.awake_particles()
    }

    /// Returns how many of the awake particles are awake for tools, loads and injected forces, with the forces that were injected
    /// into the last tick; `None` of bodies whose particles do not wake for these. It is worked out from the state, in more
    /// than a tick's time.
    pub fn awake_for(&self, model: &Model, points: &[PointForce]) -> Option<AwakeFor> {
        let load_factors = &self.mechanical.load_factors;
        model.body().awake_for(model.environment(), &self.body, load_factors, points)
    }

    /// Returns the positions (m) of the awake particles.
    pub fn awake_particles_m(&self) -> &[DVec3] {
        self.body.awake_particles_m(&self.mechanical)
    }

    /// Returns the simulated time (s) since reset.
    pub fn time_s(&self, model: &Model) -> f64 {
        self.mechanical.tick as f64 * model.settings().tick_period_s
    }
}
