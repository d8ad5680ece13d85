//! Mass-spring surfaces, tick by tick: the same bits, vertices that sleep, snapshots, no allocation.
#![allow(clippy::unwrap_used)]
use crate::rig;
use crate::sheet;
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::{DQuat, DVec3};
use palpate_physics::{
    BodyState, PointForce, State, Substeps,
    bodies::mass_spring::{AnchorLaw, Refining},
    contact::{Coupling, ToolShape, ToolTarget},
    snapshot,
};
use rig::{Rig, springs_mut};
use sheet::{COARSE, energies, force_n, press, refined, sheet};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

fn tour(tick: u32) -> DVec3 {
    let phase = f64::from(tick) * 0.01;
    DVec3::new(0.01 * phase.sin(), 0.008 * (0.7 * phase).cos(), 2.5e-3 + 1.5e-3 * (1.7 * phase).sin())
}

/// Down to the surface, along it, and away again, at other ticks each time.
fn taps(tick: u32) -> DVec3 {
    let (round, phase) = (tick / 331, f64::from(tick % 331) / 331.0);
    let lift_m = 0.02 * (2.0 * (phase - 0.5)).abs().powi(2);
    DVec3::new(0.004 * f64::from(round) - 0.004, 0.003 * phase, 2.0e-3 + lift_m)
}

/// The broad phase and snapshots change no bit, wherever a tool comes from.
#[test]
fn looking_at_all_triangles_or_going_on_from_a_snapshot_gives_the_same_bits() {
    let all = usize::MAX;
    for (most_awake, path, tick_period_s) in [
        (all, tour as fn(u32) -> DVec3, 1e-3),
        (60, tour, 1e-3),
        (all, taps, 1e-3),
        (60, taps, 1e-3),
        // One substep a tick: it is judged by the tick before, too.
        (60, tour, 2e-4),
    ] {
        let spec = || {
            let mut spec = sheet(10, Some(refined(2, Refining::ByTools)));
            let springs = &mut springs_mut(&mut spec).springs;
            springs.most_awake = springs.most_awake.min(most_awake);
            spec.tools[0].friction_coefficient = 0.3;
            spec.settings.tick_period_s = tick_period_s;
            spec
        };
        let mut exhaustive = spec();
        exhaustive.settings.skips.distant_contact = false;
        let (mut rig, mut slow) = (Rig::new(spec()), Rig::new(exhaustive));
        assert_eq!(rig.model.substeps() == 1, tick_period_s < 1e-3);
        let mut restored: Option<Rig> = None;
        for tick in 0..900 {
            if tick == 437 || tick == 683 {
                let bytes = snapshot::save(&rig.model, &rig.state);
                let mut other = Rig::new(spec());
                other.state = snapshot::restore(&other.model, &bytes).unwrap();
                restored = Some(other);
            }
            for rig in [Some(&mut rig), Some(&mut slow), restored.as_mut()].into_iter().flatten() {
                rig.tick_at(path(tick));
            }
            assert_eq!(snapshot::state_hash(&rig.state), snapshot::state_hash(&slow.state), "tick {tick}");
            if let Some(restored) = &restored {
                assert_eq!(restored.state.mechanical.x, rig.state.mechanical.x, "tick {tick}");
            }
        }
        assert!(
            rig.state.mechanical.contact == slow.state.mechanical.contact
                || rig.state.mechanical.tools == slow.state.mechanical.tools
        );
        assert!(restored.is_some());
        rig.state.reset(&rig.model);
        let bytes = snapshot::save(&rig.model, &rig.state);
        assert_eq!(snapshot::restore(&rig.model, &bytes).unwrap(), State::at_rest(&rig.model));
    }
}

/// Fewer substeps than a sheet needs: ticks are repeated, from where they began, and a restored run goes on as
/// the one that was saved, whatever wakes and falls asleep.
#[test]
fn repeated_ticks_begin_where_they_began_and_restored_runs_repeat_the_same() {
    let mut spec = sheet(10, Some(refined(2, Refining::ByTools)));
    springs_mut(&mut spec).springs.most_awake = 60;
    spec.tools[0].friction_coefficient = 0.3;
    let needed = Rig::new(spec.clone()).model.substeps();
    spec.settings.substeps = Substeps::Fixed(1);
    let mut rig = Rig::new(spec);
    let (mut repeated, mut lengths) = (0, std::collections::BTreeSet::new());
    for tick in 0..700 {
        let bytes = snapshot::save(&rig.model, &rig.state);
        let mut restored = Rig { state: snapshot::restore(&rig.model, &bytes).unwrap(), ..Rig::new(rig.spec.clone()) };
        let before = rig.state.clone();
        let report = rig.tick_at(taps(tick));
        assert_eq!(report.quarantined, None, "tick {tick}");
        assert_eq!((restored.tick_at(taps(tick)), &restored.state), (report, &rig.state), "tick {tick}");
        lengths.insert(rig.state.mechanical.x.len());
        if report.repeated > 0 {
            let mut at_once = Rig { state: before, ..Rig::new(rig.spec.clone()) };
            at_once.state.pace.substeps = report.substeps;
            assert_eq!(at_once.tick_at(taps(tick)).repeated, 0, "tick {tick}");
            at_once.state.pace = rig.state.pace.clone();
            assert_eq!(at_once.state, rig.state, "tick {tick}");
            repeated += 1;
        }
    }
    println!("{repeated} ticks repeated, of {needed} substeps");
    assert!(repeated > 0 && lengths.len() > 2, "{repeated} {lengths:?}");
}

