//! Walls of one body that meet.
//!
//! A ventricle's near wall, pressed by a tool, used to pass through its far wall: contact knew tools and no walls. So
//! did the arms of a clamp, and two parts of one body.
#![allow(clippy::unwrap_used)]
use crate::rig;
use crate::walls;
use glam::DVec3;
use palpate_physics::{
    Energies, SelfContactChoice, Substeps,
    snapshot::{restore, save, state_hash},
};
use rig::{Drive, Rig, mesh_of};
use walls::{clamp, facing_nodes, gripped_clamp, hybrid_clamp, least_height_m, squeeze_hybrid, two_blocks};

/// A free clamp whose arms are thrown together.
fn thrown(m_per_s: f64, substeps: Substeps) -> Rig {
    let mut spec = clamp(SelfContactChoice::WhereFacing);
    spec.settings.substeps = substeps;
    let mut rig = Rig::new(spec);
    let rest = mesh_of(&rig.spec).positions_m().to_vec();
    for (v, p) in rig.state.mechanical.v.iter_mut().zip(rest) {
        let along = ((p.x - 0.012) / 0.036).max(0.0);
        // Some swing besides, so that no symmetry hides a torque.
        *v = DVec3::new(0.01 * p.z / 0.01, 0.01 * p.z / 0.01, -m_per_s * along * p.z.signum() + 0.05);
    }
    rig
}

/// Linear and angular momentum.
fn momenta(rig: &Rig) -> (DVec3, DVec3) {
    let (state, mass_kg) = (&rig.state.mechanical, rig.model.body().mass_kg());
    let each = state.x.iter().zip(&state.v).zip(mass_kg).map(|((x, v), m)| (*x, *v * *m));
    each.fold((DVec3::ZERO, DVec3::ZERO), |(linear, angular), (x, p)| (linear + p, angular + x.cross(p)))
}

/// At 1 m/s they meet, hold each other off, and part. Nothing is held: contact may change no momentum.
#[test]
fn arms_that_are_thrown_together_meet_and_part() {
    let mut rig = thrown(1.0, Substeps::Measured);
    let pairs = facing_nodes(mesh_of(&rig.spec));
    assert!(pairs.len() > 20);
    let (linear, angular) = momenta(&rig);
    let scale = rig.model.body().mass_kg().iter().sum::<f64>();
    let (mut met, mut least_m, mut gap_m, mut stored_j, mut parted) = (0, f64::INFINITY, 0.0_f64, 0.0_f64, false);
    for _ in 0..120 {
        let report = rig.tick(&rig.still());
        assert!(report.quarantined.is_none());
        let walls = rig.scratch.meeting_walls();
        met += u32::from(walls.vertices > 0);
        stored_j = stored_j.max(walls.energy_j);
        gap_m = gap_m.min(walls.least_gap_m);
        least_m = least_m.min(least_height_m(&rig, &pairs));
        parted |= met > 0 && walls.vertices == 0;
        assert_eq!(walls.missed, 0);
    }
    let (linear_now, angular_now) = momenta(&rig);
    println!("met in {met} ticks, least height {:.2}, gap {:.2} mm, {stored_j:.2e} J", 1e3 * least_m, 1e3 * gap_m);
    println!("momentum {:.1e}, angular {:.1e}", (linear_now - linear).length(), (angular_now - angular).length());
    assert!(met > 3 && parted && stored_j > 1e-5, "{met} {parted} {stored_j:e}");
    assert!(least_m > -3e-4 && gap_m > -3e-4, "an arm passed through the other: {least_m} {gap_m}");
    assert!(least_height_m(&rig, &pairs) > 1e-3, "they are apart again");
    assert!((linear_now - linear).length() < 1e-12 * scale);
    assert!((angular_now - angular).length() < 1e-13 * scale);
}

