//! Particles of hybrid bodies that wake and fall asleep while the body moves and is pressed.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, Precision, Scratch, bodies::hybrid::Waking, contact::Coupling, snapshot, world::wake_only,
};
use rig::{Rig, held_below, hybrid_block, near, particles_mut, pressed_block, sphere};

/// Cells of one size, and beneath the first layer of two.
const SIZES: [Option<f64>; 2] = [None, Some(2.5e-3)];

/// A tool that wakes particles and is to slide.
fn about_to_slide(distant_contact: bool, fine_depth_m: Option<f64>) -> Rig {
    let mut spec = pressed_block(Precision::Double, fine_depth_m);
    let particles = particles_mut(&mut spec);
    particles.waking = Waking::ByTools { reach_m: 8e-3 };
    particles.most_active = 250;
    spec.settings.skips.distant_contact = distant_contact;
    Rig::new(spec)
}

/// A tick of it; whether other particles are awake after it.
fn slide(rig: &mut Rig) -> bool {
    let (t, before) = (rig.state.mechanical.tick as f64 * 1e-3, rig.state.body.active_particles().to_vec());
    rig.tick_at(DVec3::new(6e-3 * (5.0 * t).sin(), 3e-3 * (7.0 * t).sin(), 6e-3 - 2e-3 * (t / 0.2).min(1.0)));
    rig.state.body.active_particles() != before
}

/// In a dent many vertices are as near to the tool's centre, and which is nearest changes with the particles that are
/// awake: what is awake may not.
#[test]
fn beneath_a_tool_that_stands_still_the_same_particles_stay_awake() {
    for (across_m, depth_m) in [(0.0, 2e-3), (0.0, 3e-3), (0.125e-3, 2e-3), (0.375e-3, 2e-3), (0.625e-3, 2e-3)] {
        let mut spec = held_below(hybrid_block((0.02, 1, 8), 0.45, 400, Waking::ByTools { reach_m: 11e-3 }));
        spec.settings.mass_damping_per_s = 40.0;
        spec.tools = vec![sphere(6e-3, DVec3::Z * 9e-3, Coupling::Rigid)];
        let mut rig = Rig::new(spec);
        let mut switches = 0;
        for tick in 0..1500_u32 {
            let before = rig.state.body.active_particles().to_vec();
            let depth_m = depth_m * f64::from(tick.min(300)) / 300.0;
            rig.tick_at(DVec3::new(across_m, 0.75 * across_m, 6e-3 - depth_m));
            switches += u32::from(tick > 1000 && rig.state.body.active_particles() != before);
        }
        assert_eq!(switches, 0, "{across_m} {depth_m}");
    }
}

/// The patch that a switch goes over to is made in ticks before it, beside the state: without it a state goes on no
/// differently, wherever it was saved.
#[test]
fn what_is_saved_while_a_switch_is_coming_goes_on_with_the_same_bits() {
    for fine_depth_m in SIZES {
        save_and_go_on(about_to_slide(true, fine_depth_m));
    }
}

fn save_and_go_on(mut rig: Rig) {
    (0..300).for_each(|_| _ = slide(&mut rig));
    let mut switched = None;
    let mut states = Vec::new();
    // To the first switch that has come as a whole since, and on from there.
    while switched.is_none_or(|at| states.len() < at + 20) {
        let has_switched = slide(&mut rig);
        if has_switched && states.len() > 12 {
            switched = switched.or(Some(states.len()));
        }
        states.push(rig.state.clone());
    }
    let switched = switched.unwrap();
    for start in switched - 12..switched + 3 {
        let bytes = snapshot::save(&rig.model, &states[start]);
        rig.state = snapshot::restore(&rig.model, &bytes).unwrap();
        rig.scratch = Scratch::new(&rig.model);
        for expected in &states[start + 1..] {
            slide(&mut rig);
            assert_eq!(snapshot::state_hash(&rig.state), snapshot::state_hash(expected), "from {start} of {switched}");
        }
    }
}

/// Contact goes on with what it knew of the skin where particles wake and fall asleep beneath a sliding tool, and
/// misses nothing.
#[test]
fn switches_are_followed_by_contact_as_if_it_looked_at_all_triangles() {
    let run = |distant_contact: bool, fine_depth_m: Option<f64>| {
        let mut rig = about_to_slide(distant_contact, fine_depth_m);
        let sets = (0..1500).filter(|_| slide(&mut rig)).count();
        (sets, rig.state.mechanical.x)
    };
    for fine_depth_m in SIZES {
        let (sets, x) = run(true, fine_depth_m);
        assert!(sets > 10, "{sets}");
        assert_eq!((sets, x), run(false, fine_depth_m));
    }
}

/// A tool passes a turning, trembling body in free flight and touches nothing.
#[test]
fn momenta_stay_while_particles_wake_and_sleep_in_free_flight() {
    for fine_depth_m in SIZES {
        pass_by(fine_depth_m);
    }
}

