//! A body at work: it rings, and a tool, if it has one, goes in and stays.
use glam::DVec3;
use palpate_physics::{
    Model, Scratch, State, StepReport, TickInput,
    contact::{ToolSpec, ToolTarget},
    step,
};

/// A body under way. [`Press::tick`] does not allocate.
#[derive(Debug)]
pub struct Press<'m> {
    model: &'m Model,
    state: State,
    scratch: Scratch,
    prescribed_m: Vec<DVec3>,
    targets: Vec<ToolTarget>,
    depth_m: f64,
    approach_ticks: usize,
    tick: usize,
}

impl<'m> Press<'m> {
    /// Tools go along −x from where they start, `depth_m` deep within `approach_ticks`.
    pub fn new(model: &'m Model, depth_m: f64, approach_ticks: usize) -> Self {
        let mut state = State::at_rest(model);
        for (v, x) in state.mechanical.v.iter_mut().zip(model.rest_positions_m()) {
            *v = DVec3::new(x.y, x.x, 0.0);
        }
        Self {
            state,
            scratch: Scratch::new(model),
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            targets: vec![ToolTarget::default(); model.tools().len()],
            model,
            depth_m,
            approach_ticks,
            tick: 0,
        }
    }

    /// One tick.
    pub fn tick(&mut self) -> StepReport {
        let depth_m = self.depth_m * (self.tick as f64 / self.approach_ticks as f64).min(1.0);
        for (target, tool) in self.targets.iter_mut().zip(self.model.tools()) {
            target.position_m = tool.start_position_m - DVec3::X * depth_m;
        }
        self.tick += 1;
        let input = TickInput {
            tools: &self.targets,
            load_factors: &[],
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: &[],
        };
        step(self.model, &mut self.state, &mut self.scratch, &input)
    }

    /// Its state now.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Contact samples of the first tool that carry force.
    pub fn contacts(&self) -> u32 {
        self.state.mechanical.tools.first().map_or(0, |tool| tool.contacts)
    }
}

/// A body at rest whose first tool is led by hand, tick by tick.
#[derive(Debug)]
pub struct Slow<'m> {
    model: &'m Model,
    state: State,
    scratch: Scratch,
    prescribed_m: Vec<DVec3>,
    targets: Vec<ToolTarget>,
}

impl<'m> Slow<'m> {
    /// At rest, with every tool where it starts.
    pub fn at_rest(model: &'m Model) -> Self {
        Self {
            model,
            state: State::at_rest(model),
            scratch: Scratch::new(model),
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            targets: model.tools().iter().map(ToolSpec::start).collect(),
        }
    }

    /// One tick, at whose end the first tool is there (m); returns the force (N) of the body on it.
    pub fn tick(&mut self, position_m: DVec3) -> DVec3 {
        let Some(target) = self.targets.first_mut() else { return DVec3::ZERO };
        target.position_m = position_m;
        let input = TickInput {
            tools: &self.targets,
            load_factors: &[],
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: &[],
        };
        step(self.model, &mut self.state, &mut self.scratch, &input);
        self.state.mechanical.tools[0].contact_force_n
    }

    /// Its state now.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Where the first tool is (m).
    pub fn tool_m(&self) -> DVec3 {
        self.state.mechanical.tools.first().map_or(DVec3::NAN, |tool| tool.centre_m)
    }
}
