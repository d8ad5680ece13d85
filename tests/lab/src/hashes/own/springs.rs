//! Mass-spring surfaces: every law of anchor springs, every way to refine, awake in part, calibrated.
use super::farthest_node;
use crate::hashes::{
    case::{Case, Moment, Source},
    hand::Stroke,
};
use glam::DVec3;
use palpate_physics::{
    BodySpec, PointForce,
    bodies::mass_spring::{MassSpringSpec, Refining},
    world::refine_only,
};

const TICKS: u64 = 500;
const LAYERS: &str =
    "anchor_layer = [{ thickness_m = 1e-3, stiffness_ratio = 1 }, { thickness_m = 1, stiffness_ratio = 4 }]\n";
const AREA: &str = "[body.springs.refine]\nrings = 2\nconstants = \"area\"\n";

/// A ball of some 300 triangles whose lower half is held, under a sphere that a case moves.
fn ball(springs: &str, refine: &str, more: &str) -> String {
    format!(
        "[scene]\nname = \"own\"\n[body.sphere_shell]\ninner_radius_mm = 16\nouter_radius_mm = 20\ntarget_tets = 600\n\
        [body.springs]\npart = \"outer\"\nmesh_n_per_m = 60\nanchor_n_per_m = 12\narea_density_kg_per_m2 = 15\n{springs}{refine}\
        [[region]]\nname = \"lower\"\nselect = {{ half_space = {{ point_mm = [0, 0, -5], normal = [0, 0, -1] }} }}\n\
        [[fixed]]\nregion = \"lower\"\n\
        [[tool]]\nname = \"sphere\"\nradius_mm = 5\nfriction_coefficient = 0.3\ndriver = \"device\"\nstart_mm = [0, 0, 32]\n{more}"
    )
}

/// The same without what is held and as flat as a pan, so that a tool reaches its far wall from behind.
fn pan(ball: &str) -> String {
    ball.replace(
        "[body.sphere_shell]\ninner_radius_mm = 16\nouter_radius_mm = 20",
        "[body.ellipsoid_shell]\ninner_semi_axes_mm = [18, 18, 3]\nouter_semi_axes_mm = [20, 20, 5]",
    )
    .replace("[[fixed]]\nregion = \"lower\"\n", "")
    .replace("start_mm = [0, 0, 32]", "start_mm = [0, 0, 14]")
    .replace("point_mm = [0, 0, -5]", "point_mm = [0, 0, 0]")
}

pub(super) fn cases() -> Vec<Case> {
    const DAMPED: &str = "damping_n_s_per_m = 0.02\n";
    const RIGID: &str = "coupling = \"rigid\"\n";
    let spring = format!("{}[numerics]\nmass_damping_per_s = 20\n", super::SPRING);
    let capsule = format!("{RIGID}shape = \"capsule\"\nhalf_length_mm = 6\naxis = [1, 0, 0.1]\n");
    let load = format!(
        "{RIGID}[[load]]\nregion = \"surface\"\npressure_pa = 20\nfollower = false\namplitude.ramp.duration_s = 0.1\n"
    );
    let case = |name: &str, text: String| Case::of_text(name, TICKS, text).acting(presses);
    let part = format!("{DAMPED}most_awake = 60\n");
    let table = "[body.springs.refine]\nrings = 2\ntable_file = \"table.json\"\n";
    vec![
        case("springs/coarse", ball(DAMPED, "", RIGID)),
        case("springs/area", ball(DAMPED, AREA, RIGID)),
        case(
            "springs/unchanged",
            ball(
                DAMPED,
                &AREA.replace("area", "unchanged"),
                &spring.replace("[numerics]\nmass_damping_per_s = 20\n", ""),
            ),
        ),
        case("springs/cubic", ball(&format!("{DAMPED}anchor_cubic_per_m2 = 1e5\n"), AREA, RIGID)),
        case("springs/layers", ball(&format!("{DAMPED}{LAYERS}"), AREA, RIGID)),
        case("springs/mass-damping", ball("", AREA, &spring)),
        case("springs/capsule", ball(DAMPED, &format!("{AREA}most_triangles = 120\n"), &capsule)),
        case(
            "springs/follows-dent",
            ball(DAMPED, &AREA.replace("rings = 2", "rings = 4\nfollows_dent = true\nblend_s = 0.05"), RIGID),
        ),
        case(
            "springs/loaded",
            ball(DAMPED, AREA, &load).replace("[body.sphere", "gravity_m_per_s2 = [0, 1, -9.81]\n[body.sphere"),
        ),
        case("springs/awake-in-part", ball(&part, AREA, RIGID)),
        case("springs/pan", pan(&ball("", AREA, &spring))).acting(presses_through),
        case("springs/skips-off", ball(DAMPED, AREA, RIGID))
            .changed(|scene| scene.model.settings.skips.distant_contact = false),
        case("springs/by-hand", ball(DAMPED, AREA, RIGID))
            .changed(|scene| {
                if let BodySpec::MassSpring(MassSpringSpec { refinement: Some(refinement), .. }) = &mut scene.model.body
                {
                    refinement.by = Refining::ByHand;
                }
            })
            .acting(refines),
        Case::of("springs/calibrated".into(), Source::Calibrated(ball(DAMPED, table, RIGID)), Some(TICKS))
            .acting(presses),
    ]
}

/// A press 5 mm deep, a drag, and away; a force injected on the other side.
fn presses(moment: &mut Moment<'_>) {
    let stroke = Stroke {
        each_s: 0.08,
        press_m: DVec3::Z * -12e-3,
        drag_m: DVec3::new(5e-3, 2e-3, 0.0),
        axis: DVec3::Z,
        half_sine: 0.3,
    };
    moment.drive.tools[0] = stroke.at(moment.model.tools()[0].start(), moment.time_s);
    if (120..130).contains(&moment.tick) {
        let node = farthest_node(moment.model, DVec3::X);
        moment.drive.point_forces.push(PointForce { node, force_n: DVec3::new(0.01, 0.0, 0.005) });
    }
}

/// A press 10 mm below the far wall of a pan, a drag to one side, and away.
fn presses_through(moment: &mut Moment<'_>) {
    let stroke = Stroke {
        each_s: 0.08,
        press_m: DVec3::Z * -29e-3,
        drag_m: DVec3::new(9e-3, 2e-3, 0.0),
        axis: DVec3::Z,
        half_sine: 0.3,
    };
    moment.drive.tools[0] = stroke.at(moment.model.tools()[0].start(), moment.time_s);
}

fn refines(moment: &mut Moment<'_>) {
    presses(moment);
    match moment.tick {
        20 => refine_only(moment.model, moment.state, &[0, 5], 2),
        150 => refine_only(moment.model, moment.state, &[40], 3),
        280 => refine_only(moment.model, moment.state, &[], 1),
        _ => {}
    }
}
