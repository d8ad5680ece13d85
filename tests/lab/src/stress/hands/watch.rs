//! What is watched while a hand presses.
use super::{
    Body,
    hand::{Hand, Press},
};
use crate::stress::{
    Measured, Outcome,
    rig::{Drive, Rig},
};
use glam::DVec3;
use miette::Result;
use palpate_physics::{
    Energies, ModelSpec,
    contact::{ToolState, is_inside},
};

/// Largest fall of the force, over the force before, in a tick and in 20 ms of a slow press.
const MOST_IN_A_TICK: f64 = 0.05;
const MOST_IN_20_MS: f64 = 0.20;
/// Largest error of the ledger over the largest energy that moved.
pub(super) const MOST_IMBALANCE: f64 = 0.05;
/// Force (N) below which a fall is none, as samples come and go.
const LEAST_N: f64 = 0.05;
/// Energy (J) that counts as moved even where a hand hardly touches: forces in f32 are wrong by as much as a part of it.
const LEAST_J: f64 = 1e-6;
/// Depth (m) of the surface in a tool, over its radius, at which it presses.
const DEEP: f64 = 0.02;
/// Number of ticks between two looks at whether a tool is inside.
pub(super) const LOOK_EVERY: u32 = 5;
/// Ticks after the hand is back.
const LATER_TICKS: u32 = 100;

/// What a press came to.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Found {
    /// Tick that was refused.
    pub(super) quarantined: Option<u64>,
    /// Whether the tool's centre was in the body.
    pub(super) is_inside: bool,
    /// Whether the tool carried no force while the surface was in it, and how deep (m) that was.
    pub(super) lets_go: bool,
    pub(super) depth_m: f64,
    pub(super) fall_in_a_tick: f64,
    pub(super) fall_in_20_ms: f64,
    pub(super) imbalance: f64,
    pub(super) force_n: f64,
    pub(super) repeated: u32,
    /// Most substeps, over the model's.
    pub(super) substeps: f64,
}

impl Found {
    /// Returns the worse one of both in everything that is a number.
    pub(super) fn worse(&self, other: &Self) -> Self {
        Self {
            imbalance: self.imbalance.max(other.imbalance),
            force_n: self.force_n.max(other.force_n),
            repeated: self.repeated + other.repeated,
            substeps: self.substeps.max(other.substeps),
            ..*self
        }
    }

    /// Demands what every press has to come to; of the force that it does not fall only if `may_not_fall`. `at` says which press it is.
    pub(super) fn judge(&self, may_not_fall: bool, outcome: &mut Outcome, at: &dyn Fn() -> String) {
        if let Some(tick) = self.quarantined {
            outcome.broken.push(format!("{}: quarantined at tick {tick}", at()));
        }
        outcome.demand(!self.is_inside, || format!("{}: the tool is inside the body", at()));
        outcome.demand(!self.lets_go, || format!("{}: no force at {:.1} mm of depth", at(), 1e3 * self.depth_m));
        for (fall, most, when) in
            [(self.fall_in_a_tick, MOST_IN_A_TICK, "a tick"), (self.fall_in_20_ms, MOST_IN_20_MS, "20 ms")]
        {
            outcome.demand(!may_not_fall || fall <= most, || {
                format!("{}: the force fell by {:.0} % in {when}", at(), 100.0 * fall)
            });
        }
        outcome.demand(self.imbalance <= MOST_IMBALANCE, || {
            format!("{}: {:.3} of what moved came from nowhere or went there", at(), self.imbalance)
        });
    }

    /// Adds the numbers of a body's worst press.
    pub(super) fn push(&self, body: &str, outcome: &mut Outcome) {
        let name = |what: &str| format!("{body}: {what}");
        outcome.push(Measured::value(name("largest force"), self.force_n, "N"));
        outcome.push(Measured::value(name("ticks taken back"), f64::from(self.repeated), "ticks"));
        outcome.push(Measured::value(name("most substeps over the model's"), self.substeps, "1"));
        let ledger = name("error of the ledger over what moved");
        outcome.push(Measured::bounded(ledger, self.imbalance, "1", MOST_IMBALANCE));
    }
}

