//! One tick: input → contact and dynamics → coupling → publish.
//!
//! Does not allocate, lock, log or await: slots are fixed, bells are one `write` to an eventfd, and `tests/no_allocation.rs`
//! counts.
use super::{
    simulation::Simulation,
    timing::Timing,
    tool::{Moment, Order, ToolLoop},
};
use palpate_physics::{StepReport, TickInput, step};
use palpate_realtime::Clock;

/// How often a tool that waits to be clear of the body is looked for in it; a look costs a pass over the surface.
const LOOK_EVERY_TICKS: u64 = 16;

/// What the loop wants of a tick.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Plan {
    /// Whether time advances.
    pub advance: bool,
    /// What arms get.
    pub order: Order,
}

impl Simulation {
    /// Runs a tick.
    pub fn tick(&mut self, plan: Plan, clock: &Clock, timing: &Timing) {
        let begun_ns = clock.now_ns();
        for tool in &mut self.tools {
            tool.listen(begun_ns);
        }
        if plan.advance {
            self.read_inputs(begun_ns);
        }
        let input_done_ns = clock.now_ns();
        if plan.advance {
            timing.count(&self.advance());
        }
        timing.note_quarantine(self.state.quarantine.map(|q| q.tick));
        let step_done_ns = clock.now_ns();
        self.couple(plan, begun_ns);
        let coupling_done_ns = clock.now_ns();
        self.publish((coupling_done_ns - begun_ns) as f64 * 1e-3);
        let end_ns = clock.now_ns();
        if plan.advance {
            let marks = [begun_ns, input_done_ns, step_done_ns, coupling_done_ns, end_ns];
            for (stage, pair) in timing.stages.iter().zip(marks.windows(2)) {
                stage.record(pair[1] - pair[0]);
            }
            timing.tick.record(end_ns - begun_ns);
        }
    }

    fn read_inputs(&mut self, now_ns: u64) {
        let period_s = self.period_s();
        let time_s = (self.state.mechanical.tick + 1) as f64 * period_s;
        for (index, target) in self.targets.iter_mut().enumerate() {
            if let Some(pose) = self.tools[index].new_place() {
                self.state.place_tool(index, pose);
            }
            *target = self.tools[index].target(&self.state.mechanical.tools[index], now_ns, time_s);
        }
        self.timeline.fill(time_s, &mut self.load_factors, &mut self.prescribed_m);
    }

    fn advance(&mut self) -> StepReport {
        let has_arm = self.tools.iter().any(ToolLoop::is_attached);
        let bound_n = has_arm.then_some(self.max_injected_force_n);
        let input = TickInput {
            tools: &self.targets,
            load_factors: &self.load_factors,
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: self.injections.acting_in(self.state.mechanical.tick + 1, bound_n),
        };
        step(&self.model, &mut self.state, &mut self.scratch, &input)
    }

    fn couple(&mut self, plan: Plan, now_ns: u64) {
        let quarantined = self.state.quarantine.map(|q| q.tick);
        let moment = Moment { now_ns, tick: self.state.mechanical.tick, period_s: self.period_s(), quarantined };
        let look = plan.advance && self.state.mechanical.tick.is_multiple_of(LOOK_EVERY_TICKS);
        for (index, (tool, state)) in self.tools.iter_mut().zip(&self.state.mechanical.tools).enumerate() {
            // One that touches nothing is outside the body, or deep inside it.
            let may_be_clear = look && tool.waits_to_be_clear() && !self.state.mechanical.contact.touches(index);
            if may_be_clear && !self.inside.holds(&self.model, &self.state, state.centre_m) {
                tool.found_clear();
            }
            tool.couple(state, &moment, plan.order, plan.advance);
        }
    }

    fn publish(&mut self, tick_cost_us: f64) {
        for tool in &mut self.tools {
            tool.publish();
        }
        let period = self.demand.period_ticks();
        if period == 0 {
            self.ticks_to_frame = 0;
            return;
        }
        self.ticks_to_frame = self.ticks_to_frame.min(period);
        if self.ticks_to_frame == 0 {
            self.ticks_to_frame = period;
            self.publish_surface(tick_cost_us);
        }
        self.ticks_to_frame -= 1;
    }
}
