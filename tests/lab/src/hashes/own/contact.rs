//! Tools of either shape on either coupling, pressed, dragged, turned and put elsewhere.
use super::{BLOCK, HEAD, RIGID, SPRING, capsule, sphere, tissue};
use crate::hashes::{
    case::{Case, Moment},
    hand::Stroke,
};
use glam::DVec3;
use palpate_physics::contact::ToolTarget;

pub(super) fn cases() -> Vec<Case> {
    let block = |name: &str, tools: &[String], numerics: &str| {
        let tools = tools.concat();
        Case::of_text(
            name,
            220,
            [HEAD, BLOCK, &tissue(), &tools, "[numerics]\nmass_damping_per_s = 20\n", numerics].concat(),
        )
    };
    let double = "precision = \"double\"\n";
    let own_turning = "turn_stiffness_nm_per_rad = 0.02\nturn_damping_nm_s_per_rad = 1e-4\ninertia_kg_m2 = 1e-6\n";
    vec![
        block("contact/sphere-rigid", &[sphere("a", RIGID)], "").acting(strokes),
        block("contact/sphere-spring", &[sphere("a", SPRING)], "").acting(strokes),
        block("contact/sphere-spring-double", &[sphere("a", SPRING)], double).acting(strokes),
        block("contact/capsule-rigid", &[capsule("a", RIGID)], "").acting(strokes),
        block("contact/capsule-spring", &[capsule("a", SPRING)], "").acting(strokes),
        block("contact/capsule-spring-double", &[capsule("a", SPRING)], double).acting(strokes),
        block("contact/capsule-turning", &[capsule("a", SPRING) + own_turning], "").acting(strokes),
        block(
            "contact/four-tools",
            &[sphere("a", SPRING), capsule("b", SPRING), sphere("c", RIGID), capsule("d", RIGID)],
            "",
        )
        .acting(strokes),
        block("contact/skips-off", &[sphere("a", SPRING), capsule("b", RIGID)], "")
            .changed(|scene| scene.model.settings.skips.distant_contact = false)
            .acting(strokes),
        block("contact/without-friction", &[sphere("a", SPRING)], "")
            .changed(|scene| scene.model.tools[0].friction_coefficient = 0.0)
            .acting(strokes),
        block("contact/implicit", &[sphere("a", SPRING), sphere("b", RIGID)], "integrator = \"backward-euler\"\n")
            .acting(strokes),
        block("contact/put-inside", &[sphere("a", SPRING), capsule("b", SPRING)], "").acting(put_inside),
        block("contact/deep", &[sphere("a", RIGID), capsule("b", SPRING)], "").acting(deep),
        block(
            "contact/point",
            &[sphere("a", RIGID).replace("radius_mm = 6", "shape = \"point\"").replace("20, 32", "20, 28")],
            "",
        )
        .acting(strokes),
    ]
}

/// Each tool a stroke of its own, one beginning after the other.
pub(super) fn strokes(moment: &mut Moment<'_>) {
    for (tool, (spec, target)) in moment.model.tools().iter().zip(&mut moment.drive.tools).enumerate() {
        let number = tool as f64;
        let stroke = Stroke {
            each_s: 0.05,
            press_m: DVec3::new(3e-3 * number, -2e-3 * number, -11e-3),
            drag_m: DVec3::new(4e-3, 2e-3 - 3e-3 * number, 0.0),
            axis: [DVec3::Z, DVec3::Y, DVec3::X][tool % 3],
            half_sine: 0.25,
        };
        *target = stroke.at(spec.start(), (moment.time_s - 0.015 * number).max(0.0));
    }
}

/// Tools are put into the block, go deeper, and out.
fn put_inside(moment: &mut Moment<'_>) {
    for (tool, spec) in moment.model.tools().iter().enumerate() {
        let inside = ToolTarget { position_m: spec.start_position_m - DVec3::Z * 8e-3, ..spec.start() };
        if moment.tick == 20 + 60 * tool as u64 {
            moment.state.place_tool(tool, inside);
        }
        if moment.tick >= 20 + 60 * tool as u64 {
            let since_s = moment.time_s - 0.02 - 0.06 * tool as f64;
            let stroke = Stroke {
                each_s: 0.04,
                press_m: DVec3::Z * -3e-3,
                drag_m: DVec3::new(2e-3, 0.0, 2e-3),
                axis: DVec3::X,
                half_sine: 0.2,
            };
            let mut pose = stroke.at(inside, since_s);
            // Out of it in the end.
            pose.position_m.z += (since_s - 0.1).max(0.0) * 0.3;
            moment.drive.tools[tool] = pose;
        }
    }
}

/// As deep as a radius and more.
fn deep(moment: &mut Moment<'_>) {
    for (spec, target) in moment.model.tools().iter().zip(&mut moment.drive.tools) {
        let stroke = Stroke {
            each_s: 0.06,
            press_m: DVec3::Z * -19e-3,
            drag_m: DVec3::new(-6e-3, 0.0, 0.0),
            axis: DVec3::Y,
            half_sine: 0.5,
        };
        *target = stroke.at(spec.start(), moment.time_s);
    }
}
