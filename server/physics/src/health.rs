//! Energy ledger, inversion, and quarantine of non-finite state.
use crate::{
    bodies::seed::SeedMotion,
    contact::{ContactState, ToolState},
    world::{Model, State},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What only time integration knows: work and dissipation since reset (J).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Ledger {
    /// Work done on the body by tools, loads, injected forces and prescribed motion (J).
    pub external_work_j: f64,
    /// Energy taken by viscous stress, mass damping and what else a scheme damps, and dropped where a body falls asleep (J).
    pub dissipated_j: f64,
}

/// Power of viscous stress (W), as the leapfrog knows it, and the rate at which its force takes energy.
///
/// At step k the viscous force is `−C v_{k−½}`: the kernel reports `q_k = v_{k−½}ᵀ C v_{k−½}`, but the force works on
/// `½(v_{k−½} + v_{k+½})`. With the polarisation of the quadratic form the work is
/// `dt (¾ q_k + ¼ q_{k+1}) + O(dt³) = dt (q_k + ¼(q_k − q_{k−1})) + O(dt³)`, which needs no future. That holds while C does;
/// at large strain it turns with the body, and the sum keeps an error of first order, `¼ dt ∫ vᵀĊv dt`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ViscousPower {
    /// `q_k` (W).
    pub latest_w: f64,
    /// `q_{k−1}` (W).
    pub before_w: f64,
}

impl ViscousPower {
    /// Takes `q_k`; the first one after a start has no predecessor, and its velocity is not late.
    pub fn record(&mut self, power_w: f64, has_predecessor: bool) {
        self.before_w = if has_predecessor { self.latest_w } else { power_w };
        self.latest_w = power_w;
    }

    /// `q_k + ¼(q_k − q_{k−1})` (W).
    pub fn work_rate_w(&self) -> f64 {
        self.latest_w + 0.25 * (self.latest_w - self.before_w)
    }
}

/// The ledger with the energies of a state (J).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Energies {
    /// `Σ ½ m v²`.
    pub kinetic_j: f64,
    /// `Σ V Ψ(F)`.
    pub elastic_j: f64,
    /// `−Σ m g·(x − X)`.
    pub gravitational_j: f64,
    /// See [`Ledger::external_work_j`].
    pub external_work_j: f64,
    /// See [`Ledger::dissipated_j`].
    pub dissipated_j: f64,
}

impl Energies {
    /// Kinetic, elastic and gravitational energy now (O(tets)), beside the ledger's work and dissipation. Of a seed body the elastic energy is
    /// its core's, for its particles and links have none that is known, and so is no dissipation.
    pub fn of(model: &Model, state: &State) -> Self {
        if let Some(hybrid) = model.hybrid() {
            return hybrid.energies(model.gravity_m_per_s2(), state);
        }
        if let (Some(seed), Some(motion)) = (model.seed(), &state.seed) {
            return Self {
                kinetic_j: seed.kinetic_energy_j(&motion.now),
                elastic_j: elastic_energy_j(model, state),
                external_work_j: state.ledger.external_work_j,
                ..Self::default()
            };
        }
        if let (Some(body), Some(springs)) = (model.springs(), &state.springs) {
            let [kinetic_j, elastic_j] = body.energies_j(&springs.motion, &state.x, &state.v);
            return Self {
                kinetic_j,
                elastic_j,
                gravitational_j: body.gravitational_j(&springs.motion, &state.x, model.gravity_m_per_s2()),
                external_work_j: state.ledger.external_work_j,
                dissipated_j: state.ledger.dissipated_j,
            };
        }
        let kinetic_j = (0..state.x.len()).map(|i| 0.5 * model.mass_kg()[i] * state.v[i].length_squared()).sum();
        let along_gravity = |i: usize| model.gravity_m_per_s2().dot(state.x[i] - model.rest_positions_m()[i]);
        let fallen_j: f64 = (0..state.x.len()).map(|i| model.mass_kg()[i] * along_gravity(i)).sum();
        Self {
            kinetic_j,
            elastic_j: elastic_energy_j(model, state),
            gravitational_j: 0.0 - fallen_j,
            external_work_j: state.ledger.external_work_j,
            dissipated_j: state.ledger.dissipated_j,
        }
    }

    /// `K + U + G`: what the body holds (J).
    pub fn held_j(&self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }

    /// `K + U + G − W + D` (J): constant in exact arithmetic and exact time.
    pub fn balance_j(&self) -> f64 {
        self.held_j() - self.external_work_j + self.dissipated_j
    }
}

/// `Σ V Ψ(F)` (J).
pub fn elastic_energy_j(model: &Model, state: &State) -> f64 {
    if let Some(hybrid) = model.hybrid() {
        return hybrid.energies(DVec3::ZERO, state).elastic_j;
    }
    if let (Some(body), Some(springs)) = (model.springs(), &state.springs) {
        return body.energies_j(&springs.motion, &state.x, &state.v)[1];
    }
    (0..model.mesh().tets().len())
        .map(|tet| {
            let corners = model.mesh().tets()[tet].map(|n| state.x[n as usize]);
            model.rest_tets()[tet].energy_j(model.material_of(tet), &corners)
        })
        .sum()
}