/// The error of the ledger over the largest energy that moved, until now.
#[derive(Debug, Clone, Copy)]
pub(super) struct LedgerSeen {
    moved_j: f64,
    imbalance_j: f64,
}

impl LedgerSeen {
    pub(super) const NOTHING: Self = Self { moved_j: LEAST_J, imbalance_j: 0.0 };

    pub(super) fn look(&mut self, energies: &Energies) {
        for energy_j in [energies.kinetic_j, energies.elastic_j, energies.external_work_j, energies.dissipated_j] {
            self.moved_j = self.moved_j.max(energy_j.abs());
        }
        self.imbalance_j = self.imbalance_j.max(energies.balance_j().abs());
    }

    pub(super) fn imbalance(self) -> f64 {
        self.imbalance_j / self.moved_j
    }
}

/// Whether a tool carries no force where the surface is in it.
///
/// One tick is none: where contact ends as a tick begins, the tick has a depth, but no force in it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct LettingGo {
    had_none: bool,
}

impl LettingGo {
    /// Looks at the next tick. Returns whether a tool of this radius (m) let go in it and in the one before.
    pub(super) fn look(&mut self, tool: &ToolState, radius_m: f64) -> bool {
        let has_none = tool.penetration_m > DEEP * radius_m && tool.contact_force_n == DVec3::ZERO;
        std::mem::replace(&mut self.had_none, has_none) && has_none
    }
}

/// Presses a body, and watches.
pub(super) fn watch(spec: &ModelSpec, body: &Body, press: &Press) -> Result<Found> {
    let mut rig = Rig::new(ModelSpec { tools: vec![press.tool.clone()], ..spec.clone() })?;
    let mut drive = Drive::still(&rig.model);
    let mut hand = Hand::new(press);
    let period_s = rig.model.settings().tick_period_s;
    let is_slow = press.is_inland && press.speed_m_per_s <= body.slow_m_per_s;
    let triangles = rig.model.surface().triangles.clone();
    let (mut found, mut surface_m, mut ledger) = (Found::default(), Vec::new(), LedgerSeen::NOTHING);
    let (mut forces_n, mut later, mut letting_go) = (Vec::new(), 0, LettingGo::default());
    while later < LATER_TICKS {
        let tool = &rig.state.mechanical.tools[0];
        drive.tools[0] = hand.go_on(period_s, tool.device_force_n.length());
        later += u32::from(hand.is_over());
        let report = rig.tick(&drive);
        found.repeated += report.repeated;
        found.substeps = found.substeps.max(f64::from(report.substeps) / f64::from(rig.model.substeps()));
        if let Some(quarantine) = report.quarantined {
            found.quarantined = Some(quarantine.tick);
            return Ok(found);
        }
        let tool = &rig.state.mechanical.tools[0];
        let force_n = tool.contact_force_n.length();
        found.force_n = found.force_n.max(force_n);
        if letting_go.look(tool, press.tool.radius_m) {
            (found.lets_go, found.depth_m) = (true, found.depth_m.max(tool.penetration_m));
        }
        if hand.presses() && is_slow {
            forces_n.push(force_n);
            let fall = |ticks: usize| {
                let most_n = forces_n.iter().rev().take(ticks + 1).fold(0.0_f64, |most, force| most.max(*force));
                if most_n > LEAST_N { 1.0 - force_n / most_n } else { 0.0 }
            };
            found.fall_in_a_tick = found.fall_in_a_tick.max(fall(1));
            found.fall_in_20_ms = found.fall_in_20_ms.max(fall(20));
        }
        ledger.look(&rig.energies());
        if body.is_closed && rig.state.mechanical.tick.is_multiple_of(LOOK_EVERY.into()) {
            rig.model.surface_positions_m(&rig.state, &mut surface_m);
            found.is_inside |= is_inside(rig.state.mechanical.tools[0].centre_m, &triangles, &surface_m);
        }
    }
    found.imbalance = ledger.imbalance();
    Ok(found)
}