/// What the body holds beside the ledger stays, up to leapfrog's error and what the potential jumps by where vertices pass
/// from one corner of a rim to the next.
#[test]
fn the_books_are_closed_while_walls_meet() {
    for substeps in [20, 80] {
        let mut rig = thrown(0.6, Substeps::Fixed(substeps));
        let start_j = Energies::of(&rig.model, &rig.state).held_j();
        let (mut worst, mut met, mut stored) = (0.0_f64, 0, 0.0_f64);
        for _ in 0..60 {
            rig.tick(&rig.still());
            let energies = Energies::of(&rig.model, &rig.state);
            met += u32::from(rig.scratch.meeting_walls().vertices > 0);
            stored = stored.max(rig.scratch.meeting_walls().energy_j / start_j);
            worst = worst.max((energies.balance_j() / start_j - 1.0).abs());
            // What walls take from the body they keep: no work is done from outside.
            worst = worst.max((energies.held_j() / start_j - 1.0).abs());
        }
        println!("{substeps} substeps: the books miss {worst:.2e} of the energy, of which walls stored {stored:.2e}");
        assert!(met > 3 && stored > 0.03 && worst < 2e-3, "{met} {stored:e} {worst:e}");
    }
}

/// Two equal blocks, one pressed on the other, weigh the same at both grips, and nothing at rest. A block of twice the
/// thickness pressed to the same strain answers with the same force, less what the contact gives.
#[test]
fn two_blocks_are_felt_alike_at_both_grips() {
    let mut rig = Rig::new(two_blocks());
    let pairs = facing_nodes(mesh_of(&rig.spec));
    let down = |depth_m: f64, rig: &Rig| Drive { prescribed: vec![DVec3::ZERO, DVec3::Z * -depth_m], ..rig.still() };
    let grip = |rig: &Rig, set: usize| {
        let nodes = &rig.model.prescribed()[set].nodes;
        nodes.iter().map(|&n| rig.scratch.reactions_n()[n as usize]).sum::<DVec3>()
    };
    for _ in 0..5 {
        rig.tick(&down(0.0, &rig));
        assert_eq!([grip(&rig, 0), grip(&rig, 1)], [DVec3::ZERO; 2]);
    }
    let mut depth_m = 0.0;
    while depth_m < 7e-3 {
        depth_m += 5e-5;
        rig.tick(&down(depth_m, &rig));
    }
    for _ in 0..400 {
        rig.tick(&down(depth_m, &rig));
    }
    let (below, above, walls) = (grip(&rig, 0), grip(&rig, 1), rig.scratch.meeting_walls());
    println!("{below} N and {above} N, {walls:?}");
    assert!(below.z > 0.1 && (below + above).length() < 2e-3 * below.z, "{below} {above}");
    // 3 mm of strain in 24 mm of height, bonded at both grips: more than E A ε, and less than (λ + 2µ) A ε.
    let (area_m2, strain) = (0.024 * 0.024, (depth_m - 4e-3) / 0.024);
    assert!(below.z > 10e3 * area_m2 * strain && below.z < 21.4e3 * area_m2 * strain, "{}", below.z);
    assert!(least_height_m(&rig, &pairs) > -1e-3, "they overlap by no more than the contact gives");
    while depth_m > 0.0 {
        depth_m -= 5e-5;
        rig.tick(&down(depth_m.max(0.0), &rig));
    }
    for _ in 0..400 {
        rig.tick(&down(0.0, &rig));
    }
    assert_eq!(rig.scratch.meeting_walls().vertices, 0);
    assert!((least_height_m(&rig, &pairs) - 2.0 * walls::HALF_GAP_M).abs() < 1e-4, "they are apart again");
}

/// Drives the grips of a clamp together by `most_m` each and back.
fn squeeze(rig: &mut Rig, most_m: f64, ticks: std::ops::Range<u32>) {
    for tick in ticks {
        let depth_m = most_m * (std::f64::consts::PI * (f64::from(tick) / 200.0).min(1.0)).sin();
        let drive = Drive { prescribed: vec![DVec3::ZERO, DVec3::Z * depth_m, DVec3::Z * -depth_m], ..rig.still() };
        assert!(rig.tick(&drive).quarantined.is_none());
    }
}

