//! Random leaps of a device into and across the body, and tools that are put into it.
//!
//! Found by it, or what it was written after: a leap of 90 mm crossed a block of 40 mm; of twelve tools that were put 4 to
//! 6 mm into a body ten ended it in quarantine; a tool that was put into a wall was caught there, however often its device
//! went out and in.
use super::{
    BODIES, Body,
    hand::Press,
    spec,
    watch::{DEEP, LOOK_EVERY, LedgerSeen, MOST_IMBALANCE},
};
use crate::stress::{
    Measured, Options, Outcome,
    random::Random,
    rig::{Drive, Rig},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::{
    Model, ModelSpec,
    contact::{ToolTarget, is_inside},
};
use std::fmt;

pub(in crate::stress) const CRITERION: &str = "a device leaps 5 to 90 mm into or across a shipped body, or its tool is put \
     0.1 to 1.5 radii into it: finite, no quarantine, a tool that leaps never inside, force where there is depth, and clear of the body \
     once the device is, unless the body is between them";

/// Ticks before a leap, there, and after the device is back.
const BEFORE_TICKS: u32 = 20;
const THERE_TICKS: u32 = 200;
const BACK_TICKS: u32 = 400;
/// Distance (m) from its device within which a tool that is clear of the body has come to it.
const FOLLOWS_M: f64 = 1e-3;
/// Distance between two looks at whether a body is between a tool and its device, over the tool's radius.
const LOOK_EVERY_RADII: f64 = 0.2;

/// What a device does.
#[derive(Debug, Clone, Copy)]
enum Act {
    /// It leaps so far (m) beyond where it would touch the body, and back later.
    Leap { beyond_m: f64 },
    /// Its tool is put so deep (m), and goes out at this speed (m/s) later.
    Put { depth_m: f64, out_m_per_s: f64 },
}

impl Act {
    fn random(press: &Press, random: &mut Random) -> Self {
        if random.chance(0.5) {
            Self::Leap { beyond_m: random.log_within(5e-3, 90e-3) }
        } else {
            let depth_m = press.tool.radius_m * random.within(0.1, 1.5);
            Self::Put { depth_m, out_m_per_s: random.log_within(0.05, 0.5) }
        }
    }

    /// Returns how far (m) the device is from its start in a tick.
    fn way_m(self, gap_m: f64, tick: u32, period_s: f64) -> f64 {
        match self {
            Self::Leap { beyond_m } => {
                if (BEFORE_TICKS..BEFORE_TICKS + THERE_TICKS).contains(&tick) {
                    gap_m + beyond_m
                } else {
                    0.0
                }
            }
            Self::Put { depth_m, out_m_per_s } => {
                let out_ticks = tick.saturating_sub(THERE_TICKS);
                (gap_m + depth_m - out_m_per_s * f64::from(out_ticks) * period_s).max(0.0)
            }
        }
    }

    /// Returns the number of ticks until the device is back at its start.
    fn lasts_ticks(self, gap_m: f64, period_s: f64) -> u32 {
        match self {
            Self::Leap { .. } => BEFORE_TICKS + THERE_TICKS,
            Self::Put { depth_m, out_m_per_s } => {
                THERE_TICKS + ((gap_m + depth_m) / (out_m_per_s * period_s)).ceil() as u32
            }
        }
    }
}

impl fmt::Display for Act {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Leap { beyond_m } => write!(f, "leaps {:.0} mm", 1e3 * beyond_m),
            Self::Put { depth_m, .. } => write!(f, "put {:.1} mm deep", 1e3 * depth_m),
        }
    }
}

