//! Mass-spring surfaces beneath tools: refinement, forces, energy, equilibrium.
#![allow(clippy::unwrap_used)]
use crate::rig;
use crate::sheet;
use glam::DVec3;
use palpate_physics::{
    LoadSpec, ModelSpec, Substeps,
    bodies::mass_spring::{
        Net, Refinement, Refining,
        constants_table::{Calibration, ConstantsTable},
        equilibrium::settle,
    },
    contact::{Coupling, ToolSpec},
    world::refine_only,
};
use rig::{Drive, Rig, at, sphere, springs_mut};
use sheet::{COARSE, energies, force_n, press, refined, refined_nodes, sheet};
#[test]
fn what_is_touched_is_refined_and_coarse_again_when_left() {
    for (rings, nodes) in [(1, 12), (2, 42)] {
        let mut rig = Rig::new(sheet(8, Some(refined(rings, Refining::ByTools))));
        press(&mut rig, 0.007, 50);
        assert_eq!(refined_nodes(&rig), 0, "far away");
        press(&mut rig, 1.5e-3, 200);
        assert_eq!(refined_nodes(&rig), nodes);
        assert!(force_n(&rig) > 1e-3);
        press(&mut rig, 0.02, 100);
        assert_eq!(refined_nodes(&rig), nodes, "not at once");
        press(&mut rig, 0.02, 250);
        assert_eq!(refined_nodes(&rig), 0);
    }
}

/// Rings that follow the dent: few while it is shallow, more as it deepens, fewer again, and none flutters.
#[test]
fn deeper_dents_have_more_rings() {
    let mut spec = sheet(10, Some(Refinement { rings: 4, follows_dent: true, blend_s: 0.1, by: Refining::ByTools }));
    spec.tools[0].radius_m = 6e-3;
    let mut rig = Rig::new(spec);
    let mut counts = Vec::new();
    for (height_m, ticks) in [(5.8e-3, 300), (4.5e-3, 300), (1e-3, 400), (5.8e-3, 600)] {
        press(&mut rig, height_m, ticks);
        press(&mut rig, height_m, 200);
        let before = refined_nodes(&rig);
        press(&mut rig, height_m, 50);
        assert_eq!(refined_nodes(&rig), before);
        counts.push(before);
    }
    assert_eq!(counts, [12, 42, 90, 12]);
}

/// Pressing, dragging across many regions, and leaving: all energy is accounted for, but for what leapfrog's step
/// leaves, which is of second order in it.
#[test]
fn the_ledger_closes_while_a_tool_is_dragged_across() {
    let off = |substeps: u32| {
        let mut spec = sheet(10, Some(refined(2, Refining::ByTools)));
        spec.settings.substeps = Substeps::Fixed(substeps);
        let mut rig = Rig::new(spec);
        press(&mut rig, 1.5e-3, 200);
        let pressed_j = energies(&rig).held_j();
        let mut most = 0;
        for tick in 0..1500 {
            let x_m = 0.012 * (f64::from(tick) * 0.006).sin();
            rig.tick_at(DVec3::new(x_m, 0.4 * x_m, 1.5e-3));
            most = most.max(refined_nodes(&rig));
        }
        press(&mut rig, 0.02, 400);
        let e = energies(&rig);
        let given_j = rig.state.body.as_mass_spring().unwrap().given_j;
        println!("given by levels {given_j:.2e} J, held while pressed {pressed_j:.2e} J, {e:?}");
        // Levels on their way drive no tool on.
        assert!(most > 42 && given_j < -1e-8 && given_j > -0.05 * pressed_j, "{most} {given_j}");
        e.balance_j().abs() / pressed_j
    };
    let [long, half] = [16, 32].map(off);
    println!("{long:.2e}, {half:.2e} of what is held while pressed");
    assert!(half < 1e-3 && half < 0.4 * long, "{long} {half}");
}

/// Refined and coarse again beneath a tool that stands still: no tick changes its force by 1 %, and coarse again the
/// force is what it was.
#[test]
fn the_force_does_not_step_when_the_surface_is_refined() {
    for centre in [0, 1, 7] {
        let mut rig = Rig::new(sheet(8, Some(refined(2, Refining::ByHand))));
        press(&mut rig, 1.5e-3, 300);
        press(&mut rig, 1.5e-3, 300);
        let coarse_n = force_n(&rig);
        let (mut before_n, mut step, mut held_j) = (coarse_n, 0.0_f64, energies(&rig).held_j());
        let mut upward_j = 0.0_f64;
        for tick in 0..1200 {
            let wanted: &[u32] = if tick / 300 % 2 == 0 { &[centre] } else { &[] };
            refine_only(&rig.model, &mut rig.state, wanted, 2);
            rig.tick_at(DVec3::Z * 1.5e-3);
            step = step.max((force_n(&rig) - before_n).abs() / coarse_n);
            before_n = force_n(&rig);
            let now_j = energies(&rig).held_j();
            upward_j = upward_j.max(now_j - held_j);
            held_j = now_j;
        }
        assert!(step < 0.01 && step > 1e-5, "about {centre}: {step}");
        assert!((force_n(&rig) / coarse_n - 1.0).abs() < 1e-3);
        assert!(upward_j < 0.01 * held_j, "about {centre}: {upward_j} of {held_j}");
    }
}

