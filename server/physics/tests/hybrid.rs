//! Bodies with particles, tick by tick.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, ModelSpec, Precision, Settings, Substeps, bodies::hybrid::Waking, contact::Coupling, snapshot,
    world::wake_only,
};
use rig::{Rig, at, held_below, hybrid_block, near, particles_mut, pressed_block, smooth, sphere};

/// 40 × 40 × 20 mm in 24 coarse tets, particles 2.5 mm apart, its lower face at z = −20 mm.
fn block(poisson_ratio: f64) -> ModelSpec {
    hybrid_block((0.02, 1, 8), poisson_ratio, 400, Waking::ByHand)
}

/// Cells of one size, and beneath the first layer of two.
const SIZES: [Option<f64>; 2] = [None, Some(2.5e-3)];

#[test]
fn free_flight_keeps_momenta_and_energy() {
    for fine_depth_m in SIZES {
        fly(fine_depth_m);
    }
}

fn fly(fine_depth_m: Option<f64>) {
    let mut spec = block(0.45);
    particles_mut(&mut spec).fine_depth_m = fine_depth_m;
    let mut rig = Rig::new(spec);
    let awake = near(&rig, DVec3::ZERO, 10e-3);
    let nodes = rig.state.mechanical.x.len();
    for (x, v) in rig.state.mechanical.x.iter().zip(&mut rig.state.mechanical.v) {
        *v = DVec3::new(0.3, 0.0, 0.0) + DVec3::new(5.0, 0.0, 20.0).cross(*x) + DVec3::new(x.z, 0.0, x.x) * 8.0;
    }
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
    assert!(rig.state.mechanical.x.len() > nodes + 70);
    let hybrid = rig.model.body().as_hybrid().unwrap();
    let (linear, angular) = hybrid.momentum(rig.state.body.as_hybrid().unwrap(), &rig.state.mechanical);
    let start = Energies::of(&rig.model, &rig.state).held_j();
    let drive = rig.still();
    for _ in 0..200 {
        rig.tick(&drive);
    }
    let hybrid = rig.model.body().as_hybrid().unwrap();
    let (p, l) = hybrid.momentum(rig.state.body.as_hybrid().unwrap(), &rig.state.mechanical);
    assert!((p - linear).length() < 1e-12 * linear.length(), "{p} {linear}");
    assert!((l - angular).length() < 1e-12 * angular.length(), "{l} {angular}");
    let end = Energies::of(&rig.model, &rig.state).held_j();
    let changed = |a: DVec3, b: DVec3| (a - b).length() / b.length();
    println!("flight: {:.1e} {:.1e} {:.1e}", changed(p, linear), changed(l, angular), end / start - 1.0);
    assert!((end / start - 1.0).abs() < 1e-3, "{start} {end}");
}

/// Particles wake beside a floor that is held, and that shakes: the body is softer there, and the work of what moves the floor is all there is.
#[test]
fn what_follows_holders_in_part_wakes_and_their_work_is_booked() {
    for mass_damping_per_s in [0.0, 30.0] {
        let mut spec = held_below(block(0.45));
        spec.settings.mass_damping_per_s = mass_damping_per_s;
        let mut rig = Rig::new(spec);
        let awake: Vec<u32> = near(&rig, DVec3::new(8e-3, 0.0, -20e-3), 10e-3);
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake.iter().copied());
        let partition = rig.model.body().as_hybrid().unwrap().partition();
        let ids = rig.state.body.active_particles();
        let floor_m = |particle: &u32| partition.particle_m(*particle).z + 20e-3;
        assert!(ids.len() > 60 && ids.iter().all(|p| floor_m(p) > 1e-3), "{} of {}", ids.len(), awake.len());
        assert!(ids.iter().any(|p| floor_m(p) < 3e-3));
        let start = Energies::of(&rig.model, &rig.state).balance_j();
        for tick in 0..400 {
            let s = f64::from(tick) * 0.1;
            let floor = DVec3::new(5e-4 * s.sin(), 0.0, 2e-4 * (1.7 * s).sin());
            let report = rig.tick(&rig::Drive { prescribed: vec![floor], ..rig.still() });
            assert!(report.quarantined.is_none());
        }
        let energies = Energies::of(&rig.model, &rig.state);
        let error = (energies.balance_j() - start).abs() / energies.external_work_j;
        assert!(error < 2e-3, "{error:e}");
    }
}

#[test]
fn a_sphere_is_pushed_back_with_the_work_it_does() {
    for fine_depth_m in SIZES {
        let block = || pressed_block(Precision::Double, fine_depth_m);
        press(Rig::new(block()));
        press(Rig::new(smooth(block())));
    }
}

