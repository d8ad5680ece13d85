//! Tools hold each other off.
//!
//! Two coupled spheres on either side of a slab of 10 mm, their devices driven 11 mm in from both sides, overlapped by
//! 1.2 mm: the slab between them gave way, and neither tool knew the other.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, ModelSpec,
    contact::{Coupling, ToolShape},
    material::Law,
};
use rig::{Drive, Rig, at, body, bricks, even, hold, material, mesh_of, nodes_where, sphere};

const RADIUS_M: f64 = 6e-3;

fn coupled() -> Coupling {
    Coupling::Spring { stiffness_n_per_m: 400.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 }
}

/// A slab of 40 × 40 × 10 mm, held at two sides, between two tools.
fn squeezed(couplings: [Coupling; 2]) -> ModelSpec {
    let side = even(-0.02, 0.02, 8);
    let mut spec = body(bricks(&side, &side, &even(-0.005, 0.005, 2)), material(Law::StableNeoHookean, 10e3, 0.45));
    let held = nodes_where(mesh_of(&spec), |p| p.x.abs() > 0.0199);
    spec.prescribed = vec![hold("sides", held, [true; 3])];
    spec.settings.mass_damping_per_s = 15.0;
    spec.tools =
        vec![sphere(RADIUS_M, DVec3::Z * 0.012, couplings[0]), sphere(RADIUS_M, DVec3::Z * -0.012, couplings[1])];
    spec
}

/// Drives the devices to the middle and 5 mm past it; returns the least distance of the tools' centres.
fn squeeze(rig: &mut Rig) -> f64 {
    let mut least_m = f64::INFINITY;
    for tick in 0..400 {
        let z = 0.012 - 0.017 * (f64::from(tick) / 250.0).min(1.0);
        rig.tick(&Drive { tools: vec![at(DVec3::Z * z), at(DVec3::Z * -z)], ..rig.still() });
        let [a, b] = [0, 1].map(|tool| rig.state.mechanical.tools[tool].centre_m);
        least_m = least_m.min(a.distance(b));
    }
    assert!(rig.state.quarantine.is_none());
    least_m
}

#[test]
fn coupled_tools_that_squeeze_a_slab_do_not_pass_through_each_other() {
    let mut rig = Rig::new(squeezed([coupled(); 2]));
    let least_m = squeeze(&mut rig);
    let forces = [0, 1].map(|tool| rig.state.mechanical.tools[tool].device_force_n);
    println!("least distance {:.2} mm of 12, forces {forces:?}", 1e3 * least_m);
    assert!(least_m > 2.0 * RADIUS_M * (1.0 - 0.07), "{least_m}");
    // The slab presses both alike, and each device is given what its coupling has.
    assert!((forces[0] + forces[1]).length() < 0.02 * forces[0].length(), "{forces:?}");
    assert!(forces[0].z > 0.5 * rig.model.contact().force_limit_n(0));
}