fn pass_by(fine_depth_m: Option<f64>) {
    let mut spec = hybrid_block((0.02, 1, 8), 0.45, 400, Waking::ByTools { reach_m: 8e-3 });
    particles_mut(&mut spec).fine_depth_m = fine_depth_m;
    spec.tools = vec![sphere(6e-3, DVec3::new(-60e-3, 0.0, 7.2e-3), Coupling::Rigid)];
    let mut rig = Rig::new(spec);
    for (x, v) in rig.state.mechanical.x.iter().zip(&mut rig.state.mechanical.v) {
        *v = DVec3::new(0.0, 0.02, -0.01) + DVec3::new(0.1, 0.3, 0.2).cross(*x) + DVec3::new(x.z, x.x, -x.y) * 3.0;
    }
    let (linear, angular) =
        rig.model.body().as_hybrid().unwrap().momentum(rig.state.body.as_hybrid().unwrap(), &rig.state.mechanical);
    let (mut sets, mut before) = (0, vec![]);
    for tick in 0..800 {
        let x = -60e-3 + 120e-3 * f64::from(tick) / 600.0;
        rig.tick_at(DVec3::new(x.min(60e-3), 2e-5 * f64::from(tick), 14e-3));
        assert_eq!(rig.state.mechanical.tools[0].contacts, 0);
        if rig.state.body.active_particles() != before {
            sets += 1;
            before = rig.state.body.active_particles().to_vec();
        }
    }
    assert!(sets > 8, "{sets} sets");
    let (p, l) =
        rig.model.body().as_hybrid().unwrap().momentum(rig.state.body.as_hybrid().unwrap(), &rig.state.mechanical);
    let changed = |a: DVec3, b: DVec3| (a - b).length() / b.length();
    println!("{sets} sets: {:.1e} {:.1e}", changed(p, linear), changed(l, angular));
    assert!((p - linear).length() < 1e-12 * linear.length(), "{p} {linear}");
    assert!((l - angular).length() < 1e-12 * angular.length(), "{l} {angular}");
}

/// A sphere that has been pressed 2.5 mm deep, and the particles awake beneath it.
fn pressed_deep(fine_depth_m: Option<f64>) -> (Rig, Vec<u32>) {
    let mut rig = Rig::new(pressed_block(Precision::Double, fine_depth_m));
    let touched = near(&rig, DVec3::ZERO, 8e-3);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, touched.iter().copied());
    for tick in 0..400 {
        rig.tick_at(DVec3::Z * (6e-3 - 2.5e-3 * f64::from(tick.min(200)) / 200.0));
    }
    (rig, touched)
}

/// Beside a sphere that presses, and moves a little, a region is switched on and off a hundred times a second.
#[test]
fn switching_a_strained_region_keeps_force_and_books_its_energy() {
    for fine_depth_m in SIZES {
        switch_strained(pressed_deep(fine_depth_m));
    }
}

fn switch_strained((mut rig, touched): (Rig, Vec<u32>)) {
    let beside: Vec<u32> = near(&rig, DVec3::X * 5e-3, 8e-3).into_iter().chain(touched.iter().copied()).collect();
    let start = Energies::of(&rig.model, &rig.state);
    let (mut worst_step, mut worst_residual, mut worst_jump) = (0.0_f64, 0.0_f64, f64::NEG_INFINITY);
    for number in 0..100_u32 {
        let awake = if number.is_multiple_of(2) { &beside } else { &touched };
        let before = Energies::of(&rig.model, &rig.state);
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake.iter().copied());
        let after = Energies::of(&rig.model, &rig.state);
        worst_residual = worst_residual.max((after.balance_j() - before.balance_j()).abs() / before.elastic_j);
        worst_jump = worst_jump.max((after.held_j() - before.held_j()) / before.elastic_j);
        for tick in 0..5 {
            let force_n = rig.state.mechanical.tools[0].contact_force_n;
            rig.tick_at(DVec3::Z * (3.5e-3 + 1e-4 * (f64::from(5 * number + tick) * 0.02).sin()));
            let now_n = rig.state.mechanical.tools[0].contact_force_n;
            worst_step = worst_step.max(now_n.distance(force_n) / force_n.length());
        }
    }
    let end = Energies::of(&rig.model, &rig.state);
    let drift = (end.balance_j() - start.balance_j()) / start.elastic_j;
    println!(
        "switching: ledger {worst_residual:.1e} at a switch, {drift:.1e} over all; energy {worst_jump:.1e}, force {worst_step:.1e}"
    );
    assert!(drift.abs() < 2e-2, "{drift:e}");
    assert!(worst_residual < 1e-9, "{worst_residual:e}");
    assert!(worst_jump < 1e-9, "{worst_jump:e}");
    assert!(worst_step < 1e-2, "{worst_step:e}");
}

/// A region beneath a sphere that presses is switched in every tick, which nothing but this does: what the decay of
/// prestrain and transition force gives is limited.
#[test]
fn switching_in_every_tick_shakes_a_body_but_little() {
    for fine_depth_m in SIZES {
        switch_always(pressed_deep(fine_depth_m));
    }
}

