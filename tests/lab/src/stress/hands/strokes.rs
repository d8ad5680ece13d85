//! A tool that strokes a body again and again, so that particles wake before it and fall asleep behind it thousands of times.
//!
//! What switching gets wrong, however little at a time, adds up here: the force on the tool in the last stroke is held against that
//! in an early one, tick by tick.
use super::{
    BODIES, spec,
    watch::{LedgerSeen, MOST_IMBALANCE},
};
use crate::random::Random;
use crate::stress::{
    Measured, Options, Outcome,
    rig::{Drive, Rig},
};
use assert_no_alloc::assert_no_alloc;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    ModelSpec,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    snapshot,
};

pub(in crate::stress) const CRITERION: &str = "a tool strokes a block with particles for 10^6 ticks (short: 8000), which wake and fall asleep beneath it: \
     finite, no quarantine, no allocation, force in the last stroke as in the second, ledger closed, all asleep at the end, the same bits again";

/// Ticks of a stroke: down, along, up, back and a pause. The loop looks for what is to be awake in a fixed rhythm, of which this is a
/// multiple.
const STROKE_TICKS: usize = 800;
/// Parts of a stroke after which the tool is down, at its end, up again and back.
const PARTS: [f64; 4] = [0.2, 0.5, 0.65, 0.85];
/// Height (m) of the tool above the block between strokes, and the depth (m) in it.
const ABOVE_M: f64 = 12e-3;
const DEPTH_M: f64 = 3e-3;
const RADIUS_M: f64 = 6e-3;
/// Length (m) of a stroke.
const ALONG_M: f64 = 20e-3;
/// Largest difference of the force between two strokes, over the largest force.
const MOST_DIFFERENCE: f64 = 0.01;

/// What is stroked, and how.
struct Stroke {
    spec: ModelSpec,
    from_m: DVec3,
    to_m: DVec3,
}

impl Stroke {
    fn random(random: &mut Random) -> Result<Self> {
        let mut spec = spec(&BODIES[0])?;
        let direction = random.vector() * DVec3::new(1.0, 1.0, 0.0);
        let half = direction.normalize_or(DVec3::X) * 0.5 * ALONG_M;
        let middle_m = DVec3::new(random.within(-0.01, 0.01), random.within(-0.01, 0.01), RADIUS_M + ABOVE_M);
        spec.tools = vec![ToolSpec {
            name: "hand".into(),
            shape: ToolShape::Sphere,
            radius_m: RADIUS_M,
            coupling: Coupling::Rigid,
            friction_coefficient: 0.3,
            start_position_m: middle_m - half,
        }];
        Ok(Self { spec, from_m: middle_m - half, to_m: middle_m + half })
    }

    /// Returns where the device is in a tick.
    fn at(&self, tick: usize) -> ToolTarget {
        let part = (tick % STROKE_TICKS) as f64 / STROKE_TICKS as f64;
        let [down, along, up, back] = PARTS;
        let smooth = |from: f64, to: f64| {
            let t = ((part - from) / (to - from)).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        };
        let sideways = smooth(down, along) - smooth(up, back);
        let sunk_m = (ABOVE_M + DEPTH_M) * (smooth(0.0, down) - smooth(along, up));
        ToolTarget::at(self.from_m.lerp(self.to_m, sideways) - DVec3::Z * sunk_m)
    }
}

/// What a run of strokes came to.
struct Found {
    quarantined: Option<u64>,
    difference: f64,
    force_n: f64,
    imbalance: f64,
    most_awake: usize,
    awake_at_end: usize,
    hash: u64,
}

pub(in crate::stress) fn run(options: &Options) -> Result<Outcome> {
    let strokes = options.pick(3, 10, 1_250);
    let stroke = Stroke::random(&mut Random::new(options.seed))?;
    let mut outcome = Outcome::passing();
    let bar = ProgressBar::new(2 * strokes as u64);
    let style = ProgressStyle::with_template("strokes {bar:40} {pos} of {len}, {eta} left").into_diagnostic()?;
    bar.set_style(style);
    let [found, again] = [stroke.watch(strokes, &bar)?, stroke.watch(strokes, &bar)?];
    bar.finish_and_clear();
    if let Some(tick) = found.quarantined {
        outcome.broken.push(format!("quarantined at tick {tick}"));
    }
    outcome.demand(found.most_awake > 0 && found.awake_at_end == 0, || {
        format!("{} particles awake at most, {} at the end", found.most_awake, found.awake_at_end)
    });
    outcome.demand(found.hash == again.hash, || {
        format!("the repeat ended in other bits: {:016x} and {:016x}", found.hash, again.hash)
    });
    outcome.push(Measured::value("ticks", (strokes * STROKE_TICKS) as f64, "ticks"));
    outcome.push(Measured::value("largest force", found.force_n, "N"));
    outcome.push(Measured::value("most particles awake", found.most_awake as f64, "particles"));
    let difference = "force in the last stroke off that in the second, over the largest";
    outcome.push(Measured::bounded(difference, found.difference, "1", MOST_DIFFERENCE));
    outcome.push(Measured::bounded("error of the ledger over what moved", found.imbalance, "1", MOST_IMBALANCE));
    Ok(outcome)
}

impl Stroke {
    fn watch(&self, strokes: usize, bar: &ProgressBar) -> Result<Found> {
        let mut rig = Rig::new(self.spec.clone())?;
        let mut drive = Drive::still(&rig.model);
        let (mut second_n, mut now_n) = (vec![DVec3::ZERO; STROKE_TICKS], vec![DVec3::ZERO; STROKE_TICKS]);
        let (mut ledger, mut quarantined, mut most_awake) = (LedgerSeen::NOTHING, None, 0);
        for number in 0..strokes {
            assert_no_alloc(|| {
                for (tick, force_n) in now_n.iter_mut().enumerate() {
                    drive.tools[0] = self.at(tick);
                    let report = rig.tick(&drive);
                    quarantined = quarantined.or(report.quarantined.map(|quarantine| quarantine.tick));
                    *force_n = rig.state.mechanical.tools[0].contact_force_n;
                    most_awake = most_awake.max(rig.state.body.active_particles().len());
                }
            });
            if number == 1 {
                second_n.copy_from_slice(&now_n);
            }
            ledger.look(&rig.energies());
            bar.inc(1);
        }
        let force_n = second_n.iter().map(|force| force.length()).fold(0.0, f64::max);
        let apart_n = now_n.iter().zip(&second_n).map(|(now, then)| now.distance(*then)).fold(0.0, f64::max);
        Ok(Found {
            quarantined,
            difference: apart_n / force_n,
            force_n,
            imbalance: ledger.imbalance(),
            most_awake,
            awake_at_end: rig.state.body.active_particles().len(),
            hash: snapshot::state_hash(&rig.state),
        })
    }
}
