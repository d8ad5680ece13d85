//! A body that the server's step drives through a problem.
use super::subject::Tool;
use glam::DVec3;
use palpate_physics::{Energies, Model, Scratch, State, TickInput, contact::ToolTarget, step};

/// The state, and what drives it.
pub(super) struct Driven {
    pub(super) state: State,
    pub(super) scratch: Scratch,
    targets: Vec<ToolTarget>,
    factors: Vec<f64>,
    prescribed_m: Vec<DVec3>,
    failure: Option<String>,
}

impl Driven {
    /// At rest, the tool where it first touches.
    pub(super) fn at_rest(model: &Model, tool: Option<&Tool>) -> Self {
        let target = |tool: &Tool| ToolTarget::at(tool.touch_m);
        Self {
            state: State::at_rest(model),
            scratch: Scratch::new(model),
            targets: tool.into_iter().map(target).collect(),
            factors: vec![0.0; model.loads().len()],
            prescribed_m: vec![DVec3::ZERO; model.prescribed().len()],
            failure: None,
        }
    }

    /// One tick, at whose end the tool is, and loads are, so far.
    pub(super) fn tick(&mut self, model: &Model, tool: Option<&Tool>, fraction: f64) {
        if let Some(tool) = tool {
            let period_s = model.settings().tick_period_s;
            for target in &mut self.targets {
                let position_m = tool.centre_m(fraction);
                target.velocity_m_per_s = (position_m - target.position_m) / period_s;
                target.position_m = position_m;
            }
        }
        self.factors.fill(fraction);
        let input = TickInput {
            tools: &self.targets,
            load_factors: &self.factors,
            prescribed_displacements_m: &self.prescribed_m,
            point_forces: &[],
        };
        let report = step(model, &mut self.state, &mut self.scratch, &input);
        if let Some(quarantine) = report.quarantined {
            self.failure = Some(quarantine.to_string());
        }
    }

    /// Force (N) of the tools on the body.
    pub(super) fn tool_force_n(&self) -> DVec3 {
        self.state.mechanical.tools.iter().map(|tool| tool.contact_force_n).sum()
    }

    /// The ledger's error, over the work of loads and tools.
    pub(super) fn energy_error(&self, model: &Model) -> Option<f64> {
        let energies = Energies::of(model, &self.state);
        Some((energies.balance_j() / energies.external_work_j).abs()).filter(|error| error.is_finite())
    }

    /// Why it cannot go on.
    pub(super) fn failure(&self) -> Option<String> {
        self.failure.clone()
    }
}