/// Far from the body two coupled tools are two masses: what one gets the other gives, and the books are closed.
#[test]
fn in_the_air_what_one_gets_the_other_gives() {
    for long in [false, true] {
        let mut spec =
            squeezed([Coupling::Spring { stiffness_n_per_m: 1e-6, damping_n_s_per_m: 0.0, mass_kg: 0.02 }; 2]);
        for (tool, sign) in spec.tools.iter_mut().zip([1.0, -1.0]) {
            tool.start_position_m = DVec3::new(0.02 * sign, 0.001 * sign, 0.5);
            if long {
                tool.shape = ToolShape::capsule(tool.coupling, RADIUS_M, 8e-3, DVec3::new(0.3, 1.0, 0.2 * sign));
            }
        }
        let mut rig = Rig::new(spec);
        for (tool, sign) in rig.state.mechanical.tools.iter_mut().zip([1.0, -1.0]) {
            tool.velocity_m_per_s = DVec3::X * (-0.1 * sign);
        }
        let inertia = |rig: &Rig| match rig.spec.tools[0].shape {
            ToolShape::Capsule(capsule) => capsule.turning.inertia_kg_m2,
            ToolShape::Sphere => 0.0,
        };
        let sums = |rig: &Rig| {
            let tools = &rig.state.mechanical.tools;
            let linear: DVec3 = tools.iter().map(|t| t.velocity_m_per_s * 0.02).sum();
            let angular: DVec3 = tools
                .iter()
                .map(|t| t.centre_m.cross(t.velocity_m_per_s * 0.02) + t.angular_velocity_rad_per_s * inertia(rig))
                .sum();
            let energy_j: f64 = tools
                .iter()
                .map(|t| {
                    let turning = inertia(rig) * t.angular_velocity_rad_per_s.length_squared();
                    0.5 * (0.02 * t.velocity_m_per_s.length_squared() + turning) + t.contact_energy_j
                })
                .sum();
            (linear, angular, energy_j)
        };
        let start = sums(&rig);
        let (mut met, mut worst) = (0, 0.0_f64);
        for _ in 0..400 {
            rig.tick(&rig.still());
            let now = sums(&rig);
            met += u32::from(rig.state.mechanical.tools[0].contact_energy_j > 0.0);
            worst = worst.max((now.2 / start.2 - 1.0).abs());
            assert!((now.0 - start.0).length() < 1e-9 && (now.1 - start.1).length() < 1e-9, "{now:?} {start:?}");
        }
        let apart = rig.state.mechanical.tools[0].velocity_m_per_s.x;
        println!("met in {met} ticks, energy to {worst:.1e}, then {apart:.2} m/s");
        assert!(met > 3 && apart > 0.02 && worst < 5e-3, "{met} {apart} {worst}");
    }
}

/// In the air couplings are not limited, and a quick tool has more energy than the other's potential: devices that crossed
/// at 2 m/s took their tools through each other.
#[test]
fn quick_tools_do_not_leap_over_each_other() {
    for (m_per_s, other) in [(0.3, coupled()), (2.0, coupled()), (5.0, coupled()), (2.0, Coupling::Rigid)] {
        let mut spec = squeezed([coupled(), other]);
        let off_axis = DVec3::new(0.5, 0.5, 0.0);
        let place = |z: f64| [off_axis + DVec3::Z * z, off_axis - DVec3::Z * z];
        for (tool, start) in spec.tools.iter_mut().zip(place(0.06)) {
            tool.start_position_m = start;
        }
        let mut rig = Rig::new(spec);
        let (mut least_m, mut z) = (f64::INFINITY, 0.06_f64);
        for _ in 0..400 {
            z = (z - 1e-3 * m_per_s).max(if other == Coupling::Rigid { 0.0 } else { -0.004 });
            rig.tick(&Drive { tools: place(z).map(at).to_vec(), ..rig.still() });
            let [a, b] = [0, 1].map(|tool| rig.state.mechanical.tools[tool].centre_m);
            least_m = least_m.min(a.distance(b));
        }
        let [a, b] = [0, 1].map(|tool| rig.state.mechanical.tools[tool].centre_m);
        println!("{m_per_s} m/s: least distance {:.2} mm of 12, at the end {:.2}", 1e3 * least_m, 1e3 * a.distance(b));
        assert!(a.z > b.z && least_m > RADIUS_M, "{m_per_s} {other:?} {least_m}");
    }
}

#[test]
fn one_tool_and_tools_apart_are_as_before() {
    // The second tool is never near: nothing of the first's bits changes.
    let press = |tools: usize| {
        let mut spec = squeezed([coupled(); 2]);
        spec.tools.truncate(tools);
        spec.settings.substeps = palpate_physics::Substeps::Fixed(12);
        let mut rig = Rig::new(spec);
        for tick in 0..150 {
            let z = 0.012 - 4e-3 * (f64::from(tick) / 100.0).min(1.0);
            let all = [at(DVec3::Z * z), at(DVec3::Z * -0.05)];
            rig.tick(&Drive { tools: all[..tools].to_vec(), ..rig.still() });
        }
        assert!(rig.state.mechanical.tools[0].contacts > 0);
        (rig.state.mechanical.x.clone(), Energies::of(&rig.model, &rig.state))
    };
    assert_eq!(press(1), press(2));
}