/// Smallest `J = det F` over all tets, and its tet; of a hybrid body, over the coarse tets' means and the awake cells. Below zero: inverted. Springs have none: 1.
pub fn min_volume_ratio(model: &Model, state: &State) -> (f64, usize) {
    if model.springs().is_some() {
        return (1.0, 0);
    }
    if let Some(hybrid) = model.hybrid() {
        return hybrid.min_volume_ratio(state);
    }
    let mut worst = (f64::INFINITY, 0);
    for (tet, nodes) in model.mesh().tets().iter().enumerate() {
        let corners = nodes.map(|n| state.x[n as usize]);
        let j = model.rest_tets()[tet].gradient_of(&corners).determinant();
        if j < worst.0 {
            worst = (j, tet);
        }
    }
    worst
}

/// A state that became non-finite: it was put back to the last good tick, and stays there until reset or restore.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Quarantine {
    /// Tick whose result was refused.
    pub tick: u64,
    /// First node that was not finite, or [`Quarantine::NOT_A_NODE`].
    pub node: u32,
}

impl Quarantine {
    /// In place of a node: a tool, a load's work, a sum or a seed body's particle was not finite.
    pub const NOT_A_NODE: u32 = u32::MAX;
}

/// The state to go back to.
#[derive(Debug, Clone)]
pub(crate) struct LastGood {
    x: Vec<DVec3>,
    v: Vec<DVec3>,
    force_is_current: bool,
    contact: ContactState,
    tools: Vec<ToolState>,
    load_factors: Vec<f64>,
    ledger: Ledger,
    viscous: ViscousPower,
    seed: Option<SeedMotion>,
}

impl LastGood {
    pub(crate) fn new(model: &Model) -> Self {
        let State { x, v, force_is_current, contact, tools, load_factors, ledger, viscous, seed, .. } =
            State::at_rest(model);
        Self { x, v, force_is_current, contact, tools, load_factors, ledger, viscous, seed }
    }

    /// Copies what quarantine goes back to. Allocates nothing.
    pub(crate) fn keep(&mut self, state: &State) {
        self.x.clone_from(&state.x);
        self.tools.clone_from_slice(&state.tools);
        self.load_factors.copy_from_slice(&state.load_factors);
        (self.ledger, self.viscous) = (state.ledger, state.viscous);
        if let (Some(own), Some(seed)) = (&mut self.seed, &state.seed) {
            own.copy_from(seed);
        }
    }

    /// Copies the rest of what a tick of leapfrog changes, but its forces, so that it can be repeated. Allocates nothing.
    pub(crate) fn keep_for_repetition(&mut self, state: &State) {
        self.v.clone_from(&state.v);
        self.force_is_current = state.force_is_current;
        self.contact.keep_memory_of(&state.contact);
    }

    /// Copies the tools only. Allocates nothing.
    pub(crate) fn keep_tools(&mut self, state: &State) {
        self.tools.clone_from_slice(&state.tools);
    }

    pub(crate) fn put_tools_back(&self, state: &mut State) {
        state.tools.clone_from_slice(&self.tools);
    }

    /// Positions (m).
    pub(crate) fn x(&self) -> &[DVec3] {
        &self.x
    }

    /// Velocities (m/s), where kept for repetition.
    pub(crate) fn v(&self) -> &[DVec3] {
        &self.v
    }

    /// Everything of [`Self::keep`] and [`Self::keep_for_repetition`].
    pub(crate) fn put_all_back(&self, state: &mut State) {
        self.put_back(state);
        state.v.copy_from_slice(&self.v);
        state.force_is_current = self.force_is_current;
        state.contact.copy_from(&self.contact);
    }

    pub(crate) fn put_back(&self, state: &mut State) {
        state.x.copy_from_slice(&self.x);
        state.tools.clone_from_slice(&self.tools);
        state.load_factors.copy_from_slice(&self.load_factors);
        (state.ledger, state.viscous) = (self.ledger, self.viscous);
        if let (Some(seed), Some(own)) = (&mut state.seed, &self.seed) {
            seed.copy_from(own);
        }
    }
}

impl std::fmt::Display for Quarantine {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.node {
            Self::NOT_A_NODE => {
                write!(f, "tick {} was refused: a tool, a sum or a particle became non-finite", self.tick)
            }
            node => write!(f, "tick {} was refused: node {node} became non-finite", self.tick),
        }
    }
}

/// What in a state is not finite: a node whose position or velocity is not, or [`Quarantine::NOT_A_NODE`].
pub fn first_non_finite(state: &State) -> Option<u32> {
    // One pass of additions: a sum is finite only if every term is (overflow of finite terms is caught as well).
    let sum: DVec3 = state.x.iter().zip(&state.v).map(|(x, v)| *x + *v).sum();
    let of_tool = |tool: &ToolState| {
        let turning = tool.orientation.xyz() + tool.angular_velocity_rad_per_s + tool.device_torque_nm;
        tool.centre_m + tool.velocity_m_per_s + tool.device_force_n + turning
    };
    let tools: DVec3 = state.tools.iter().map(of_tool).sum();
    let work = state.ledger.external_work_j + state.ledger.dissipated_j;
    let particles_are_finite = state.seed.as_ref().is_none_or(SeedMotion::particles_are_finite);
    if sum.is_finite() && tools.is_finite() && work.is_finite() && particles_are_finite {
        return None;
    }
    let node = state.x.iter().zip(&state.v).position(|(x, v)| !x.is_finite() || !v.is_finite());
    Some(node.map_or(Quarantine::NOT_A_NODE, |node| node as u32))
}