#[test]
fn damaged_and_foreign_snapshots_are_refused() {
    let mut rig = Rig::new(sheet(6, Some(refined(1, Refining::ByTools))));
    press(&mut rig, 2e-3, 100);
    let good = snapshot::save(&rig.model, &rig.state);
    for at in (0..good.len()).step_by(997) {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        assert!(snapshot::restore(&rig.model, &bad).is_err(), "byte {at}");
    }
    let mut softer = sheet(6, Some(refined(1, Refining::ByTools)));
    springs_mut(&mut softer).springs.fine.anchor_n_per_m *= 0.5;
    assert_eq!(snapshot::restore(&Rig::new(softer).model, &good), Err(snapshot::SnapshotError::OtherBody));
    let mut mangled = rig.state.clone();
    let BodyState::MassSpring(own) = &mut mangled.body else { panic!("no springs") };
    own.motion.ids.swap(3, 4);
    let bytes = snapshot::save(&rig.model, &mangled);
    assert_eq!(snapshot::restore(&rig.model, &bytes), Err(snapshot::SnapshotError::OtherBody));
}

/// Where fewer may be awake than there are, those about the tool are, and the force is that of all of them awake; when
/// it has left, all fall asleep at their rest positions.
#[test]
fn far_vertices_sleep() {
    let run = |most_awake: usize| {
        let mut spec = sheet(20, Some(refined(2, Refining::ByTools)));
        springs_mut(&mut spec).springs.most_awake = most_awake;
        let mut rig = Rig::new(spec);
        press(&mut rig, 1.5e-3, 300);
        let mut forces = Vec::new();
        for tick in 0..600 {
            let x_m = 0.03 * f64::from(tick) / 600.0;
            rig.tick_at(DVec3::new(x_m, 0.3 * x_m, 1.5e-3));
            forces.push(force_n(&rig));
        }
        let awake = rig.state.mechanical.x.len();
        press(&mut rig, 0.03, 100);
        (0..1200).for_each(|_| press(&mut rig, 0.03, 1));
        (forces, awake, rig)
    };
    let (all, all_awake, full) = run(1261);
    let (few, few_awake, rig) = run(400);
    assert!(all_awake > 1261 && (400..520).contains(&few_awake), "{all_awake} {few_awake}");
    let worst = all.iter().zip(&few).map(|(all, few)| (few / all - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 2e-3, "{worst}");
    assert_eq!(rig.state.mechanical.x.len(), 0);
    let e = energies(&rig);
    // What falls asleep leaves nothing that is not told: with all awake the balance is as far off, by leapfrog's step.
    let apart_j = e.balance_j() - energies(&full).balance_j();
    assert!(e.held_j() == 0.0 && apart_j.abs() < 1e-5 * e.external_work_j, "{e:?}");
}

/// A force injected where all sleep wakes what is around.
#[test]
fn a_force_wakes_where_it_is_injected() {
    let mut spec = sheet(20, None);
    springs_mut(&mut spec).springs.most_awake = 200;
    spec.tools.clear();
    let mut rig = Rig::new(spec);
    let mut drive = rig.still();
    assert!(rig.state.mechanical.x.is_empty());
    drive.point_forces = vec![PointForce { node: 40, force_n: DVec3::Z * -1e-3 }];
    for _ in 0..400 {
        rig.tick(&drive);
    }
    let mut surface = Vec::new();
    rig.model.surface_positions_m(&rig.state, &mut surface);
    let depth_m = rig.model.surface_rest_positions_m()[40].z - surface[40].z;
    assert_eq!(rig.state.mechanical.x.len(), 200);
    assert!((depth_m - 1e-3 / COARSE.anchor_n_per_m).abs() < 0.02 * depth_m, "{depth_m}");
}

#[test]
fn ticks_allocate_nothing() {
    let lying = ToolShape::capsule(Coupling::Rigid, 3e-3, 0.012, DVec3::X);
    for (most_awake, shape) in [usize::MAX, 80].into_iter().flat_map(|most| [(most, ToolShape::Sphere), (most, lying)])
    {
        let mut spec = sheet(10, Some(refined(2, Refining::ByTools)));
        spec.tools[0].shape = shape;
        let springs = &mut springs_mut(&mut spec).springs;
        springs.most_awake = springs.most_awake.min(most_awake);
        springs.anchor_law = AnchorLaw::cubic(1e4).unwrap();
        let mut rig = Rig::new(spec);
        let mut saved = State::at_rest(&rig.model);
        let mut drive = rig.still();
        let still = drive.tools[0];
        drive.point_forces.push(PointForce { node: 0, force_n: DVec3::ZERO });
        let (mut layouts, mut nodes) = (0, 0);
        assert_no_alloc(|| {
            for tick in 0..3000 {
                let position_m = tour(tick) + if tick % 1000 > 700 { DVec3::Z * 0.05 } else { DVec3::ZERO };
                let orientation = DQuat::from_rotation_z(1e-3 * f64::from(tick)) * still.orientation;
                drive.tools[0] = ToolTarget { position_m, orientation, ..still };
                drive.point_forces[0] = PointForce { node: tick % 300, force_n: DVec3::Z * 1e-3 };
                rig.tick(&drive);
                layouts += u32::from(rig.state.mechanical.x.len() != nodes);
                nodes = rig.state.mechanical.x.len();
                if tick % 500 == 0 {
                    saved.copy_from(&rig.state);
                }
                if tick == 1700 {
                    rig.state.reset(&rig.model);
                }
            }
        });
        assert!(rig.state.quarantine.is_none() && layouts > 20, "{layouts}");
    }
}
