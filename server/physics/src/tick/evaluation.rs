//! The evaluation of forces at an instant of a tick: its time, and the forces of loads and injections.
use super::{Environment, MechanicalState, PointForce, TickInput};
use crate::{
    contact::{BodyMotion, ContactScratch, ContactState, SubstepTime},
    elements::loads::{LoadPositions, add_load_n},
    settings::LoadSpec,
};
use glam::DVec3;

/// What stays the same during a tick.
pub(crate) struct Tick<'a> {
    pub(crate) environment: &'a Environment,
    pub(crate) input: &'a TickInput<'a>,
    pub(crate) loads: LoadRamp,
    /// Number of substeps in which the tick is taken.
    pub(crate) substeps: u32,
}

/// The instant of an evaluation of forces, and the step that led to it.
pub(crate) struct Evaluation {
    /// Fraction of the tick that is over.
    pub(crate) fraction: f64,
    /// Fraction of the tick that is over for loads.
    pub(crate) load_fraction: f64,
    /// Step (s) that led here; 0 at the start.
    pub(crate) dt_s: f64,
    /// Upper bound (m/s) of the speed with which any node came here.
    pub(crate) fastest_m_per_s: f64,
    /// Whether a long step of a coarse level ends here.
    pub(crate) ends_long_step: bool,
}

impl Evaluation {
    /// Returns the evaluation at the start of a tick.
    pub(crate) fn at_start() -> Self {
        Self::before_a_step(0.0, 0.0)
    }

    /// Returns the evaluation at a fraction of the tick, before the step from there.
    pub(crate) fn before_a_step(fraction: f64, load_fraction: f64) -> Self {
        Self { fraction, load_fraction, dt_s: 0.0, fastest_m_per_s: 0.0, ends_long_step: true }
    }
}

impl Tick<'_> {
    /// Returns whether a long step of a coarse level ends with substep `number` (from 1).
    pub(crate) fn ends_long_step(&self, number: u32) -> bool {
        number.is_multiple_of(self.environment.steps.substeps_per_long_step)
    }

    /// Returns whether a long step of a coarse level, of more than one substep, begins with substep `number` (from 1).
    pub(crate) fn begins_long_step(&self, number: u32) -> bool {
        self.environment.steps.substeps_per_long_step > 1 && self.ends_long_step(number - 1)
    }

    /// Returns the substep `dt` (s).
    pub(crate) fn dt_s(&self) -> f64 {
        self.environment.settings.tick_period_s / f64::from(self.substeps)
    }

    /// Returns the time of an evaluation in the form that contact takes.
    pub(crate) fn substep_time(&self, now: &Evaluation) -> SubstepTime {
        self.environment.substep_time(now.fraction, now.dt_s)
    }

    /// Returns the evaluation at the start of substep `number` (from 1), with loads as at its end.
    pub(crate) fn before_substep(&self, number: u32) -> Evaluation {
        let part = |substeps_done: u32| f64::from(substeps_done) / f64::from(self.substeps);
        Evaluation::before_a_step(part(number - 1), part(number))
    }

    /// Returns the evaluation at the end of substep `number` (from 1), to which the nodes came with speeds of at most
    /// `fastest_m_per_s` (m/s).
    pub(crate) fn after_substep(&self, number: u32, fastest_m_per_s: f64) -> Evaluation {
        let fraction = f64::from(number) / f64::from(self.substeps);
        let ends_long_step = self.ends_long_step(number);
        Evaluation { fraction, load_fraction: fraction, dt_s: self.dt_s(), fastest_m_per_s, ends_long_step }
    }

    /// Adds the forces (N) of loads and injections on a surface whose nodes are at `rest_m` (m) at rest and at `x` (m)
    /// now. `load_factors` are the factors at the end of the last tick.
    pub(crate) fn add_given_n(
        &self,
        load_factors: &[f64],
        now: &Evaluation,
        rest_m: &[DVec3],
        x: &[DVec3],
        forces_n: &mut [DVec3],
    ) {
        for (index, load) in self.environment.loads.iter().enumerate() {
            let factor = self.loads.factor(load_factors[index], self.input, index, now.load_fraction);
            if factor != 0.0 {
                add_load_n(load, factor, &self.environment.surface, LoadPositions { rest_m, deformed_m: x }, forces_n);
            }
        }
        for point in self.usable_points() {
            forces_n[point.node as usize] += point.force_n;
        }
    }

    /// Returns the injected forces that are finite and on nodes that may have one.
    pub(crate) fn usable_points(&self) -> impl Iterator<Item = &PointForce> {
        self.input.point_forces.iter().filter(|point| self.environment.accepts(point))
    }

    /// Calls `list` with every vertex that contact lists, that a load acts on or at which a force is injected, with
    /// some of them several times.
    pub(crate) fn list_touched(&self, contact: &ContactState, mut list: impl FnMut(u32)) {
        let environment = self.environment;
        environment.contact.listed_nodes(contact).for_each(&mut list);
        environment.contact.nodes_of_walls(contact).for_each(&mut list);
        for load in &environment.loads {
            match load {
                LoadSpec::NodalForces(forces) => forces.iter().for_each(|(vertex, _)| list(*vertex)),
                LoadSpec::Traction { triangles, .. } | LoadSpec::Pressure { triangles, .. } => {
                    let nodes =
                        triangles.iter().flat_map(|&triangle| environment.surface.triangle_nodes(triangle as usize));
                    nodes.for_each(&mut list);
                }
            }
        }
        self.usable_points().for_each(|point| list(point.node));
    }
}

/// Load factors that change linearly from the last tick's to this one's.
pub(crate) struct LoadRamp {
    /// Whether the input has one finite factor per load; otherwise the last tick's factors are kept.
    pub(crate) usable: bool,
}

impl LoadRamp {
    /// Returns the ramp from the factors of a state to those of the input.
    pub(crate) fn new(state: &MechanicalState, input: &TickInput<'_>) -> Self {
        let usable =
            input.load_factors.len() == state.load_factors.len() && input.load_factors.iter().all(|f| f.is_finite());
        Self { usable }
    }

    fn factor(&self, from: f64, input: &TickInput<'_>, load: usize, fraction: f64) -> f64 {
        if self.usable { from + (input.load_factors[load] - from) * fraction } else { from }
    }

    /// Keeps the factors of a tick that is over as the last ones.
    pub(crate) fn finish(&self, state: &mut MechanicalState, input: &TickInput<'_>) {
        if self.usable {
            state.load_factors.copy_from_slice(input.load_factors);
        }
    }
}

/// Moves the tools and evaluates contact, loads and injected forces of a body whose surface's vertices are its nodes,
/// which are at `rest_m` (m) at rest. Overwrites `state.external_n`.
pub(crate) fn touch_nodes(
    tick: &Tick<'_>,
    now: &Evaluation,
    rest_m: &[DVec3],
    state: &mut MechanicalState,
    scratch: &mut ContactScratch,
) {
    let MechanicalState { x, v, external_n, tools, contact, load_factors, force_is_current, .. } = state;
    external_n.fill(DVec3::ZERO);
    tick.add_given_n(load_factors, now, rest_m, x, external_n);
    let model = &tick.environment.contact;
    if tools.is_empty() {
        contact.travelled(now.fastest_m_per_s * now.dt_s);
    } else {
        let body = BodyMotion { x, v, fastest_m_per_s: now.fastest_m_per_s };
        model.substep(&body, &tick.substep_time(now), tools, contact, external_n, scratch);
    }
    model.press_walls_of_nodes(x, contact, external_n, scratch);
    *force_is_current = true;
}
