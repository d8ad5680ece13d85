//! Every time integrator with every material law in both precisions, under all kinds of loads, prescribed motion, gravity, damping and a tool.
use super::{BLOCK, GRAVITY, HEAD, RIGID, material, pressing};
use crate::hashes::case::{Case, Moment};
use glam::DVec3;
use palpate_physics::PointForce;

/// A side that is moved, and every kind of load with every kind of amplitude; but gravity.
pub(super) const ACTIONS: &str = "\
[[region]]
name = \"side\"
select = { region = \"x_min\", half_space = { point_mm = [0, 0, 5], normal = [0, 0, 1] } }
[[region]]
name = \"corner\"
select.nearest = { point_mm = [40, 40, 20], count = 2 }
[[prescribed]]
region = \"side\"
axes = \"xy\"
displacement_mm = [0, 1, 0]
amplitude.smooth_step = { start_s = 0.01, duration_s = 0.06 }
[[load]]
region = \"z_max\"
pressure_pa = 150
follower = true
amplitude.ramp = { duration_s = 0.05 }
[[load]]
region = \"x_max\"
pressure_pa = -80
follower = false
amplitude.smooth_step = { start_s = 0.02, duration_s = 0.05 }
[[load]]
region = \"y_max\"
traction_pa = [40, 0, 20]
amplitude.table = { times_s = [0, 0.03, 0.06], values = [0, 1, 0.5] }
[[load]]
region = \"y_min\"
total_force_n = [0, 0.02, 0]
amplitude.pulse = { value = 1, start_s = 0.02, duration_s = 0.02, period_s = 0.05 }
[[load]]
region = \"corner\"
force_per_node_n = [0, 0, -0.004]
amplitude.constant = 1
";

pub(super) fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for integrator in ["leapfrog", "seed-verlet", "seed-semi-implicit", "backward-euler"] {
        for law in ["stvk", "stable-neo-hookean", "fixed-corotated"] {
            for precision in ["single", "double"] {
                let numerics = format!(
                    "[numerics]\nintegrator = \"{integrator}\"\nprecision = \"{precision}\"\nmass_damping_per_s = 10\n"
                );
                let parts = [HEAD, GRAVITY, BLOCK, &material(law, 0.4, 0.1), ACTIONS, &pressing(RIGID), &numerics];
                let name = format!("grid/{integrator}-{law}-{precision}");
                cases.push(Case::of_text(name, 130, parts.concat()).acting(pushes));
            }
        }
    }
    cases
}

/// Forces injected on nodes for some ticks.
pub(super) fn pushes(moment: &mut Moment<'_>) {
    if (30..40).contains(&moment.tick) {
        let part = (moment.tick - 30) as f64 * 0.1;
        let pushed = [(62, DVec3::new(0.01, 0.0, -0.02 * part)), (74, DVec3::new(0.0, -0.01 * part, 0.0))];
        moment.drive.point_forces.extend(pushed.map(|(node, force_n)| PointForce { node, force_n }));
    }
}