fn press(mut rig: Rig) {
    let awake = near(&rig, DVec3::ZERO, 10e-3);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
    let balance = Energies::of(&rig.model, &rig.state).balance_j();
    for tick in 0..600 {
        let depth_m = 2e-3 * f64::from(tick.min(300)) / 300.0;
        rig.tick_at(DVec3::new(0.0, 1e-3 * f64::from(tick) / 600.0, 6e-3 - depth_m));
    }
    let tool = &rig.state.mechanical.tools[0];
    assert!(tool.contact_force_n.z > 0.05 && tool.contact_force_n.y < 0.0, "{}", tool.contact_force_n);
    let energies = Energies::of(&rig.model, &rig.state);
    let error = (energies.balance_j() - balance).abs() / energies.external_work_j;
    println!("ledger of a press: {error:.1e} of the work");
    assert!(error < 2e-3, "{error:e}");
}

#[test]
fn what_was_saved_goes_on_with_the_same_bits() {
    let block = || pressed_block(Precision::Single, None);
    saved_and_restored(block);
    saved_and_restored(|| smooth(block()));
}

fn saved_and_restored(block: impl Fn() -> ModelSpec) {
    let mut rig = Rig::new(block());
    let awake = near(&rig, DVec3::ZERO, 9e-3);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
    let way = |tick: u32| DVec3::Z * (6e-3 - 2e-3 * (f64::from(tick) * 0.02).sin());
    for tick in 0..100 {
        rig.tick_at(way(tick));
    }
    let bytes = snapshot::save(&rig.model, &rig.state);
    let mut other = Rig::new(block());
    other.state = snapshot::restore(&other.model, &bytes).unwrap();
    assert_eq!(other.state.body, rig.state.body);
    for tick in 100..200 {
        rig.tick_at(way(tick));
        other.tick_at(way(tick));
    }
    assert_eq!(rig.state, other.state);
    assert_eq!(snapshot::state_hash(&rig.state), snapshot::state_hash(&other.state));
}

#[test]
fn looking_only_where_the_tool_may_be_costs_no_bit() {
    let run = |distant_contact: bool, smooth_skin: bool| {
        let mut spec = pressed_block(Precision::Double, None);
        particles_mut(&mut spec).smooth_skin = smooth_skin;
        spec.settings.skips.distant_contact = distant_contact;
        let mut rig = Rig::new(spec);
        for tick in 0..400_u32 {
            if tick % 100 == 50 {
                let awake = near(&rig, DVec3::X * 1e-4 * f64::from(tick), 8e-3);
                wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
            }
            let s = f64::from(tick) * 0.02;
            rig.tick(&rig::Drive {
                tools: vec![at(DVec3::new(0.01 * s.sin(), 0.0, 6e-3 - 3e-3 * s.sin()))],
                ..rig.still()
            });
        }
        assert!(rig.state.mechanical.tools[0].contact_force_n.length() > 0.01);
        rig.state
    };
    for smooth_skin in [false, true] {
        assert_eq!(run(true, smooth_skin), run(false, smooth_skin));
    }
}

/// The compliance of trilinear cells is that of one particle on a particle, and of four between them: more than twice the force.
#[test]
fn beneath_a_smooth_skin_a_light_touch_does_not_feel_single_particles() {
    let force_n = |spec: ModelSpec, at_m: DVec3| {
        let mut rig = Rig::new(spec);
        let awake = near(&rig, DVec3::ZERO, 10e-3);
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
        for tick in 0..500 {
            let depth_m = 0.3e-3 * f64::from(tick.min(200)) / 200.0;
            rig.tick_at(at_m + DVec3::Z * (3.75e-3 - depth_m));
        }
        rig.state.mechanical.tools[0].contact_force_n.z
    };
    let block = || {
        let mut spec = pressed_block(Precision::Double, None);
        spec.gravity_m_per_s2 = DVec3::ZERO;
        spec.tools[0].radius_m = 3.75e-3;
        spec
    };
    let between_m = DVec3::new(1.25e-3, 1.25e-3, 0.0);
    let ratio = |block: &dyn Fn() -> ModelSpec| force_n(block(), between_m) / force_n(block(), DVec3::ZERO);
    let (cells, means) = (ratio(&block), ratio(&|| smooth(block())));
    println!("force between particles over force on one: {cells:.3}, on a smooth skin {means:.3}");
    assert!(cells > 1.8 && (means - 1.0).abs() < 0.25 * (cells - 1.0), "{cells} {means}");
}

