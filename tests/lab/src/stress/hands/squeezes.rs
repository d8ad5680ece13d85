//! Two tools that squeeze a wall between them, and let it go.
//!
//! Found by it, or what it was written after: a wall of 10 mm that two tools squeezed to 2.4 mm ended in quarantine.
use super::{
    hand::random_coupling,
    watch::{LOOK_EVERY, LedgerSeen, MOST_IMBALANCE},
};
use crate::random::Random;
use crate::stress::{
    Measured, Options, Outcome,
    rig::{Drive, Rig},
};
use glam::DVec3;
use miette::Result;
use palpate_physics::{
    ModelSpec,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
};
use palpate_scene::Limits;
use std::fmt;

pub(in crate::stress) const CRITERION: &str = "two tools squeeze a wall of 10 mm to a quarter of it at 0.02 to 2 m/s, or as far as they \
     go, and let go: finite, no quarantine, neither tool past the other, no tool caught";

/// A wall of 40 × 40 × 10 mm that is held at one edge, in the middle plane z = 0.
const WALL: &str = "[scene]\nname = \"wall\"\n[body]\noffset_mm = [-20, -20, -5]\n[body.box]\nsize_mm = [40, 40, 10]\ncells = [CELLS]\n\
     PARTICLES[[material]]\nlaw = \"stable-neo-hookean\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.45\n\
     density_kg_per_m3 = 1000\n[[fixed]]\nregion = \"x_min\"\n[numerics]\nmass_damping_per_s = 10\n[output]\nduration_s = 1\n";
/// The wall's half thickness (m).
const HALF_M: f64 = 5e-3;
/// Distance (m) of the devices' surfaces when they are nearest to each other.
const LEAST_GAP_M: f64 = 2.4e-3;
/// Ticks there, and after the devices are back.
const THERE_TICKS: u32 = 100;
const BACK_TICKS: u32 = 400;
/// Distance (m) from its device within which a tool that is clear of the body has come to it.
const FOLLOWS_M: f64 = 1e-3;

/// Two hands.
struct Squeeze {
    tools: [ToolSpec; 2],
    /// Way (m) of each device from its start to where it is nearest to the other.
    way_m: f64,
    speed_m_per_s: f64,
}

impl Squeeze {
    fn random(least_radius_m: f64, random: &mut Random) -> Self {
        let radius_m = random.log_within(least_radius_m, 10e-3);
        let middle_m = DVec3::new(random.within(-0.012, 0.012), random.within(-0.012, 0.012), 0.0);
        let gap_m = random.within(1e-3, 5e-3);
        let tool = |side: f64, random: &mut Random| {
            let coupling = random_coupling(0.6, random);
            let aside_m = random.vector() * DVec3::new(1e-3, 1e-3, 0.0);
            ToolSpec {
                name: if side > 0.0 { "above".into() } else { "below".into() },
                shape: ToolShape::Sphere,
                radius_m,
                coupling,
                friction_coefficient: random.within(0.0, 0.5),
                start_position_m: middle_m + aside_m + DVec3::Z * side * (HALF_M + radius_m + gap_m),
            }
        };
        let tools = [tool(1.0, random), tool(-1.0, random)];
        Self { tools, way_m: gap_m + HALF_M - 0.5 * LEAST_GAP_M, speed_m_per_s: random.log_within(0.02, 2.0) }
    }

    /// Returns the number of ticks in which a device goes its way.
    fn way_ticks(&self, period_s: f64) -> u32 {
        (self.way_m / (self.speed_m_per_s * period_s)).ceil() as u32
    }

    /// Returns the part of its way that a device has gone in a tick.
    fn part(&self, tick: u32, period_s: f64) -> f64 {
        let way = self.way_ticks(period_s);
        if tick < way {
            f64::from(tick) / f64::from(way)
        } else {
            (1.0 - f64::from(tick.saturating_sub(way + THERE_TICKS)) / f64::from(way)).clamp(0.0, 1.0)
        }
    }
}