/// Before walls are near, nothing of a tick is another one for what it is told about walls.
#[test]
fn where_nothing_is_near_every_bit_is_as_without() {
    let run = |self_contact| {
        let mut rig = Rig::new(gripped_clamp(self_contact));
        squeeze(&mut rig, 1e-3, 0..300);
        assert_eq!(rig.scratch.meeting_walls().vertices, 0);
        rig.state
    };
    let [off, facing, on] = [SelfContactChoice::Off, SelfContactChoice::WhereFacing, SelfContactChoice::On].map(run);
    assert_eq!(off, facing);
    assert_eq!(state_hash(&off), state_hash(&on));
}

/// A clamp in whose grip arms are pressed together; all that a query skips is looked at in the oracle.
#[test]
fn skips_and_restored_states_change_no_bit_while_walls_meet() {
    let spec = |distant_contact: bool| {
        let mut spec = gripped_clamp(SelfContactChoice::WhereFacing);
        spec.settings.skips.distant_contact = distant_contact;
        spec
    };
    let [mut quick, mut oracle] = [true, false].map(|skip| Rig::new(spec(skip)));
    squeeze(&mut quick, 4e-3, 0..90);
    squeeze(&mut oracle, 4e-3, 0..90);
    let walls = quick.scratch.meeting_walls();
    assert!(walls.vertices > 10 && walls == oracle.scratch.meeting_walls(), "{walls:?}");
    assert_eq!(quick.state, oracle.state);
    let bytes = save(&quick.model, &quick.state);
    squeeze(&mut quick, 4e-3, 90..300);
    squeeze(&mut oracle, 4e-3, 90..300);
    assert_eq!(quick.state, oracle.state);
    assert_eq!(quick.scratch.meeting_walls().vertices, 0, "the arms are apart again");
    // Mid-contact, in a new process and back in time.
    let mut second = Rig::new(spec(true));
    for rig in [&mut second, &mut quick] {
        let after = state_hash(&oracle.state);
        rig.state = restore(&rig.model, &bytes).unwrap();
        squeeze(rig, 4e-3, 90..300);
        assert_eq!(state_hash(&rig.state), after);
    }
}

/// Ticks of too few substeps, and those in which arms hit each other, are taken back and repeated; what was listed in them
/// is not remembered.
#[test]
fn repeated_ticks_press_walls_as_if_they_were_the_first() {
    for (m_per_s, substeps) in [(0.6, Substeps::Fixed(1)), (1.0, Substeps::Fixed(2)), (2.0, Substeps::Measured)] {
        let run = |distant_contact: bool| {
            let mut spec = thrown(0.0, substeps).spec;
            spec.settings.skips.distant_contact = distant_contact;
            let mut rig = Rig { state: thrown(m_per_s, substeps).state, ..Rig::new(spec) };
            let (mut repeated, mut met) = (0, 0);
            for _ in 0..60 {
                let report = rig.tick(&rig.still());
                let walls = rig.scratch.meeting_walls();
                met += u32::from(walls.vertices > 0);
                repeated += if walls.vertices > 0 { report.repeated } else { 0 };
                assert_eq!(walls.missed, 0);
            }
            println!("{m_per_s} m/s: {repeated} repeated, met in {met} ticks");
            assert!(repeated > 0 && met > 3 && rig.state.quarantine.is_none(), "{repeated} {met}");
            rig.state
        };
        assert_eq!(run(true), run(false));
    }
}

