//! Snapshots: bit-exact continuation, typed refusals, and no panic whatever the bytes.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    ModelSpec,
    contact::Coupling,
    material::{Law, Viscosity},
    snapshot::{SnapshotError, restore, save, state_hash},
};
use proptest::prelude::*;
use rig::{Rig, body, bricks, even, hold, material, nodes_where, solid_mut, sphere};

fn spec() -> ModelSpec {
    let side = even(-0.02, 0.02, 4);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 2));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.4));
    solid_mut(&mut spec).regions[0].material.viscosity = Viscosity { phi_pa_s: 0.1, psi_pa_s: 0.1 };
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    let coupling = Coupling::Spring { stiffness_n_per_m: 200.0, damping_n_s_per_m: 1.0, mass_kg: 0.02 };
    spec.tools = vec![sphere(0.008, DVec3::new(0.0, 0.0, 0.0085), coupling)];
    spec.tools[0].friction_coefficient = 0.4;
    spec
}

fn run(rig: &mut Rig, ticks: std::ops::Range<u32>) {
    for tick in ticks {
        let t = f64::from(tick) * 1e-3;
        rig.tick_at(DVec3::new(0.004 * (40.0 * t).sin(), 0.0, 0.0085 - 0.05 * t.min(0.06)));
    }
}

fn rubbing() -> Rig {
    let mut rig = Rig::new(spec());
    run(&mut rig, 0..70);
    assert!(rig.state.mechanical.tools[0].contacts > 0 && rig.state.mechanical.tools[0].friction_heat_j > 0.0);
    rig
}

#[test]
fn a_restored_run_continues_with_the_same_bits() {
    let mut first = rubbing();
    let bytes = save(&first.model, &first.state);
    run(&mut first, 70..170);
    // In a new process: another model object, another scratch.
    let mut second = Rig::new(spec());
    second.state = restore(&second.model, &bytes).unwrap();
    run(&mut second, 70..170);
    assert_eq!(state_hash(&first.state), state_hash(&second.state));
    assert_eq!(first.state, second.state);
    // Back in time in the same scratch.
    first.state = restore(&first.model, &bytes).unwrap();
    run(&mut first, 70..170);
    assert_eq!(first.state, second.state);
}

#[test]
fn friction_and_stiffness_memory_are_part_of_it() {
    // Without them the run goes elsewhere: what `reset` forgets, a snapshot must not.
    let rig = rubbing();
    let mut plain = rig.state.clone();
    let back = restore(&rig.model, &save(&rig.model, &rig.state)).unwrap();
    assert_eq!(back.mechanical.contact, rig.state.mechanical.contact);
    plain.mechanical.contact = rig.model.contact().state();
    assert_ne!(plain.mechanical.contact, rig.state.mechanical.contact);
    let mut with = Rig { state: back, ..Rig::new(spec()) };
    let mut without = Rig { state: plain, ..Rig::new(spec()) };
    run(&mut with, 70..100);
    run(&mut without, 70..100);
    assert_ne!(state_hash(&with.state), state_hash(&without.state));
}

#[test]
fn another_model_is_refused_whatever_differs() {
    let rig = rubbing();
    let bytes = save(&rig.model, &rig.state);
    let changes: [fn(&mut ModelSpec); 7] = [
        |s| solid_mut(s).regions[0].density_kg_per_m3 = 1001.0,
        |s| solid_mut(s).regions[0].material.lame.mu_pa *= 1.0 + 1e-15,
        |s| s.tools[0].friction_coefficient = 0.41,
        |s| s.tools[0].radius_m = 0.009,
        |s| s.settings.step_safety = 0.8,
        |s| s.gravity_m_per_s2.x = 1e-300,
        |s| s.prescribed[0].nodes.truncate(1),
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let mut other = spec();
        change(&mut other);
        assert_eq!(restore(&Rig::new(other).model, &bytes), Err(SnapshotError::OtherBody), "change {index}");
    }
}

#[test]
fn each_defect_has_its_own_error() {
    let rig = rubbing();
    let good = save(&rig.model, &rig.state);
    let broken = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = good.clone();
        change(&mut bytes);
        restore(&rig.model, &bytes).unwrap_err()
    };
    assert!(matches!(broken(&|b| b[0] = b'X'), SnapshotError::NoSnapshot { .. }));
    assert!(matches!(broken(&|b| b.truncate(10)), SnapshotError::NoSnapshot { bytes: 10 }));
    assert!(matches!(broken(&|b| b.clear()), SnapshotError::NoSnapshot { bytes: 0 }));
    assert_eq!(broken(&|b| b[4] = 99), SnapshotError::Version { found: 99 });
    assert_eq!(broken(&|b| b[8] ^= 1), SnapshotError::OtherBody);
    assert!(matches!(broken(&|b| b.truncate(b.len() - 1)), SnapshotError::Damaged { .. }));
    assert!(matches!(broken(&|b| b.push(0)), SnapshotError::Damaged { .. }));
    let last = good.len() - 1;
    assert!(matches!(broken(&|b| b[last] ^= 1), SnapshotError::Damaged { .. }));
}

#[test]
fn a_number_that_is_not_finite_is_refused_wherever_it_is() {
    let rig = rubbing();
    let changes: [fn(&mut palpate_physics::State); 6] = [
        |s| s.mechanical.x[3].y = f64::NAN,
        |s| s.mechanical.force_n[0].x = f64::INFINITY,
        |s| s.mechanical.ledger.external_work_j = f64::NAN,
        |s| s.mechanical.tools[0].target.position_m.z = f64::NAN,
        |s| s.mechanical.tools[0].friction_heat_j = f64::NEG_INFINITY,
        |s| s.mechanical.viscous.before_w = f64::NAN,
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let mut state = rig.state.clone();
        change(&mut state);
        let bytes = save(&rig.model, &state);
        assert!(matches!(restore(&rig.model, &bytes), Err(SnapshotError::Damaged { .. })), "change {index}");
    }
}

/// FNV-1a of the body of a snapshot, as `save` writes it: damaged bytes behind a valid checksum must not panic either.
fn with_valid_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    if bytes.len() >= 24 {
        let hash = bytes[24..]
            .iter()
            .fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(*b)).wrapping_mul(0x100_0000_01b3));
        bytes[16..24].copy_from_slice(&hash.to_le_bytes());
    }
    bytes
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(64) })]

    #[test]
    fn no_bytes_panic(junk in prop::collection::vec(any::<u8>(), 0..400), at in any::<prop::sample::Index>(), flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..20)) {
        let rig = rubbing();
        let good = save(&rig.model, &rig.state);
        prop_assert!(restore(&rig.model, &junk).is_err());
        prop_assert!(restore(&rig.model, &good[..at.index(good.len())]).is_err());
        // A header that is right, and a body that is not.
        let mut spliced = good[..24].to_vec();
        spliced.extend_from_slice(&junk);
        prop_assert!(restore(&rig.model, &with_valid_checksum(spliced)).is_err());
        let mut flipped = good.clone();
        for (index, value) in flips {
            let index = 24 + index.index(good.len() - 24);
            flipped[index] = value;
        }
        // It may still be a state: then it can be stepped.
        if let Ok(state) = restore(&rig.model, &with_valid_checksum(flipped)) {
            let mut survivor = Rig { state, ..rubbing() };
            run(&mut survivor, 70..72);
            let cut = &good[..24 + at.index(good.len() - 24)];
            prop_assert!(restore(&rig.model, &with_valid_checksum(cut.to_vec())).is_err());
        }
    }
}