impl fmt::Display for Squeeze {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = |tool: &ToolSpec| if tool.coupling == Coupling::Rigid { "rigid" } else { "coupled" };
        let [above, below] = self.tools.each_ref().map(kind);
        write!(f, "{above} on {below}, {:.1} mm, {:.2} m/s", 1e3 * self.tools[0].radius_m, self.speed_m_per_s)
    }
}

#[derive(Debug, Clone, Copy, Default)]
struct Found {
    quarantined: Option<u64>,
    /// Whether the upper tool was below the lower one.
    has_passed: bool,
    is_caught: bool,
    imbalance: f64,
    force_n: f64,
}

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let squeezes = options.pick(2, 15, 1000);
    let mut outcome = Outcome::passing();
    let particles = "[body.particles]\nspacing_mm = 2.5\nmost_active = 800\n";
    for (name, cells, particles, least_radius_m) in
        [("wall with particles", "8, 8, 2", particles, 3e-3), ("wall of tets", "12, 12, 3", "", 4e-3)]
    {
        let text = WALL.replace("CELLS", cells).replace("PARTICLES", particles);
        let spec = palpate_scene::parse(&text, "wall", None, &Limits::local(), &mut |_, _| {})?.model;
        let (mut imbalance, mut force_n) = (0.0_f64, 0.0_f64);
        for number in 0..squeezes {
            let seed = options.seed.wrapping_add(number);
            let squeeze = Squeeze::random(least_radius_m, &mut Random::new(seed));
            let found = watch(&spec, &squeeze)?;
            let at = || format!("{name}, seed {seed} ({squeeze})");
            if let Some(tick) = found.quarantined {
                outcome.broken.push(format!("{}: quarantined at tick {tick}", at()));
            }
            outcome.demand(!found.has_passed, || format!("{}: one tool has passed the other", at()));
            outcome.demand(!found.is_caught, || format!("{}: a tool is caught", at()));
            outcome.demand(found.imbalance <= MOST_IMBALANCE, || {
                format!("{}: {:.3} of what moved came from nowhere or went there", at(), found.imbalance)
            });
            (imbalance, force_n) = (imbalance.max(found.imbalance), force_n.max(found.force_n));
        }
        outcome.push(Measured::value(format!("{name}: largest force"), force_n, "N"));
        let ledger = format!("{name}: error of the ledger over what moved");
        outcome.push(Measured::bounded(ledger, imbalance, "1", MOST_IMBALANCE));
    }
    Ok(outcome)
}

/// Squeezes the wall, and watches.
fn watch(spec: &ModelSpec, squeeze: &Squeeze) -> Result<Found> {
    let mut rig = Rig::new(ModelSpec { tools: squeeze.tools.to_vec(), ..spec.clone() })?;
    let mut drive = Drive::still(&rig.model);
    let period_s = rig.model.settings().tick_period_s;
    let (mut found, mut ledger) = (Found::default(), LedgerSeen::NOTHING);
    for tick in 0..2 * squeeze.way_ticks(period_s) + THERE_TICKS + BACK_TICKS {
        for (target, (tool, side)) in drive.tools.iter_mut().zip(squeeze.tools.iter().zip([1.0, -1.0])) {
            let way_m = squeeze.part(tick, period_s) * squeeze.way_m;
            *target = ToolTarget::at(tool.start_position_m - DVec3::Z * side * way_m);
        }
        let report = rig.tick(&drive);
        if let Some(quarantine) = report.quarantined {
            found.quarantined = Some(quarantine.tick);
            return Ok(found);
        }
        let [above, below] = [0, 1].map(|tool| &rig.state.mechanical.tools[tool]);
        found.has_passed |= above.centre_m.z < below.centre_m.z;
        found.force_n = found.force_n.max(above.contact_force_n.length()).max(below.contact_force_n.length());
        if !tick.is_multiple_of(LOOK_EVERY) {
            continue;
        }
        ledger.look(&rig.energies());
    }
    found.is_caught = squeeze.tools.iter().zip(&rig.state.mechanical.tools).enumerate().any(|(index, (spec, tool))| {
        tool.centre_m.distance(spec.start_position_m) > FOLLOWS_M || rig.state.mechanical.contact.touches(index)
    });
    found.imbalance = ledger.imbalance();
    Ok(found)
}
