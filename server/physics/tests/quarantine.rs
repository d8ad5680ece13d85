//! What is not finite is refused, contained and reported; the last good state stays.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    LoadSpec, Model, ModelSpec, PointForce, State, StepReport,
    contact::{Coupling, ToolTarget},
    material::Law,
    snapshot,
};
use rig::{Drive, Rig, at, body, bricks, even, hold, material, nodes_where, solid_mut, sphere};

fn pressed_block() -> ModelSpec {
    let side = even(-0.02, 0.02, 4);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 2));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.4));
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    let coupling = Coupling::Spring { stiffness_n_per_m: 200.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 };
    spec.tools = vec![sphere(0.008, DVec3::new(0.0, 0.0, 0.0085), coupling)];
    spec
}

fn pressed() -> Rig {
    let mut rig = Rig::new(pressed_block());
    for _ in 0..50 {
        rig.tick_at(DVec3::Z * 0.005);
    }
    assert!(rig.state.mechanical.tools[0].contacts > 0);
    rig
}

#[test]
fn an_enormous_force_leaves_the_last_good_state() {
    for force_n in [DVec3::Z * 1e300, DVec3::X * f64::MAX, DVec3::splat(1e200)] {
        let mut rig = pressed();
        let good = rig.state.clone();
        let mut drive = rig.still();
        drive.point_forces.push(PointForce { node: 60, force_n });
        let report = rig.tick(&drive);
        assert!(report.quarantined.is_some(), "{force_n}");
        assert_eq!(report.quarantined, rig.state.quarantine);
        assert_eq!(rig.state.mechanical.x, good.mechanical.x);
        assert!(rig.state.mechanical.v.iter().all(|v| *v == DVec3::ZERO));
        assert_eq!(rig.state.mechanical.ledger, good.mechanical.ledger);
        assert!(rig.scratch.reactions_n().iter().all(|r| r.is_finite()));
        let tool = &rig.state.mechanical.tools[0];
        assert_eq!((tool.device_force_n, tool.local_model, tool.contacts), (DVec3::ZERO, None, 0));
        assert_eq!(tool.centre_m, good.mechanical.tools[0].centre_m);
        // Whatever comes, nothing happens any more.
        let held = rig.state.clone();
        for _ in 0..20 {
            let report = rig.tick_at(DVec3::Z * 0.001);
            assert_eq!(report, StepReport { substeps: 0, repeated: 0, inputs_rejected: 0, quarantined: None });
        }
        assert_eq!(rig.state, held);
        // It can be saved and looked at, and reset.
        assert_eq!(snapshot::restore(&rig.model, &snapshot::save(&rig.model, &held)).unwrap(), held);
        rig.state.reset(&rig.model);
        assert_eq!(rig.state, State::at_rest(&rig.model));
        // What was not finite is left in no buffer either.
        let mut fresh = Rig::new(pressed_block());
        for tick in 0..60 {
            let position_m = DVec3::Z * (0.0085 - 1e-4 * f64::from(tick));
            assert_eq!(rig.tick_at(position_m), fresh.tick_at(position_m));
        }
        assert_eq!(rig.state, fresh.state);
    }
}

#[test]
fn a_device_at_an_absurd_place_cannot_harm_the_body() {
    for far_m in [1e3, 1e30, 1e300] {
        let mut rig = pressed();
        for _ in 0..20 {
            rig.tick_at(DVec3::new(far_m, 0.0, -far_m));
        }
        assert_eq!(rig.state.quarantine, None, "{far_m}");
        assert!(rig.state.mechanical.x.iter().all(|x| x.is_finite()));
        assert!(
            rig.state.mechanical.tools[0].device_force_n.length()
                <= rig.model.contact().force_limit_n(0) * (1.0 + 1e-9)
        );
    }
}

#[test]
fn inputs_that_are_not_finite_are_replaced_and_counted() {
    let mut bad = pressed();
    let mut good = pressed();
    let hold_still = good.still();
    assert_eq!(good.tick(&hold_still).inputs_rejected, 0);
    let nan_tool = ToolTarget::at(DVec3::new(0.0, f64::NAN, 0.0));
    let drive = Drive {
        tools: vec![nan_tool],
        prescribed: vec![DVec3::splat(f64::INFINITY)],
        point_forces: vec![
            PointForce { node: 5, force_n: DVec3::NAN },
            PointForce { node: 1_000_000, force_n: DVec3::X },
        ],
        ..bad.still()
    };
    let report = bad.tick(&drive);
    assert_eq!(report.inputs_rejected, 4);
    assert_eq!(report.quarantined, None);
    // The tool holds its target; the rest acts as if not given.
    assert_eq!(bad.state, good.state);
}

#[test]
fn inputs_of_the_wrong_length_are_replaced_and_counted() {
    let mut bad = pressed();
    let mut good = pressed();
    let hold_still = good.still();
    good.tick(&hold_still);
    let drive = Drive { tools: vec![at(DVec3::ONE); 2], load_factors: vec![1.0], ..Drive::default() };
    assert_eq!(bad.tick(&drive).inputs_rejected, 3);
    assert_eq!(bad.state, good.state);
}

/// Constants and loads that are not finite were once taken into the model, and spoilt its first tick instead.
#[test]
fn a_model_of_what_is_not_finite_is_refused_by_name() {
    let spoilt = |spoil: &dyn Fn(&mut ModelSpec)| {
        let mut spec = pressed_block();
        spoil(&mut spec);
        Model::build(spec).unwrap_err().to_string()
    };
    let load = |load: LoadSpec| spoilt(&|spec: &mut ModelSpec| spec.loads = vec![load.clone()]);
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(
            spoilt(&|spec| solid_mut(spec).regions[0].material.lame.mu_pa = bad).contains("region \"all\": lambda_pa")
        );
        assert!(
            spoilt(&|spec| solid_mut(spec).regions[0].material.viscosity.psi_pa_s = bad).contains("viscosity_psi_pa_s")
        );
        assert!(load(LoadSpec::NodalForces(vec![(0, DVec3::X * bad)])).contains("nodal force"));
        assert!(load(LoadSpec::Traction { triangles: vec![0], traction_pa: DVec3::X * bad }).contains("traction_pa"));
        assert!(
            load(LoadSpec::Pressure { triangles: vec![0], pressure_pa: bad, follower: true }).contains("pressure_pa")
        );
    }
}