/// A sphere comes from far, presses, slides and leaves. Particles wake before it touches, follow it, and sleep in the end.
#[test]
fn particles_wake_before_the_touch_follow_it_and_sleep_again() {
    let mut spec = pressed_block(Precision::Double, None);
    spec.gravity_m_per_s2 = DVec3::ZERO;
    spec.tools[0].start_position_m = DVec3::new(-5e-3, 0.0, 40e-3);
    let particles = particles_mut(&mut spec);
    particles.waking = Waking::ByTools { reach_m: 8e-3 };
    particles.most_active = 250;
    let mut rig = Rig::new(spec);
    let way = |tick: u32| {
        let t = f64::from(tick) * 1e-3;
        let x = -5e-3 + 10e-3 * (t - 0.6).clamp(0.0, 0.5) / 0.5;
        let z = if t < 0.5 { 40e-3 - 36e-3 * t / 0.5 } else { 4e-3 + 40e-3 * (t - 1.2).max(0.0) / 0.4 };
        DVec3::new(x, 0.0, z.min(60e-3))
    };
    let (mut touched_at, mut woke_at, mut most, mut force_n, mut middles) = (None, None, 0, 0.0_f64, vec![]);
    for tick in 0..3500 {
        let report = rig.tick_at(way(tick));
        assert!(report.quarantined.is_none(), "{tick}: {:?}", report.quarantined);
        let active = rig.state.body.active_particles();
        most = most.max(active.len());
        woke_at = woke_at.or((!active.is_empty()).then_some(tick));
        touched_at = touched_at.or((rig.state.mechanical.tools[0].contacts > 0).then_some(tick));
        if (500..1200).contains(&tick) {
            force_n = rig.state.mechanical.tools[0].contact_force_n.z;
            let partition = rig.model.body().as_hybrid().unwrap().partition();
            let sum: DVec3 = active.iter().map(|&p| partition.particle_m(p)).sum();
            middles.push(sum.x / active.len() as f64);
        }
    }
    let (touched_at, woke_at) = (touched_at.unwrap(), woke_at.unwrap());
    assert!(woke_at + 40 < touched_at && touched_at < 500, "{woke_at} {touched_at}");
    assert!(most > 100 && most <= 250 && force_n > 0.01, "{most} {force_n}");
    assert!(middles[0] < -3e-3 && middles[middles.len() - 1] > 1.5e-3, "{} {:?}", middles[0], middles.last());
    assert!(rig.state.body.active_particles().is_empty(), "{} still awake", rig.state.body.active_particles().len());
}

/// One step a tick, over and under the longest that is stable with any particles awake: noticed, and left alone. With a part of them awake it is a little longer.
#[test]
fn a_step_that_is_too_long_is_noticed_and_taken_back() {
    for (ratio, noticed) in [(1.4, true), (0.8, false)] {
        let mut spec = block(0.45);
        let omega = Rig::new(spec.clone()).model.body().max_natural_frequency_rad_per_s();
        spec.settings.substeps = Substeps::Fixed(1);
        spec.settings.tick_period_s = 2.0 * ratio / omega;
        let mut rig = Rig::new(spec);
        let some = near(&rig, DVec3::ZERO, 12e-3);
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, some);
        for (number, v) in rig.state.mechanical.v.iter_mut().enumerate() {
            *v = DVec3::new((number as f64 * 0.7).sin(), (number as f64 * 1.9).cos(), (number as f64 * 2.3).sin())
                * 1e-4;
        }
        for (v, inverse) in
            rig.state.mechanical.v.iter_mut().zip(rig.model.body().as_hybrid().unwrap().inverse_mass_per_kg())
        {
            *v = if *inverse == DVec3::ZERO { DVec3::ZERO } else { *v };
        }
        let (start_j, mut repeated) = (Energies::of(&rig.model, &rig.state).held_j(), 0);
        let drive = rig.still();
        for _ in 0..400 {
            let report = rig.tick(&drive);
            assert!(report.quarantined.is_none());
            repeated += report.repeated;
        }
        let end_j = Energies::of(&rig.model, &rig.state).held_j();
        assert_eq!(repeated > 0, noticed, "{ratio}: {repeated}");
        assert!(end_j < 6.0 * start_j, "{ratio}: {start_j:e} {end_j:e}");
    }
}

/// The ledger of a body with particles awake, in 6 substeps and more: what leapfrog leaves, of second order.
#[test]
fn the_ledger_balances_to_second_order() {
    let balance = |substeps: u32| {
        let mut spec = held_below(block(0.45));
        spec.settings = Settings { substeps: Substeps::Fixed(substeps), mass_damping_per_s: 0.0, ..spec.settings };
        spec.settings.long_coarse_steps = false;
        spec.tools = vec![sphere(6e-3, DVec3::Z * 7e-3, Coupling::Rigid)];
        spec.gravity_m_per_s2 = DVec3::Z * -9.81;
        let mut rig = Rig::new(spec);
        let awake = near(&rig, DVec3::ZERO, 10e-3);
        wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake);
        let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
        for tick in 0..60 {
            rig.tick_at(DVec3::Z * (7e-3 - 2e-3 * f64::from(tick) / 60.0));
            let energies = Energies::of(&rig.model, &rig.state);
            worst = worst.max(energies.balance_j().abs());
            largest = largest.max(energies.elastic_j.abs()).max(energies.gravitational_j.abs());
        }
        worst / largest
    };
    let errors = [10, 20, 40].map(balance);
    let orders = [(errors[0] / errors[1]).log2(), (errors[1] / errors[2]).log2()];
    println!("ledger: {errors:?}, orders {orders:?}");
    assert!(errors[0] < 1e-3 && orders.iter().all(|order| *order > 1.8), "{errors:?} {orders:?}");
}