/// Constants from a table calibrated for this sheet, and a sphere that touches little but one vertex: refined and
/// coarse again, at several depths, the force does not step, and is nearly the same.
#[test]
fn with_a_calibrated_table_a_point_feels_alike_on_both() {
    for depth_m in [0.4e-3, 0.8e-3, 1.2e-3] {
        let mut spec = sheet(8, Some(refined(2, Refining::ByHand)));
        let own = springs_mut(&mut spec);
        let of = Calibration { coarse: COARSE, rings: 2, ratio: 5.0, samples: 3 };
        own.table = Some(ConstantsTable::calibrate(&own.springs.surface, of, &mut |_| ()).unwrap());
        spec.tools[0].radius_m = 0.5e-3;
        let mut rig = Rig::new(spec);
        let z_m = 0.5e-3 - depth_m;
        press(&mut rig, z_m, 400);
        press(&mut rig, z_m, 300);
        let coarse_n = force_n(&rig);
        let (mut before_n, mut step, mut apart, mut held_j) = (coarse_n, 0.0_f64, 0.0_f64, energies(&rig).held_j());
        let mut upward = 0.0_f64;
        for tick in 0..1200 {
            let wanted: &[u32] = if tick / 300 % 2 == 0 { &[0] } else { &[] };
            refine_only(&rig.model, &mut rig.state, wanted, 2);
            rig.tick_at(DVec3::Z * z_m);
            step = step.max((force_n(&rig) - before_n).abs() / coarse_n);
            before_n = force_n(&rig);
            upward = upward.max((energies(&rig).held_j() - held_j) / held_j);
            held_j = energies(&rig).held_j();
            if tick % 300 == 299 {
                apart = apart.max((force_n(&rig) / coarse_n - 1.0).abs());
            }
        }
        println!(
            "{:.1} mm: {coarse_n:.3e} N, a tick changes it by {step:.1e}, refined differs by {apart:.1e}, energy up by {upward:.1e} a tick",
            depth_m * 1e3
        );
        // What is matched is one vertex alone; what is pressed beside it goes to its refined neighbours.
        assert!(step < 0.01 && apart < 0.15 && coarse_n > 1e-3, "{step} {apart}");
    }
}

/// Under a dead load the loop comes to rest where springs and load are in balance.
#[test]
fn loads_and_weight_come_to_rest_in_balance() {
    let mut spec = sheet(6, None);
    spec.tools.clear();
    spec.loads = vec![LoadSpec::NodalForces(vec![(0, DVec3::new(4e-3, 0.0, -0.01))])];
    spec.gravity_m_per_s2 = DVec3::Z * -9.81;
    let mut rig = Rig::new(spec);
    let drive = Drive { load_factors: vec![1.0], ..rig.still() };
    for _ in 0..1500 {
        rig.tick(&drive);
    }
    let e = energies(&rig);
    assert!(e.kinetic_j < 1e-9 * e.elastic_j && e.balance_j().abs() < 1e-3 * e.external_work_j, "{e:?}");
    let total: DVec3 = rig.state.mechanical.force_n.iter().sum();
    let held: DVec3 = rig.scratch.reactions_n().iter().copied().sum();
    // What is free is in balance; the holders carry the rest.
    assert!((total + held).length() < 1e-7, "{total} {held}");
    // The plain springs, settled by Newton's method.
    let body = rig.model.body().as_mass_spring().unwrap().model();
    // At the rest positions: Loop's scheme smooths the boundary.
    let rest_m = body.rest_m()[..body.vertices() as usize].to_vec();
    let net = Net::uniform(&body.surface().moved(rest_m).unwrap(), COARSE.mesh_n_per_m, COARSE.anchor_n_per_m);
    let is_held: Vec<bool> = (0..body.vertices()).map(|vertex| body.is_held(vertex)).collect();
    let mut external_n: Vec<DVec3> = body.spec().mass_kg.iter().map(|mass| DVec3::Z * (-9.81 * mass)).collect();
    external_n[0] += DVec3::new(4e-3, 0.0, -0.01);
    let mut settled_m = net.rest_m.clone();
    settle(&net, &is_held, &external_n, &mut settled_m, 1e-12).unwrap();
    let worst_m =
        rig.state.mechanical.x.iter().zip(&settled_m).map(|(x, settled)| x.distance(*settled)).fold(0.0, f64::max);
    assert!(worst_m < 1e-8 && settled_m[0].z < -8e-4, "{worst_m} {}", settled_m[0]);
}

