//! The force at an instant of a tick, for every integrator.
use super::{hybrid, springs};
use crate::{
    contact::{Body, ContactState, SubstepTime},
    elements::loads::{LoadPositions, add_load_n},
    settings::LoadSpec,
    world::{Model, PointForce, Scratch, State, TickInput},
};
use glam::DVec3;

/// What is the same during all of a tick.
pub(super) struct Tick<'a> {
    pub(super) model: &'a Model,
    pub(super) input: &'a TickInput<'a>,
    pub(super) loads: LoadRamp,
    /// Substeps it is taken in.
    pub(super) substeps: u32,
}

/// When forces are evaluated, and how the body came there.
pub(super) struct Evaluation {
    /// Part of the tick that is over.
    pub(super) fraction: f64,
    /// The same for loads.
    pub(super) load_fraction: f64,
    /// Step that led here (s); 0 at the start.
    pub(super) dt_s: f64,
    /// Bound of the speed (m/s) with which any node came here.
    pub(super) fastest_m_per_s: f64,
    /// Whether a long step of a hybrid body's coarse level ends here.
    pub(super) ends_long_step: bool,
}

impl Evaluation {
    fn before_a_step(fraction: f64, load_fraction: f64) -> Self {
        Self { fraction, load_fraction, dt_s: 0.0, fastest_m_per_s: 0.0, ends_long_step: true }
    }
}