/// The arms of a hybrid clamp, squeezed between two tools until they meet: coarse tets and awake particles carry what one
/// gives the other, both tools feel the same, nothing that a query skips changes a bit, and the arms part.
#[test]
fn arms_of_a_hybrid_clamp_meet_and_part() {
    let spec = |distant_contact: bool| {
        let mut spec = hybrid_clamp(SelfContactChoice::WhereFacing);
        spec.settings.skips.distant_contact = distant_contact;
        spec
    };
    let [mut quick, mut oracle] = [true, false].map(|skip| Rig::new(spec(skip)));
    let mut passing = Rig::new(hybrid_clamp(SelfContactChoice::Off));
    let pairs = facing_vertices(&quick);
    assert!(pairs.len() > 20);
    let (mut met, mut least_m, mut passed_m, mut bytes) = (0, f64::INFINITY, f64::INFINITY, Vec::new());
    for tick in 0..300 {
        for rig in [&mut quick, &mut oracle, &mut passing] {
            assert!(rig.tick(&squeeze_hybrid(rig, 5.5e-3, tick)).quarantined.is_none());
        }
        assert_eq!(quick.state, oracle.state, "tick {tick}");
        met += u32::from(quick.scratch.meeting_walls().vertices > 0);
        (least_m, passed_m) = (least_m.min(height_m(&quick, &pairs)), passed_m.min(height_m(&passing, &pairs)));
        if tick == 100 {
            let [below, above] = [0, 1].map(|tool| quick.state.mechanical.tools[tool].contact_force_n.z);
            println!("{below:.4} N below and {above:.4} N above, {} awake", quick.state.awake_particles());
            assert!(quick.state.awake_particles() > 20 && quick.scratch.meeting_walls().vertices > 10);
            assert!(above > 0.05 && (below + above).abs() < 0.05 * above, "{below} {above}");
            bytes = save(&quick.model, &quick.state);
        }
    }
    println!("met in {met} ticks; least height {:.2} mm, without {:.2} mm", 1e3 * least_m, 1e3 * passed_m);
    assert!(met > 30 && least_m > 0.0 && passed_m < -1e-3, "{met} {least_m} {passed_m}");
    assert_eq!(quick.scratch.meeting_walls().vertices, 0);
    let mut second = Rig::new(spec(true));
    second.state = restore(&second.model, &bytes).unwrap();
    for tick in 101..300 {
        second.tick(&squeeze_hybrid(&second, 5.5e-3, tick));
    }
    assert_eq!(state_hash(&second.state), state_hash(&quick.state));
}

/// Pairs of vertices of the arms' inner sides that are one above the other at rest.
fn facing_vertices(rig: &Rig) -> Vec<[u32; 2]> {
    let x = rig.model.surface_rest_positions_m();
    let at =
        |z: f64| (0..x.len() as u32).filter(move |&v| (x[v as usize].z - z).abs() < 1e-6 && x[v as usize].x > 0.0119);
    let over = |b: u32| at(walls::HALF_GAP_M).find(|&a| (x[a as usize] - x[b as usize]).truncate().length() < 1e-6);
    at(-walls::HALF_GAP_M).filter_map(|b| over(b).map(|a| [b, a])).collect()
}

/// The least height (m) of a vertex over the one that is below it at rest.
fn height_m(rig: &Rig, pairs: &[[u32; 2]]) -> f64 {
    let mut x = Vec::new();
    rig.model.surface_positions_m(&rig.state, &mut x);
    pairs.iter().map(|&[b, a]| x[a as usize].z - x[b as usize].z).fold(f64::INFINITY, f64::min)
}

/// The books are closed on a hybrid body, too: what comes and goes between tools, walls and body balances.
#[test]
fn the_books_of_a_hybrid_are_closed_while_walls_meet() {
    let mut rig = Rig::new(hybrid_clamp(SelfContactChoice::WhereFacing));
    let (mut worst_j, mut most_j, mut stored_j) = (0.0_f64, 0.0_f64, 0.0_f64);
    for tick in 0..250 {
        rig.tick(&squeeze_hybrid(&rig, 5.5e-3, tick));
        let energies = Energies::of(&rig.model, &rig.state);
        worst_j = worst_j.max(energies.balance_j().abs());
        most_j = most_j.max(energies.external_work_j);
        stored_j = stored_j.max(rig.scratch.meeting_walls().energy_j);
    }
    println!("the books miss {worst_j:.2e} J of {most_j:.2e} J, walls stored {stored_j:.2e} J");
    assert!(stored_j > 1e-6 && worst_j < 2e-3 * most_j, "{worst_j:e} {most_j:e} {stored_j:e}");
}