/// While levels are on their way beneath one tool, another goes about in the air at 1 m/s.
#[test]
fn a_tool_in_the_air_hurries_no_levels() {
    let beneath = |swing_m: f64| {
        let mut spec = sheet(6, Some(refined(2, Refining::ByTools)));
        spec.tools[0].start_position_m = DVec3::Z * 4e-3;
        spec.tools.push(ToolSpec { name: "other".into(), ..sphere(3e-3, DVec3::Z * 0.06, Coupling::Rigid) });
        let mut rig = Rig::new(spec);
        let mut drive = rig.still();
        for tick in 0..30 {
            // So slowly that its own speed leaves them on their way.
            drive.tools[0] = at(DVec3::Z * (4e-3 - 5e-5 * f64::from(tick)));
            drive.tools[1] = at(DVec3::new(swing_m * (20.0 * f64::from(tick) * 1e-3).sin(), 0.0, 0.06));
            rig.tick(&drive);
        }
        assert!(refined_nodes(&rig) > 0 && rig.state.mechanical.tools[0].contacts > 0);
        rig.state.mechanical.x
    };
    assert!(beneath(0.0) == beneath(0.05), "its speed is seen in the positions");
}

#[test]
fn what_springs_cannot_have_is_refused_by_name() {
    let refused = |change: &dyn Fn(&mut ModelSpec)| {
        let mut spec = sheet(4, Some(refined(1, Refining::ByTools)));
        change(&mut spec);
        palpate_physics::Model::build(spec).unwrap_err().to_string()
    };
    assert!(refused(&|spec| spec.prescribed[0].axes = [true, false, true]).contains("along some axes"));
    assert!(refused(&|spec| spec.settings.sleep_tolerance_m = 1e-6).contains("sleeps as a whole"));
    assert!(
        refused(&|spec| spec.settings.integrator = palpate_physics::Integrator::BackwardEuler).contains("leapfrog")
    );
    assert!(refused(&|spec| spec.prescribed[0].nodes.push(400)).contains("node 400 is out of range"));
    assert!(
        refused(&|spec| {
            let none = Refinement { rings: 0, follows_dent: false, blend_s: 0.1, by: Refining::ByTools };
            springs_mut(spec).refinement = Some(none);
        })
        .contains("rings = 0")
    );
    assert!(
        refused(&|spec| {
            springs_mut(spec).springs.most_awake = 10;
            spec.gravity_m_per_s2 = DVec3::Z;
        })
        .contains("gravity")
    );
    assert!(refused(&|spec| spec.tools[0].radius_m = 1e-5).contains("too small for the surface"));
}

/// Contact grows stiffer than at rest where the surface is stretched and a tool is deep in it. Then a tick has as many
/// more substeps, and half of the energy that was missing is there.
#[test]
fn a_tool_that_tears_along_gets_the_substeps_that_contact_needs() {
    let torn = |coupling: Coupling, subcycle: bool| {
        let (radius_m, speed_m_per_s) = (8e-3, 2.0);
        let mut spec = sheet(10, Some(refined(2, Refining::ByTools)));
        spec.settings.subcycle_unstable = subcycle;
        spec.tools[0] = ToolSpec { friction_coefficient: 0.3, ..sphere(radius_m, DVec3::Z * 0.01, coupling) };
        let mut rig = Rig::new(spec);
        let (mut most, mut missing_j, mut moved_j) = (0, 0.0_f64, 0.0_f64);
        for tick in 0..400 {
            let time_s = f64::from(tick) * 1e-3;
            let depth_m = (speed_m_per_s * time_s).min(0.9 * radius_m);
            let x_m = 0.03 * (speed_m_per_s * (time_s - 0.02).max(0.0) / 0.03).sin();
            most = most.max(rig.tick_at(DVec3::new(x_m, 0.0, radius_m - depth_m)).substeps);
            let e = energies(&rig);
            assert!(rig.state.quarantine.is_none() && e.balance_j().is_finite());
            missing_j = missing_j.max(e.balance_j().abs());
            moved_j = moved_j.max(e.external_work_j.abs()).max(e.dissipated_j.abs()).max(e.held_j());
        }
        println!("{coupling:?}: up to {most} substeps, {:.4} of what moved is missing", missing_j / moved_j);
        (most > rig.model.substeps(), missing_j / moved_j)
    };
    let spring = Coupling::Spring { stiffness_n_per_m: 400.0, damping_n_s_per_m: 2.0, mass_kg: 0.05 };
    for coupling in [Coupling::Rigid, spring] {
        let [(has_more, missing), (had_more, was_missing)] = [true, false].map(|judged| torn(coupling, judged));
        assert!(has_more && !had_more && missing < 0.5 * was_missing, "{coupling:?}: {missing} {was_missing}");
    }
}
