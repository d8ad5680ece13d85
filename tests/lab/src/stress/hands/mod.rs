//! Hands on the bodies that ship, woken as their scenes wake, and on hearts that do not: what they do is random, and number k
//! of a body has the seed `--seed` + k.
//!
//! A body that passes only what it was tuned on is of no use to a hand.
mod hand;
pub(super) mod hearts;
pub(super) mod laws;
pub(super) mod leaps;
pub(super) mod pans;
pub(super) mod presses;
pub(super) mod squeezes;
pub(super) mod strokes;
mod watch;

use miette::{Result, bail, miette};
use palpate_physics::ModelSpec;
use palpate_scene::Limits;

/// What a hand has to know of a body, and what is demanded of it.
struct Body {
    name: &'static str,
    /// Largest speed (m/s) of a slow press, a tenth of the shear wave's; 0 where the criterion has none: walls may buckle.
    slow_m_per_s: f64,
    /// Edge (m) of the upper face, and the size (m) that walls leave for tools.
    edge_m: f64,
    /// Depth (m) to which a rigid tool may press: half of what is behind.
    rigid_depth_m: f64,
    /// Whether a point may be inside it.
    is_closed: bool,
}

/// A body of a scene that ships.
struct Shipped {
    body: Body,
    /// Its scene, without the parts of it that are named.
    scene: &'static str,
    without: &'static [&'static str],
}

const BODIES: [Shipped; 4] = [
    Shipped {
        body: Body {
            name: "block with particles",
            slow_m_per_s: 0.18,
            edge_m: 0.08,
            rigid_depth_m: 0.02,
            is_closed: true,
        },
        scene: "hybrid-block",
        without: &[],
    },
    Shipped {
        body: Body { name: "block of tets", slow_m_per_s: 0.18, edge_m: 0.08, rigid_depth_m: 0.02, is_closed: true },
        scene: "hybrid-block",
        without: &["[body.particles]", "spacing_mm"],
    },
    Shipped {
        body: Body {
            name: "ventricle with particles",
            slow_m_per_s: 0.0,
            edge_m: 0.04,
            rigid_depth_m: 0.008,
            is_closed: true,
        },
        scene: "hybrid-ventricle",
        without: &[],
    },
    Shipped {
        body: Body { name: "dome of springs", slow_m_per_s: 0.0, edge_m: 0.04, rigid_depth_m: 0.01, is_closed: false },
        scene: "springs-dome",
        without: &[],
    },
];

/// What a scene's model is built from, its tool apart.
fn spec(body: &Shipped) -> Result<ModelSpec> {
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