fn switch_always((mut rig, touched): (Rig, Vec<u32>)) {
    let beside = near(&rig, DVec3::X * 5e-3, 8e-3);
    let elastic_j = Energies::of(&rig.model, &rig.state).elastic_j;
    let mut most_j = 0.0_f64;
    for tick in 0..1000_u32 {
        let awake = if tick.is_multiple_of(2) { &beside } else { &touched };
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake.iter().copied());
        let report = rig.tick_at(DVec3::Z * 3.5e-3);
        assert!(report.quarantined.is_none(), "{tick}: {:?}", report.quarantined);
        most_j = most_j.max(Energies::of(&rig.model, &rig.state).kinetic_j);
    }
    assert!(most_j < 0.1 * elastic_j, "{most_j:e} {elastic_j:e}");
}

/// All particles beneath a sphere that already presses wake at once: it feels them come within some hundredths of a
/// second.
#[test]
fn waking_beneath_the_tool_is_not_felt_as_a_step() {
    let mut rig = Rig::new(pressed_block(Precision::Double, None));
    for tick in 0..500 {
        rig.tick_at(DVec3::Z * (6e-3 - 1.5e-3 * f64::from(tick.min(200)) / 200.0));
    }
    let coarse_n = rig.state.mechanical.tools[0].contact_force_n.z;
    let touched = near(&rig, DVec3::ZERO, 10e-3);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, touched);
    let mut worst = 0.0_f64;
    for _ in 0..300 {
        let before_n = rig.state.mechanical.tools[0].contact_force_n;
        rig.tick_at(DVec3::Z * 4.5e-3);
        worst = worst.max(rig.state.mechanical.tools[0].contact_force_n.distance(before_n) / before_n.length());
    }
    let fine_n = rig.state.mechanical.tools[0].contact_force_n.z;
    println!("waking beneath: {coarse_n:.3} to {fine_n:.3} N, at most {worst:.1e} in a tick");
    assert!(fine_n < 0.8 * coarse_n && worst < 0.05, "{coarse_n} {fine_n} {worst}");
}

/// A tool touches skin whose particles sleep, where coarse tets are turned inside out in part. What woke there with the
/// energy of a crushed volume drove the body through the tool.
#[test]
fn what_sleeps_in_crushed_parts_of_tets_does_not_wake_with_energy_from_nowhere() {
    let mut woken = 0;
    for (number, push_m) in [0.0, 2e-3, 4e-3, 6e-3, 8e-3].into_iter().enumerate() {
        let mut spec = held_below(hybrid_block((0.02, 2, 8), 0.45, 400, Waking::ByTools { reach_m: 8e-3 }));
        spec.tools = vec![sphere(6e-3, DVec3::Z * (6.2e-3 - push_m), Coupling::Rigid)];
        let mut rig = Rig::new(spec);
        let rest = rig.model.rest_positions_m().to_vec();
        for (x, rest) in rig.state.mechanical.x.iter_mut().zip(&rest) {
            // Beneath the tool, one node is pushed down towards the one below it, and aside.
            if rest.z > -1e-3 && rest.truncate().length() < 1e-3 {
                *x += DVec3::new(0.4, 0.1, -1.0) * push_m;
            }
        }
        let elastic_j = Energies::of(&rig.model, &rig.state).elastic_j;
        rig.tick_at(DVec3::Z * (5.9e-3 - push_m));
        let awake = rig.state.body.active_particles().len();
        let dissipated_j = rig.state.mechanical.ledger.dissipated_j;
        println!("{push_m}: {awake} awake, {elastic_j:.3e} J, {dissipated_j:.3e} J");
        woken += usize::from(awake > 0);
        assert!(dissipated_j > -0.02 * elastic_j, "{number}");
    }
    assert!(woken > 1);
}

/// Particles that wake beneath a tool which strikes flee it. What keeps accelerations from jumping where they wake may not go on
/// pushing them: in a ventricle it gave twice what the tool did, and drove particles to 20 m/s.
#[test]
fn what_wakes_in_an_impact_is_not_driven_on() {
    for fine_depth_m in SIZES {
        let mut spec = pressed_block(Precision::Double, fine_depth_m);
        spec.gravity_m_per_s2 = DVec3::ZERO;
        let start_m = spec.tools[0].start_position_m;
        let mut rig = Rig::new(spec);
        let (mut most_given, mut woke_at) = (0.0_f64, None);
        for tick in 0..40_u32 {
            rig.tick_at(start_m - DVec3::Z * (1.2e-3 * f64::from(tick)).min(6e-3));
            let tool = &rig.state.mechanical.tools[0];
            if tool.contact_force_n.z > 0.1 && woke_at.is_none() {
                let beneath = near(&rig, DVec3::ZERO, 8e-3);
                wake_only(&rig.model, &mut rig.state, &mut rig.scratch, beneath);
                woke_at = Some(tick);
            }
            let energies = Energies::of(&rig.model, &rig.state);
            most_given = most_given.max(-energies.dissipated_j / energies.external_work_j.max(1e-6));
        }
        println!("woke in tick {woke_at:?}: gave {most_given:.3} of the tool's work");
        assert!(most_given < 0.02, "{most_given}");
    }
}
