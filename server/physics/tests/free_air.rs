//! A small tool follows its device in the air. Its coupling saturates at what its radius can bear in contact, some
//! millinewtons for a radius of 1 mm: limited so in the air, too, a tool of 20 g was 33 mm behind a hand that moved at
//! 1 m/s, and met the body a tenth of a second late.
#![allow(clippy::unwrap_used)]
use crate::rig;

use glam::DVec3;
use palpate_physics::{
    ModelSpec,
    contact::{Coupling, ToolState},
    material::Law,
};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, sphere};

const RADIUS_M: f64 = 1e-3;
const STIFFNESS_N_PER_M: f64 = 800.0;
const MASS_KG: f64 = 0.02;

/// 20 × 20 × 10 mm, its upper face at z = 0, held at its lower one; the tool starts above it.
fn block(damping_n_s_per_m: f64, start_m: DVec3) -> ModelSpec {
    let side = even(-0.01, 0.01, 10);
    let mesh = bricks(&side, &side, &even(-0.01, 0.0, 5));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0099);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec.settings.mass_damping_per_s = 20.0;
    let coupling = Coupling::Spring { stiffness_n_per_m: STIFFNESS_N_PER_M, damping_n_s_per_m, mass_kg: MASS_KG };
    spec.tools = vec![sphere(RADIUS_M, start_m, coupling)];
    spec
}

fn tool(rig: &Rig) -> &ToolState {
    &rig.state.mechanical.tools[0]
}

/// Without a damper, a tool whose device leaps by `d` and stays swings about it: `c = d (1 − cos ωt)`, `ω = √(K/m)`.
#[test]
fn in_the_air_the_coupling_is_linear_and_its_device_is_told_no_more_than_contact_could_bear() {
    let (start_m, leap_m) = (DVec3::Z * 0.03, DVec3::new(2e-3, -1e-3, 0.0));
    let mut rig = Rig::new(block(0.0, start_m));
    let limit_n = rig.model.contact().force_limit_n(0);
    assert!(limit_n < 0.02 * STIFFNESS_N_PER_M * leap_m.length(), "{limit_n} N");
    let omega = (STIFFNESS_N_PER_M / MASS_KG).sqrt();
    for tick in 1..=100 {
        rig.tick_at(start_m + leap_m);
        // The device moves evenly during the first tick: a leap in the middle of it, within (ωT)²/24.
        let now_s = (f64::from(tick) - 0.5) * 1e-3;
        let expected_m = start_m + leap_m * (1.0 - (omega * now_s).cos());
        let off_m = tool(&rig).centre_m.distance(expected_m);
        assert!(off_m < 0.02 * leap_m.length(), "{tick}: {off_m} m");
        assert!(tool(&rig).device_force_n.length() <= limit_n * (1.0 + 1e-12));
    }
}

/// At 1 m/s it comes down beside its hand, and is held by the surface.
#[test]
fn a_small_tool_keeps_up_with_a_quick_hand_and_stops_at_the_surface() {
    let start_m = DVec3::Z * 0.021;
    let mut rig = Rig::new(block(3.0, start_m));
    for tick in 1..=300 {
        let device_m = start_m - DVec3::Z * (1e-3 * f64::from(tick)).min(0.025);
        rig.tick_at(device_m);
        let above_m = device_m.z - RADIUS_M;
        if above_m > 2e-3 {
            assert!(tool(&rig).centre_m.distance(device_m) < 8e-3, "{tick}: {}", tool(&rig).centre_m);
        }
        assert!(tool(&rig).centre_m.z > -0.5 * RADIUS_M, "{tick}: {}", tool(&rig).centre_m);
    }
    let pressed_n = tool(&rig).contact_force_n.z;
    assert!(pressed_n > 0.3 * rig.model.contact().force_limit_n(0), "{pressed_n} N");
}

/// What is in the air, and how far a leap of its device goes, makes no difference to what is finite.
#[test]
fn a_device_that_leaps_out_of_the_world_leaves_numbers_finite() {
    let start_m = DVec3::Z * 0.021;
    let mut rig = Rig::new(block(3.0, start_m));
    for far_m in [DVec3::X * 1e3, DVec3::splat(1e150), start_m] {
        for _ in 0..20 {
            assert!(rig.tick_at(far_m).quarantined.is_none());
            assert!(tool(&rig).centre_m.is_finite() && tool(&rig).velocity_m_per_s.is_finite());
        }
    }
}

/// A device whose tool a surface holds goes 9 mm along it, beneath it. The damper of the whole spring let the tool creep after it,
/// at what the surface bears over the damping, 10 mm/s.
#[test]
fn a_small_tool_that_a_surface_holds_does_not_creep_after_its_device() {
    let (from_m, to_m) = (DVec3::new(-7e-3, 0.0, -2e-3), DVec3::new(2e-3, 0.0, -2e-3));
    let mut rig = Rig::new(block(3.0, DVec3::new(-7e-3, 0.0, 2e-3)));
    (0..200).for_each(|_| _ = rig.tick_at(from_m));
    assert!(tool(&rig).contact_force_n.z > 0.0 && tool(&rig).centre_m.distance(from_m) > 2e-3);
    for tick in 0..1000 {
        rig.tick_at(to_m);
        let tool = tool(&rig);
        assert!(tool.centre_m.z > -0.5 * RADIUS_M, "{tick}: {}", tool.centre_m);
        assert!(tick < 400 || (tool.centre_m.x - to_m.x).abs() < 3e-3, "{tick}: {}", tool.centre_m);
    }
    assert!((tool(&rig).centre_m.x - to_m.x).abs() < 0.5e-3, "{}", tool(&rig).centre_m);
    assert!(tool(&rig).contact_force_n.z > 0.0);
}