impl Tick<'_> {
    /// Whether a long step of a hybrid body's coarse level ends with substep `number` (from 1).
    pub(super) fn ends_long_step(&self, number: u32) -> bool {
        number.is_multiple_of(self.model.substeps_per_long_step())
    }

    /// Substep `dt` (s).
    pub(super) fn dt_s(&self) -> f64 {
        self.model.spec().settings.tick_period_s / f64::from(self.substeps)
    }

    /// Forces at the start of the tick, unless the last tick left them.
    pub(super) fn make_force_current(&self, state: &mut State, scratch: &mut Scratch) {
        let of_hybrid = scratch.hybrid.as_mut().map(|own| &mut own.skin_is_tracked);
        let tracked = of_hybrid.or(scratch.springs.as_mut().map(|own| &mut own.skin_is_tracked));
        let is_tracked = tracked.is_some_and(std::mem::take);
        if !state.force_is_current {
            if !is_tracked {
                state.contact.forget_geometry();
            }
            self.evaluate(state, scratch, &Evaluation::before_a_step(0.0, 0.0));
        }
    }

    /// Forces at the start of substep `number` (from 1), with loads and injected forces as at its end.
    pub(super) fn evaluate_before(&self, number: u32, state: &mut State, scratch: &mut Scratch) {
        if !state.force_is_current {
            state.contact.forget_geometry();
        }
        let part = |substeps_done: u32| f64::from(substeps_done) / f64::from(self.substeps);
        let (fraction, load_fraction) = (part(number - 1), part(number));
        self.evaluate(state, scratch, &Evaluation::before_a_step(fraction, load_fraction));
    }

    /// Forces at the end of substep `number` (from 1), to which the nodes came with at most `fastest_m_per_s`.
    pub(super) fn evaluate_after(&self, number: u32, fastest_m_per_s: f64, state: &mut State, scratch: &mut Scratch) {
        let fraction = f64::from(number) / f64::from(self.substeps);
        let ends_long_step = self.ends_long_step(number);
        let now = Evaluation { fraction, load_fraction: fraction, dt_s: self.dt_s(), fastest_m_per_s, ends_long_step };
        self.evaluate(state, scratch, &now);
    }

    /// Adds loads and injected forces (N) on a surface whose nodes are at these places (m), at rest and now.
    pub(super) fn add_given_n(
        &self,
        load_factors: &[f64],
        now: &Evaluation,
        (rest_m, x): (&[DVec3], &[DVec3]),
        forces_n: &mut [DVec3],
    ) {
        let Self { model, input, loads, .. } = self;
        for (index, load) in model.spec().loads.iter().enumerate() {
            let factor = loads.factor(load_factors[index], input, index, now.load_fraction);
            if factor != 0.0 {
                add_load_n(load, factor, model.surface(), LoadPositions { rest_m, deformed_m: x }, forces_n);
            }
        }
        for point in self.usable_points() {
            forces_n[point.node as usize] += point.force_n;
        }
    }

    /// Injected forces on what there is.
    pub(super) fn usable_points(&self) -> impl Iterator<Item = &PointForce> {
        self.input.point_forces.iter().filter(|point| is_usable(self.model, point))
    }

    /// Vertices that contact lists, that loads act on, and injected forces.
    pub(super) fn list_touched(&self, contact: &ContactState, mut list: impl FnMut(u32)) {
        self.model.contact().listed_nodes(contact).for_each(&mut list);
        for load in &self.model.spec().loads {
            match load {
                LoadSpec::NodalForces(forces) => forces.iter().for_each(|(vertex, _)| list(*vertex)),
                LoadSpec::Traction { triangles, .. } | LoadSpec::Pressure { triangles, .. } => {
                    let nodes =
                        triangles.iter().flat_map(|&triangle| self.model.surface().triangle_nodes(triangle as usize));
                    nodes.for_each(&mut list);
                }
            }
        }
        self.usable_points().for_each(|point| list(point.node));
    }

    /// Total force at the present positions into `state.force_n`, its external part into `state.external_n`.
    fn evaluate(&self, state: &mut State, scratch: &mut Scratch, now: &Evaluation) {
        let model = self.model;
        if let (Some(body), Some(own)) = (model.hybrid(), &mut scratch.hybrid) {
            return hybrid::evaluate(self, body, state, (own, &mut scratch.contact), now);
        }
        if let (Some(body), Some(own)) = (model.springs(), &mut scratch.springs) {
            return springs::evaluate(self, body, state, (own, &mut scratch.contact), now);
        }
        let external = &mut state.external_n;
        external.fill(DVec3::ZERO);
        self.add_given_n(&state.load_factors, now, (model.rest_positions_m(), &state.x), external);
        let (x, v) = (&state.x, &state.v);
        if !state.tools.is_empty() {
            let body = Body { x, v, fastest_m_per_s: now.fastest_m_per_s };
            let tick_period_s = model.spec().settings.tick_period_s;
            let time = SubstepTime { fraction: now.fraction, dt_s: now.dt_s, tick_period_s };
            let (tools, contact) = (&mut state.tools, &mut state.contact);
            model.contact().substep(&body, &time, tools, contact, external, &mut scratch.contact);
        }
        state.force_is_current = true;
        if model.seed().is_some() {
            // Its steps make the other forces.
            return;
        }
        let force = &mut state.force_n;
        let viscous_power_w = model.kernel().forces_n(model.rest_positions_m(), x, v, force, &mut scratch.kernel);
        state.viscous.record(viscous_power_w, now.dt_s > 0.0);
        let gravity = model.gravity_m_per_s2();
        for ((force, external), mass) in force.iter_mut().zip(external.iter()).zip(model.mass_kg()) {
            *force += *external + gravity * *mass;
        }
    }
}

/// Load factors between the last tick's and this one's.
pub(super) struct LoadRamp {
    pub(super) usable: bool,
}

impl LoadRamp {
    pub(super) fn new(state: &State, input: &TickInput<'_>) -> Self {
        let usable =
            input.load_factors.len() == state.load_factors.len() && input.load_factors.iter().all(|f| f.is_finite());
        Self { usable }
    }

    pub(super) fn factor(&self, from: f64, input: &TickInput<'_>, load: usize, fraction: f64) -> f64 {
        if self.usable { from + (input.load_factors[load] - from) * fraction } else { from }
    }

    pub(super) fn finish(&self, state: &mut State, input: &TickInput<'_>) {
        if self.usable {
            state.load_factors.copy_from_slice(input.load_factors);
        }
    }
}

/// A force on a node that there is; of a seed body, on one of its surface.
pub(super) fn is_usable(model: &Model, point: &PointForce) -> bool {
    let by_vertices = model.hybrid().is_some() || model.springs().is_some();
    let nodes = if by_vertices { model.surface().nodes.len() } else { model.mass_kg().len() };
    let of_surface = || model.surface().vertex_of_node.get(point.node as usize).is_some_and(|&v| v != u32::MAX);
    (point.node as usize) < nodes && point.force_n.is_finite() && (model.seed().is_none() || of_surface())
}
