//! What the state of a hybrid body goes back to: in ticks that are repeated, in quarantine, and from a snapshot.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    PointForce, Precision, Scratch,
    material::Viscosity,
    snapshot::{self, SnapshotError},
    world::wake_only,
};
use rig::{Rig, near, pressed_block, solid_mut};

/// A block that a sphere presses, of which other particles have been woken under load since so many ticks.
fn switched(ticks_ago: u32) -> Rig {
    let mut rig = Rig::new(pressed_block(Precision::Double, None));
    let touched = near(&rig, DVec3::ZERO, 8e-3);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, touched.iter().copied());
    for tick in 0..300 {
        rig.tick_at(DVec3::Z * (6e-3 - 2.5e-3 * f64::from(tick.min(200)) / 200.0));
    }
    let others = near(&rig, DVec3::new(3e-3, 0.0, 0.0), 8e-3);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, others);
    for _ in 0..ticks_ago {
        rig.tick_at(DVec3::Z * 3.5e-3);
    }
    rig
}

/// Throws the particles about, so fast that a tick has to be repeated, and the transition force ends in it.
fn throw(rig: &mut Rig) {
    let nodes = rig.model.body().as_hybrid().unwrap().node_count();
    for (number, v) in rig.state.mechanical.v.iter_mut().enumerate().skip(nodes) {
        let phase = number as f64;
        *v = DVec3::new((0.7 * phase).sin(), (1.9 * phase).cos(), (2.3 * phase).sin()) * 8.0;
    }
}

/// The oracle of a repetition is a tick that was taken in as many substeps at once.
#[test]
fn a_tick_that_is_repeated_is_as_if_it_had_been_taken_in_its_substeps_at_once() {
    for ticks_ago in [0, 1, 4] {
        let mut repeated = switched(ticks_ago);
        throw(&mut repeated);
        let report = repeated.tick_at(DVec3::Z * 3.5e-3);
        assert!(report.repeated > 0 && report.quarantined.is_none(), "{report:?}");
        let mut at_once = switched(ticks_ago);
        throw(&mut at_once);
        at_once.state.pace.substeps = report.substeps;
        let other = at_once.tick_at(DVec3::Z * 3.5e-3);
        assert_eq!((other.repeated, other.substeps), (0, report.substeps));
        assert_eq!(repeated.state.mechanical.x, at_once.state.mechanical.x, "{ticks_ago}");
        assert_eq!(repeated.state.mechanical.v, at_once.state.mechanical.v, "{ticks_ago}");
        assert_eq!(repeated.state.mechanical.ledger, at_once.state.mechanical.ledger, "{ticks_ago}");
        assert_eq!(repeated.state.body.as_hybrid(), at_once.state.body.as_hybrid(), "{ticks_ago}");
    }
}

/// Returns a vertex of the upper face.
fn top(rig: &Rig) -> u32 {
    let rest_m = rig.model.surface_rest_positions_m();
    (0..rest_m.len() as u32).max_by(|a, b| rest_m[*a as usize].z.total_cmp(&rest_m[*b as usize].z)).unwrap()
}

/// With prestrain and a transition force that what is not finite would have spoilt.
#[test]
fn what_is_quarantined_is_finite_and_can_be_saved() {
    for ticks_ago in [0, 1, 4] {
        for force_n in [DVec3::Z * 1e300, DVec3::NEG_X * f64::MAX] {
            let mut rig = switched(ticks_ago);
            let good = rig.state.clone();
            let mut drive = rig.still();
            drive.point_forces.push(PointForce { node: top(&rig), force_n });
            let report = rig.tick(&drive);
            assert!(report.quarantined.is_some(), "{ticks_ago} {force_n}");
            assert_eq!(rig.state.mechanical.x, good.mechanical.x);
            let back = snapshot::restore(&rig.model, &snapshot::save(&rig.model, &rig.state));
            assert_eq!(back.unwrap(), rig.state, "{ticks_ago} {force_n}");
        }
    }
}

#[test]
fn a_snapshot_of_another_hybrid_body_is_refused() {
    let rig = switched(1);
    let bytes = snapshot::save(&rig.model, &rig.state);
    assert_eq!(snapshot::restore(&rig.model, &bytes).unwrap(), rig.state);
    let mut spec = pressed_block(Precision::Double, None);
    solid_mut(&mut spec).regions[0].density_kg_per_m3 *= 1.0 + 1e-15;
    assert_eq!(snapshot::restore(&Rig::new(spec).model, &bytes), Err(SnapshotError::OtherBody));
}

/// Buffers in which other particles were woken by hand do not pass on what that demanded.
#[test]
fn buffers_of_another_state_leave_nothing_behind() {
    let mut own = switched(1);
    let mut other = switched(0);
    other.state = own.state.clone();
    let mut fresh = switched(1);
    fresh.scratch = Scratch::new(&fresh.model);
    for rig in [&mut own, &mut other, &mut fresh] {
        (0..5).for_each(|_| _ = rig.tick_at(DVec3::Z * 3.5e-3));
    }
    let hash = |rig: &Rig| snapshot::state_hash(&rig.state);
    assert_eq!([hash(&other), hash(&fresh)], [hash(&own); 2]);
}

/// What was not finite in a quarantined body stays in no buffer: the same presses with buffers of their own have the same bits, with more
/// particles awake and with fewer.
#[test]
fn a_body_that_was_broken_and_reset_is_as_good_as_new() {
    let press = |rig: &mut Rig, x_m: f64, radius_m: f64| {
        let awake = near(rig, DVec3::new(x_m, 0.0, 0.0), radius_m);
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
        for tick in 0..20 {
            let report = rig.tick_at(DVec3::Z * (6e-3 - 1e-4 * f64::from(tick)));
            assert!(report.quarantined.is_none(), "{x_m} {radius_m} {tick}");
        }
    };
    let block = |precision: Precision, viscosity_pa_s: f64| {
        let mut spec = pressed_block(precision, None);
        solid_mut(&mut spec).regions[0].material.viscosity = Viscosity::new(viscosity_pa_s, 0.0).unwrap();
        Rig::new(spec)
    };
    for (broken_radius_m, precision, viscosity_pa_s) in
        [(5e-3, Precision::Double, 0.0), (8e-3, Precision::Single, 0.3), (11e-3, Precision::Double, 0.3)]
    {
        let (mut rig, mut fresh) = (block(precision, viscosity_pa_s), block(precision, viscosity_pa_s));
        press(&mut rig, 0.0, broken_radius_m);
        let mut drive = rig.still();
        drive.point_forces.push(PointForce { node: top(&rig), force_n: DVec3::Z * 1e300 });
        assert!(rig.tick(&drive).quarantined.is_some());
        rig.state.reset(&rig.model);
        // Fewer particles first: more would write over what is left.
        for radius_m in [4e-3, 5e-3, 6e-3, 7e-3, 8e-3, 9e-3, 10e-3, 11e-3, 5e-3] {
            for x_m in [0.0, 2e-3, -3e-3] {
                press(&mut rig, x_m, radius_m);
                press(&mut fresh, x_m, radius_m);
                let same = snapshot::state_hash(&rig.state) == snapshot::state_hash(&fresh.state);
                assert!(same, "{broken_radius_m} {x_m} {radius_m}");
            }
        }
    }
}
