//! What a step changes, its input and its report, and the buffers it works in.
use super::SeedModel;
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// Positions and velocities of some points.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Motion {
    /// Positions (m).
    pub x: Vec<DVec3>,
    /// Velocities (m/s).
    pub v: Vec<DVec3>,
}

impl Motion {
    pub(super) fn at_rest(positions_m: &[DVec3]) -> Self {
        Self { x: positions_m.to_vec(), v: vec![DVec3::ZERO; positions_m.len()] }
    }

    /// Copies another motion of the same length. Nothing is allocated.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.x.copy_from_slice(&other.x);
        self.v.copy_from_slice(&other.v);
    }

    /// Brings all points to rest at the given positions (m), and those without one to rest at the origin. Nothing is
    /// allocated.
    pub(super) fn rest(&mut self, positions_m: &[DVec3]) {
        self.x.fill(DVec3::ZERO);
        self.x.iter_mut().zip(positions_m).for_each(|(x, rest)| *x = *rest);
        self.v.fill(DVec3::ZERO);
    }

    /// Moves a point within a step by `by_m` (m), and adds `by/dt` to its velocity.
    pub(super) fn shift(&mut self, point: usize, by_m: DVec3, dt_s: f64) {
        self.x[point] += by_m;
        self.v[point] += by_m / dt_s;
    }

    /// Adds `dt f/m` to a point's velocity and moves the point with it. This is eq. 33, whose `x_t − x_{t−Δt}` is
    /// `dt v`.
    pub(super) fn verlet(&mut self, point: usize, force_n: DVec3, mass_kg: f64, dt_s: f64) {
        self.v[point] += force_n * (dt_s / mass_kg);
        self.x[point] += self.v[point] * dt_s;
    }

    pub(super) fn is_finite(&self, points: usize) -> bool {
        self.x.iter().take(points).chain(self.v.iter().take(points)).all(|a| a.is_finite())
    }
}

/// What a step changes. Lists do not change their length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SeedState {
    /// Number of steps done.
    pub step: u64,
    /// Motion of the core's nodes.
    pub core: Motion,
    /// Motion of the skin's vertices; empty without a layer.
    pub skin: Motion,
    /// Triangle whose region is awake.
    pub touched: Option<u32>,
    /// Motion of the awake particles in their region's order; zero beyond them.
    pub particles: Motion,
}

impl SeedState {
    /// Returns the state at rest, with all particles asleep.
    pub fn at_rest(model: &SeedModel) -> Self {
        let skin = model.layer().map_or_else(Motion::default, |_| Motion::at_rest(model.surface_rest_m()));
        Self {
            step: 0,
            core: Motion::at_rest(model.core().rest_m()),
            skin,
            touched: None,
            particles: Motion::at_rest(&vec![DVec3::ZERO; model.most_awake()]),
        }
    }

    /// Returns whether this may be a state of a model, by its lengths; it may come from a snapshot.
    pub fn fits(&self, model: &SeedModel) -> bool {
        let skin = if model.layer().is_some() { model.surface_rest_m().len() } else { 0 };
        let of = |motion: &Motion, count| motion.x.len() == count && motion.v.len() == count;
        of(&self.core, model.core().rest_m().len())
            && of(&self.skin, skin)
            && of(&self.particles, model.most_awake())
            && self.touched.is_none_or(|triangle| (triangle as usize) < model.regions().len())
    }
}

/// A vector that is given at a vertex of the surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtVertex {
    /// The vertex.
    pub vertex: u32,
    /// Force (N) on the vertex, or position (m) to which it is brought.
    pub value: DVec3,
}

/// The user's touch during a step.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct SeedContact<'a> {
    /// The triangle of the surface that holds the touched point ps; its region is awake. Ignored without a layer.
    pub triangle: Option<u32>,
    /// External forces (N) on vertices, F_ext of eq. 28.
    pub forces_n: &'a [AtVertex],
    /// Vertices that are displaced, with their new positions (m).
    pub displaced_m: &'a [AtVertex],
}

/// The report of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeedReport {
    /// Force (N) of the body on what displaces its vertices.
    pub reaction_n: DVec3,
    /// Number of particles that were computed; sleeping ones are not.
    pub particles_touched: u32,
    /// Number of inputs that were left out because they were not finite, named something that does not exist, or
    /// displaced a held node.
    pub inputs_rejected: u32,
    /// Whether all of the state is finite; otherwise the caller has to go back to an earlier one.
    pub is_finite: bool,
}

/// Buffers of [`SeedModel::step`], which are allocated once.
#[derive(Debug, Clone)]
pub struct SeedScratch {
    pub(super) core_force_n: Vec<DVec3>,
    pub(super) core_before_m: Vec<DVec3>,
    pub(super) node_sums: Vec<(DVec3, f64)>,
    pub(super) skin_force_n: Vec<DVec3>,
    pub(super) displacement_m: Vec<DVec3>,
    pub(super) force_n: Vec<DVec3>,
    pub(super) goal_sums: Vec<(DVec3, f64)>,
    pub(super) stress_pa: Vec<DMat3>,
    /// Motion of the particles before the touched triangle changed.
    pub(super) before: Motion,
}

impl SeedScratch {
    /// Returns the forces (N) on the core's nodes in the last step, including external ones.
    pub fn core_forces_n(&self) -> &[DVec3] {
        &self.core_force_n
    }

    /// Returns buffers for a model.
    pub fn new(model: &SeedModel) -> Self {
        let (nodes, awake) = (model.core().rest_m().len(), model.most_awake());
        let vertices = if model.layer().is_some() { model.surface_rest_m().len() } else { 0 };
        let zeros = |count: usize| vec![DVec3::ZERO; count];
        Self {
            core_force_n: zeros(nodes),
            core_before_m: zeros(nodes),
            node_sums: vec![(DVec3::ZERO, 0.0); nodes],
            skin_force_n: zeros(vertices),
            displacement_m: zeros(awake),
            force_n: zeros(awake),
            goal_sums: vec![(DVec3::ZERO, 0.0); awake],
            stress_pa: vec![DMat3::ZERO; awake],
            before: Motion { x: zeros(awake), v: zeros(awake) },
        }
    }
}