/// What it came to.
#[derive(Debug, Clone, Copy, Default)]
struct Found {
    quarantined: Option<u64>,
    is_inside: bool,
    lets_go: bool,
    is_caught: bool,
    imbalance: f64,
    force_n: f64,
}

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let leaps = options.pick(2, 12, 1000);
    let mut outcome = Outcome::passing();
    for body in &BODIES {
        let spec = spec(body).wrap_err(body.name)?;
        let bare = Model::build(ModelSpec { tools: Vec::new(), ..spec.clone() }).into_diagnostic()?;
        let (mut imbalance, mut force_n) = (0.0_f64, 0.0_f64);
        for number in 0..leaps {
            let seed = options.seed.wrapping_add(number);
            let mut random = Random::new(seed);
            let press = Press::random(&bare, body, &mut random)?;
            let act = Act::random(&press, &mut random);
            let found = watch(&spec, body, &press, act)?;
            let at = || format!("{}, seed {seed} ({press}; {act})", body.name);
            if let Some(tick) = found.quarantined {
                outcome.broken.push(format!("{}: quarantined at tick {tick}", at()));
            }
            outcome.demand(!found.is_inside, || format!("{}: the tool is inside the body", at()));
            outcome.demand(!found.lets_go, || format!("{}: no force where there is depth", at()));
            outcome.demand(!found.is_caught, || format!("{}: the tool is caught", at()));
            outcome.demand(found.imbalance <= MOST_IMBALANCE, || {
                format!("{}: {:.3} of what moved came from nowhere or went there", at(), found.imbalance)
            });
            (imbalance, force_n) = (imbalance.max(found.imbalance), force_n.max(found.force_n));
        }
        let name = |what: &str| format!("{}: {what}", body.name);
        outcome.push(Measured::value(name("largest force"), force_n, "N"));
        outcome.push(Measured::bounded(name("error of the ledger over what moved"), imbalance, "1", MOST_IMBALANCE));
    }
    Ok(outcome)
}

/// Lets a device act, and watches.
fn watch(spec: &ModelSpec, body: &Body, press: &Press, act: Act) -> Result<Found> {
    let mut rig = Rig::new(ModelSpec { tools: vec![press.tool.clone()], ..spec.clone() })?;
    let mut drive = Drive::still(&rig.model);
    let (period_s, start) = (rig.model.settings().tick_period_s, press.tool.start());
    let at = |way_m: f64| ToolTarget { position_m: start.position_m + press.along * way_m, ..start };
    let is_put = matches!(act, Act::Put { .. });
    if is_put {
        rig.state.place_tool(0, at(act.way_m(press.gap_m, 0, period_s)));
    }
    let triangles = rig.model.surface().triangles.clone();
    let (mut found, mut surface_m, mut ledger) = (Found::default(), Vec::new(), LedgerSeen::NOTHING);
    let mut had_none = false;
    for tick in 0..act.lasts_ticks(press.gap_m, period_s) + BACK_TICKS {
        drive.tools[0] = at(act.way_m(press.gap_m, tick, period_s));
        let report = rig.tick(&drive);
        if let Some(quarantine) = report.quarantined {
            found.quarantined = Some(quarantine.tick);
            return Ok(found);
        }
        let tool = &rig.state.mechanical.tools[0];
        let force_n = tool.contact_force_n.length();
        found.force_n = found.force_n.max(force_n);
        // A contact that ends as the tick begins has a depth, but no force in it.
        let has_none = !is_put && tool.penetration_m > DEEP * press.tool.radius_m && force_n == 0.0;
        found.lets_go |= has_none && had_none;
        had_none = has_none;
        if !tick.is_multiple_of(LOOK_EVERY) {
            continue;
        }
        ledger.look(&rig.energies());
        if body.is_closed && !is_put {
            rig.model.surface_positions_m(&rig.state, &mut surface_m);
            found.is_inside |= is_inside(tool_centre_m(&rig), &triangles, &surface_m);
        }
    }
    let is_away = tool_centre_m(&rig).distance(start.position_m) > FOLLOWS_M;
    rig.model.surface_positions_m(&rig.state, &mut surface_m);
    let is_held_off = !is_put
        && (!body.is_closed
            || is_between(tool_centre_m(&rig), start.position_m, press.tool.radius_m, &triangles, &surface_m));
    found.is_caught = !is_held_off && (is_away || rig.state.mechanical.contact.touches(0));
    found.imbalance = ledger.imbalance();
    Ok(found)
}

/// Returns whether a closed body is between two points (m): a tool that is drawn straight from one to the other is held off by it.
fn is_between(from_m: DVec3, to_m: DVec3, radius_m: f64, triangles: &[[u32; 3]], surface_m: &[DVec3]) -> bool {
    let parts = (from_m.distance(to_m) / (LOOK_EVERY_RADII * radius_m)).ceil().max(1.0) as u32;
    (1..parts).any(|part| {
        let at_m = from_m.lerp(to_m, f64::from(part) / f64::from(parts));
        is_inside(at_m, triangles, surface_m)
    })
}

fn tool_centre_m(rig: &Rig) -> DVec3 {
    rig.state.mechanical.tools[0].centre_m
}
