//! Random leaps of a device into and across the body, and tools that are put into it.
//!
//! Found by it, or what it was written after: a leap of 90 mm crossed a block of 40 mm; of twelve tools that were put 4 to
//! 6 mm into a body ten ended it in quarantine; a tool that was put into a wall was caught there, however often its device
//! went out and in.
use super::{
    BODIES, Body,
    hand::Press,
    spec,
    watch::{LOOK_EVERY, LedgerSeen, LettingGo, MOST_IMBALANCE},
};
use crate::random::Random;
use crate::stress::{
    Measured, Options, Outcome,
    rig::{Drive, Rig},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, WrapErr};
use palpate_physics::{
    Model, ModelSpec,
    contact::{ToolTarget, closest_weights, is_inside},
};
use std::fmt;

pub(in crate::stress) const CRITERION: &str = "a device leaps 5 to 90 mm into or across a shipped body, or its tool is put \
     0.1 to 1.5 radii into it: finite, no quarantine, a tool that leaps never inside, force where there is depth, and clear of the body \
     once the device is, unless it would have to go deeper on its way there";

/// Ticks before a leap, there, and after the device is back: at least, and at most of a tool that still moves.
const BEFORE_TICKS: u32 = 20;
const THERE_TICKS: u32 = 200;
const BACK_TICKS: u32 = 400;
const MOST_BACK_TICKS: u32 = 4000;
/// Ticks in which a tool moves that has not come to rest, and how far (m).
const REST_TICKS: u32 = 200;
const REST_M: f64 = 5e-4;
/// Distance (m) from its device within which a tool that is clear of the body has come to it.
const FOLLOWS_M: f64 = 1e-3;
/// Distance between two looks at whether a body is between a tool and its device, and how much deeper the tool would have to
/// go into it on the way than it is, both over the tool's radius.
const LOOK_EVERY_RADII: f64 = 0.2;
const DEEPER_RADII: f64 = 0.1;

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
    for shipped in &BODIES {
        let body = &shipped.body;
        let spec = spec(shipped).wrap_err(body.name)?;
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
    let mut letting_go = LettingGo::default();
    let back_tick = act.lasts_ticks(press.gap_m, period_s);
    let (mut rested_m, mut tick) = (start.position_m, 0);
    loop {
        let is_back = tick >= back_tick + BACK_TICKS;
        if is_back && tick.is_multiple_of(REST_TICKS) {
            let rests = tool_centre_m(&rig).distance(rested_m) < REST_M;
            rested_m = tool_centre_m(&rig);
            if rests || tick > back_tick + MOST_BACK_TICKS {
                break;
            }
        }
        drive.tools[0] = at(act.way_m(press.gap_m, tick, period_s));
        let report = rig.tick(&drive);
        if let Some(quarantine) = report.quarantined {
            found.quarantined = Some(quarantine.tick);
            return Ok(found);
        }
        let tool = &rig.state.mechanical.tools[0];
        let force_n = tool.contact_force_n.length();
        found.force_n = found.force_n.max(force_n);
        found.lets_go |= letting_go.look(tool, press.tool.radius_m) && !is_put;
        tick += 1;
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
    let held_off = || Swept { rig: &rig, radius_m: press.tool.radius_m, triangles: &triangles, surface_m: &surface_m };
    let is_held_off = !is_put && (!body.is_closed || held_off().meets_more(start.position_m));
    found.is_caught = !is_held_off && (is_away || rig.state.mechanical.contact.touches(0));
    found.imbalance = ledger.imbalance();
    Ok(found)
}

/// A tool that is drawn straight to a point, as if nothing gave way.
struct Swept<'a> {
    rig: &'a Rig,
    radius_m: f64,
    triangles: &'a [[u32; 3]],
    surface_m: &'a [DVec3],
}

impl Swept<'_> {
    /// Returns whether a closed body is in its way: whether it would go deeper into it than it is now.
    fn meets_more(&self, to_m: DVec3) -> bool {
        let from_m = tool_centre_m(self.rig);
        let parts = (from_m.distance(to_m) / (LOOK_EVERY_RADII * self.radius_m)).ceil().max(1.0) as u32;
        let nearest_m = self.clearance_m(DVec3::ZERO) - DEEPER_RADII * self.radius_m;
        (1..parts).any(|part| self.clearance_m((to_m - from_m) * (f64::from(part) / f64::from(parts))) < nearest_m)
    }

    /// Returns the distance (m) from the axis of the tool, moved by so much (m), to the surface; negative where a point of it is
    /// inside.
    fn clearance_m(&self, by_m: DVec3) -> f64 {
        let tool = &self.rig.model.tools()[0];
        let half_m = self.rig.state.mechanical.tools[0].orientation * (DVec3::Z * tool.shape.half_length_m());
        let of = |at_m: DVec3| {
            let distance_m = self.triangles.iter().map(|corners| {
                let corners = corners.map(|node| self.surface_m[node as usize]);
                let [wa, wb, wc] = closest_weights(at_m, corners);
                at_m.distance(corners[0] * wa + corners[1] * wb + corners[2] * wc)
            });
            let distance_m = distance_m.fold(f64::INFINITY, f64::min);
            if is_inside(at_m, self.triangles, self.surface_m) { -distance_m } else { distance_m }
        };
        [-1.0, 0.0, 1.0]
            .map(|part| of(tool_centre_m(self.rig) + by_m + half_m * part))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }
}

fn tool_centre_m(rig: &Rig) -> DVec3 {
    rig.state.mechanical.tools[0].centre_m
}
