//! Inputs that are not finite or of the wrong length, and ticks whose results are refused.
use super::{BLOCK, GRAVITY, HEAD, RIGID, SPRING, capsule, grid::ACTIONS, sphere, tissue};
use crate::hashes::{
    case::{Case, Moment},
    own::contact::strokes,
};
use glam::DVec3;
use palpate_physics::PointForce;

pub(super) fn cases() -> Vec<Case> {
    let of = |name: &str, tissue: &str, numerics: &str| {
        let tools = sphere("sphere", RIGID) + &capsule("capsule", SPRING);
        let parts = [HEAD, GRAVITY, BLOCK, tissue, ACTIONS, &tools, "[numerics]\nmass_damping_per_s = 10\n", numerics];
        Case::of_text(name, 200, parts.concat())
    };
    let block = |name: &str, numerics: &str| of(name, &tissue(), numerics);
    let stiff = |name: &str, numerics: &str| of(name, &tissue().replace("10e3", "200e3"), numerics);
    vec![
        block("refused/inputs", "").acting(bad_inputs),
        block("refused/tick", "").acting(too_much),
        block("refused/tick-double", "precision = \"double\"\n").acting(too_much),
        block("refused/tick-implicit", "integrator = \"backward-euler\"\n")
            .changed(|scene| {
                scene.model.tools.truncate(1);
                scene.drivers.truncate(1);
            })
            .acting(too_much),
        stiff("refused/unstable", "subcycle_unstable = false\nsubsteps = 1\n").acting(strokes),
    ]
}

fn bad_inputs(moment: &mut Moment<'_>) {
    strokes(moment);
    let (tick, drive) = (moment.tick, &mut *moment.drive);
    match tick {
        30 | 31 => drive.tools[0].position_m.x = f64::NAN,
        40 => drive.tools[1].velocity_m_per_s.z = f64::INFINITY,
        50 => drive.tools[1].orientation.w = 3.0,
        60 => drive.tools.truncate(1),
        70 => drive.load_factors[1] = f64::NAN,
        80 => drive.load_factors.truncate(2),
        90 => drive.prescribed_m[0].y = f64::NEG_INFINITY,
        100 => drive.prescribed_m.clear(),
        110 => drive.point_forces.push(PointForce { node: 62, force_n: DVec3::NAN }),
        120 => drive.point_forces.push(PointForce { node: 1_000_000, force_n: DVec3::X }),
        _ => {}
    }
}

/// A force so large that no tick takes it, then ticks that do nothing, then a new start.
fn too_much(moment: &mut Moment<'_>) {
    strokes(moment);
    match moment.tick {
        80 => moment.drive.point_forces.push(PointForce { node: 62, force_n: DVec3::splat(1e306) }),
        100 => moment.state.reset(moment.model),
        _ => {}
    }
}
