//! Bodies that fall asleep, and what wakes them.
use super::{BLOCK, HEAD, RIGID, SPRING, material, sphere, tissue};
use crate::hashes::case::{Case, Moment};
use glam::DVec3;
use palpate_physics::PointForce;

const ACTIONS: &str = "\
[[region]]
name = \"side\"
select = { region = \"x_min\", half_space = { point_mm = [0, 0, 5], normal = [0, 0, 1] } }
[[prescribed]]
region = \"side\"
displacement_mm = [0, 0.5, 0]
amplitude.table = { times_s = [0, 1.0, 1.02], values = [0, 0, 1] }
[[load]]
region = \"z_max\"
pressure_pa = 100
follower = true
amplitude.table = { times_s = [0, 0.02, 2.0, 2.02], values = [0, 1, 1, 0.5] }
";

/// Ticks at which something comes that wakes: a force, the moved side, the load, a tool.
const FORCED: u64 = 500;
const TOUCHED: u64 = 1500;

pub(super) fn cases() -> Vec<Case> {
    let block = |name: &str, material: String, coupling: &str, numerics: &str| {
        let settings = "[numerics]\nmass_damping_per_s = 120\nsleep_tolerance_um = 5\n";
        let parts = [HEAD, BLOCK, &material, ACTIONS, &sphere("sphere", coupling), settings, numerics];
        Case::of_text(name, 2500, parts.concat()).acting(act)
    };
    vec![
        block("sleep/single", tissue(), SPRING, ""),
        block("sleep/double", material("fixed-corotated", 0.3, 0.0), RIGID, "precision = \"double\"\n"),
        block("sleep/implicit", tissue(), RIGID, "integrator = \"backward-euler\"\n"),
    ]
}

fn act(moment: &mut Moment<'_>) {
    if (FORCED..FORCED + 5).contains(&moment.tick) {
        moment.drive.point_forces.push(PointForce { node: 62, force_n: DVec3::new(0.0, 0.0, -0.05) });
    }
    // It comes down for a quarter of a second, and goes.
    let since_s = moment.tick.saturating_sub(TOUCHED) as f64 * 1e-3;
    let down = (since_s * 8.0).min(1.0) * (1.0 - ((since_s - 0.25) * 8.0).clamp(0.0, 1.0));
    moment.drive.tools[0].position_m.z -= 10e-3 * down;
}
