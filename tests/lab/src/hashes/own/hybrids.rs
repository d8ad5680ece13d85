//! Hybrid bodies whose particles wake and fall asleep again.
use super::{BLOCK, GRAVITY, HEAD, RIGID, SPRING, capsule, farthest_node, grid::ACTIONS, material, sphere, tissue};
use crate::hashes::{
    case::{Case, Moment},
    own::contact::strokes,
};
use glam::DVec3;
use palpate_physics::{BodySpec, PointForce, bodies::hybrid::Waking, world::wake_only};

/// Few coarse tets, and particles 2.5 mm apart.
fn block(name: &str, ticks: u64, particles: &str, parts: &[&str]) -> Case {
    let body = BLOCK.replace("[4, 4, 2]", "[2, 2, 1]");
    let particles = format!("[body.particles]\nspacing_mm = 2.5\nmost_active = 120\n{particles}");
    let damping = "[numerics]\nmass_damping_per_s = 30\n";
    let text = [HEAD, GRAVITY, &body, &particles, damping].concat() + &parts.concat();
    Case::of_text(name, ticks, text)
}

pub(super) fn cases() -> Vec<Case> {
    let (rigid, spring, capsule) = (sphere("a", RIGID), sphere("a", SPRING), capsule("b", SPRING));
    let (tissue, double) = (tissue(), "precision = \"double\"\n");
    let mut cases = vec![
        block("hybrid/single", 500, "", &["", &tissue, &rigid]).acting(strokes),
        block("hybrid/double", 500, "", &[double, &tissue, &rigid]).acting(strokes),
        block("hybrid/spring", 500, "", &["", &tissue, &spring]).acting(strokes),
        block("hybrid/capsule", 500, "reach_mm = 5\n", &["", &tissue, &capsule]).acting(strokes),
        block("hybrid/two-tools", 500, "", &[double, &tissue, &spring, &capsule]).acting(strokes),
        block("hybrid/no-long-steps", 500, "", &["long_coarse_steps = false\n", &tissue, &rigid]).acting(strokes),
        block("hybrid/merged-cells", 500, "fine_depth_mm = 5\n", &["", &tissue, &rigid]).acting(strokes),
        block("hybrid/smooth-skin", 500, "smooth_skin = true\n", &["", &tissue, &rigid]).acting(strokes),
        block("hybrid/actions", 500, "", &["", &tissue, ACTIONS, &rigid]).acting(pushed),
        block("hybrid/by-hand", 200, "", &["", &tissue, &rigid]).changed(by_hand).acting(wakes),
        block("hybrid/too-long", 200, "", &["substeps = 1\n", &tissue, &rigid]).acting(strokes),
        block("hybrid/not-judged", 200, "", &["subcycle_unstable = false\n", &tissue, &rigid]).acting(strokes),
        block("hybrid/skips-off", 300, "", &["", &material("stable-neo-hookean", 0.45, 0.0), &spring])
            .changed(|scene| {
                scene.model.settings.skips.viscous_terms = false;
                scene.model.settings.skips.distant_contact = false;
            })
            .acting(strokes),
        block("hybrid/refused", 200, "", &["", &tissue, &rigid]).acting(too_much),
    ];
    for law in ["stvk", "fixed-corotated"] {
        for viscosity in [0.0, 0.3] {
            let name = format!("hybrid/{law}-{}", if viscosity > 0.0 { "viscous" } else { "elastic" });
            cases.push(block(&name, 300, "", &["", &material(law, 0.3, viscosity), &rigid]).acting(strokes));
        }
    }
    // Not held by its table, but at one side; and held nowhere.
    let free = block("hybrid/free", 300, "", &["", &tissue, &rigid]).changed(|scene| {
        scene.model.prescribed.clear();
        scene.timeline.prescribed.clear();
        scene.model.gravity_m_per_s2 = DVec3::ZERO;
    });
    cases.push(free.acting(strokes));
    let pressing = super::pressing(SPRING);
    cases.push(block("hybrid/rests", 20, "", &["", &tissue, ACTIONS, &pressing]).resting_at(0.06));
    cases
}

fn pushed(moment: &mut Moment<'_>) {
    strokes(moment);
    if (30..40).contains(&moment.tick) {
        let node = farthest_node(moment.model, DVec3::Z);
        moment.drive.point_forces.push(PointForce { node, force_n: DVec3::new(0.0, 0.01, -0.02) });
    }
}

fn by_hand(scene: &mut palpate_scene::Scene) {
    if let BodySpec::Hybrid(body) = &mut scene.model.body {
        body.particles.waking = Waking::ByHand;
    }
}

/// Others wake from time to time, under the tool or not; then none.
fn wakes(moment: &mut Moment<'_>) {
    strokes(moment);
    let Moment { model, state, scratch, .. } = moment;
    let all = model.body().particle_count() as u32;
    match moment.tick {
        20 => wake_only(model, state, scratch, all / 2..all / 2 + 60),
        60 => wake_only(model, state, scratch, all / 2 + 30..all / 2 + 100),
        90 => wake_only(model, state, scratch, (0..all).step_by(40)),
        150 => wake_only(model, state, scratch, []),
        _ => {}
    }
}

/// After the state was saved, as one that was refused is not read again: what its particles gave is not finite.
fn too_much(moment: &mut Moment<'_>) {
    strokes(moment);
    match moment.tick {
        105 => {
            let node = farthest_node(moment.model, DVec3::Z);
            moment.drive.point_forces.push(PointForce { node, force_n: DVec3::splat(1e306) });
        }
        130 => moment.state.reset(moment.model),
        _ => {}
    }
}
