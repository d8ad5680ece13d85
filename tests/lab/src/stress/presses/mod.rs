//! Random presses of the bodies that ship, woken as their scenes wake: press k of a body has the seed `--seed` + k.
//!
//! Found by it: at 1.3 tool radii the force of a slow press fell from 2.3 N to nothing and the tool was buried; of thirty
//! quick ones twelve ended in quarantine. A body that passes only what it was tuned on is of no use to a hand.
mod hand;
mod watch;

use super::{Measured, Options, Outcome, random::Random};
use hand::{Hand, Press};
use miette::{IntoDiagnostic, Result, WrapErr, bail, miette};
use palpate_physics::{Model, ModelSpec, contact::Coupling};
use palpate_scene::Limits;
use watch::{Found, watch};

pub(super) const CRITERION: &str = "random presses of shipped bodies at 0.05 to 5 m/s, to 20 N or 30 mm: finite, no quarantine, no tool inside, \
     force where there is depth; slow ones on blocks: force never down by 5 % in a tick or 20 % in 20 ms while the arm goes deeper";

/// A body that is pressed.
struct Body {
    name: &'static str,
    /// Its scene, without the parts of it that are named.
    scene: &'static str,
    without: &'static [&'static str],
    /// Largest speed (m/s) of a slow press, a tenth of the shear wave's; 0 where the criterion has none: walls may buckle.
    slow_m_per_s: f64,
    /// Edge (m) of the upper face, and the size (m) that walls leave for tools.
    edge_m: f64,
    /// Depth (m) to which a rigid tool may press: half of what is behind.
    rigid_depth_m: f64,
    /// Whether a point may be inside it.
    is_closed: bool,
}

const BODIES: [Body; 4] = [
    Body {
        name: "block with particles",
        scene: "hybrid-block",
        without: &[],
        slow_m_per_s: 0.18,
        edge_m: 0.08,
        rigid_depth_m: 0.02,
        is_closed: true,
    },
    Body {
        name: "block of tets",
        scene: "hybrid-block",
        without: &["[body.particles]", "spacing_mm"],
        slow_m_per_s: 0.18,
        edge_m: 0.08,
        rigid_depth_m: 0.02,
        is_closed: true,
    },
    Body {
        name: "ventricle with particles",
        scene: "hybrid-ventricle",
        without: &[],
        slow_m_per_s: 0.0,
        edge_m: 0.04,
        rigid_depth_m: 0.008,
        is_closed: true,
    },
    Body {
        name: "dome of springs",
        scene: "springs-dome",
        without: &[],
        slow_m_per_s: 0.0,
        edge_m: 0.04,
        rigid_depth_m: 0.01,
        is_closed: false,
    },
];

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let presses = options.pick(2, 12, 1000);
    let mut outcome = Outcome::passing();
    for body in &BODIES {
        let spec = spec(body).wrap_err(body.name)?;
        let bare = Model::build(ModelSpec { tools: Vec::new(), ..spec.clone() }).into_diagnostic()?;
        let (mut worst, mut rigid, mut rigid_inside) = (Found::default(), 0_u32, 0_u32);
        for number in 0..presses {
            let seed = options.seed.wrapping_add(number);
            let mut random = Random::new(seed);
            let press = Press::random(&bare, body, &mut random)?;
            let found = watch(&spec, body, &press)?;
            let at = || format!("{}, seed {seed} ({press})", body.name);
            if let Some(tick) = found.quarantined {
                outcome.broken.push(format!("{}: quarantined at tick {tick}", at()));
            }
            let is_rigid = press.tool.coupling == Coupling::Rigid;
            rigid += u32::from(is_rigid);
            rigid_inside += u32::from(is_rigid && found.is_inside);
            outcome.demand(is_rigid || !found.is_inside, || format!("{}: the tool is inside the body", at()));
            outcome.demand(is_rigid || !found.lets_go, || {
                format!("{}: no force at {:.1} mm of depth", at(), 1e3 * found.depth_m)
            });
            outcome.demand(found.fall_in_a_tick <= watch::MOST_IN_A_TICK, || {
                format!("{}: the force fell by {:.0} % in a tick", at(), 100.0 * found.fall_in_a_tick)
            });
            outcome.demand(found.fall_in_20_ms <= watch::MOST_IN_20_MS, || {
                format!("{}: the force fell by {:.0} % in 20 ms", at(), 100.0 * found.fall_in_20_ms)
            });
            outcome.demand(found.imbalance <= watch::MOST_IMBALANCE, || {
                format!("{}: {:.3} of what moved came from nowhere or went there", at(), found.imbalance)
            });
            worst = worst.worse(&found);
        }
        let name = |what: &str| format!("{}: {what}", body.name);
        let part = f64::from(rigid_inside) / f64::from(rigid.max(1));
        let inside = Measured::bounded(name("rigid tools inside"), part, "1", 0.0);
        outcome.push(inside.known_to_exceed("a rigid tool goes where its device is, also into the body", 0.75));
        outcome.push(Measured::value(name("largest force"), worst.force_n, "N"));
        outcome.push(Measured::value(name("ticks taken back"), f64::from(worst.repeated), "ticks"));
        outcome.push(Measured::value(name("most substeps over the model's"), worst.substeps, "1"));
        outcome.push(Measured::bounded(
            name("error of the ledger over what moved"),
            worst.imbalance,
            "1",
            watch::MOST_IMBALANCE,
        ));
    }
    Ok(outcome)
}

/// What a scene's model is built from, its tool apart.
fn spec(body: &Body) -> Result<ModelSpec> {
    let text =
        palpate_scene::builtin(body.scene).ok_or_else(|| miette!("there is no built-in scene {}", body.scene))?;
    let is_kept = |line: &&str| !body.without.iter().any(|part| line.starts_with(part));
    let text = text.lines().filter(is_kept).collect::<Vec<_>>().join("\n");
    let scene = palpate_scene::parse(&text, body.scene, None, &Limits::local(), &mut |_, _| {})?;
    if scene.model.tools.is_empty() {
        bail!("the scene {} has no tool", body.scene);
    }
    Ok(scene.model)
}
