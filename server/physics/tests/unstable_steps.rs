//! A step that is too long is noticed, taken back and repeated in more parts; one that is not is left alone.
#![allow(clippy::unwrap_used)]
use crate::rig;
use crate::support;
use glam::DVec3;
use palpate_physics::bodies::hybrid::Waking;
use palpate_physics::{
    Energies, ModelSpec, Precision, Substeps,
    contact::Coupling,
    material::{Law, Viscosity},
    snapshot,
};
use rig::{
    Drive, Rig, body, bricks, even, hold, hybrid_block, material, mesh_of, nodes_where, solid_mut, sphere, wake_nearest,
};
use support::Random;

fn block() -> ModelSpec {
    let side = even(-0.02, 0.02, 4);
    body(bricks(&side, &side, &even(-0.02, 0.0, 2)), material(Law::StableNeoHookean, 10e3, 0.4))
}

/// Ticks of one step at `ratio` times the longest stable one of the body without viscosity.
fn one_step(mut spec: ModelSpec, ratio: f64) -> Rig {
    spec.settings.substeps = Substeps::Fixed(1);
    let omega = Rig::new(spec.clone()).model.body().max_natural_frequency_rad_per_s();
    spec.settings.tick_period_s = 2.0 * ratio / omega;
    Rig::new(spec)
}

/// Random speeds in all modes: small enough for a linear body, or not.
fn strike(rig: &mut Rig, speed_m_per_s: f64, seed: u64) {
    let mut random = Random(seed);
    for (v, inverse_mass) in
        rig.state.mechanical.v.iter_mut().zip(rig.model.body().as_tet().unwrap().inverse_mass_per_kg())
    {
        if inverse_mass.x > 0.0 {
            *v = random.vector() * speed_m_per_s;
        }
    }
}

fn held_j(rig: &Rig) -> f64 {
    Energies::of(&rig.model, &rig.state).held_j()
}

/// First tick that was repeated, how many were, and the largest energy over that at the start.
fn ring(mut rig: Rig, ticks: u32) -> (Option<u32>, u32, f64) {
    let (start_j, still) = (held_j(&rig), Drive::default());
    let (mut first, mut repeated, mut growth) = (None, 0, 1.0_f64);
    for tick in 1..=ticks {
        let report = rig.tick(&still);
        assert_eq!(report.quarantined, None);
        if report.repeated > 0 {
            first.get_or_insert(tick);
            repeated += 1;
        }
        growth = growth.max(held_j(&rig) / start_j);
    }
    (first, repeated, growth)
}

#[test]
fn a_step_over_the_limit_is_noticed_and_a_shorter_one_is_not() {
    for precision in [Precision::Double, Precision::Single] {
        for seed in 0..6 {
            let struck = |ratio: f64| {
                let mut rig = one_step(ModelSpec { settings: settings(precision), ..block() }, ratio);
                strike(&mut rig, 1e-5, seed);
                rig
            };
            for ratio in [0.5, 0.9, 0.95, 0.97] {
                let (first, _, growth) = ring(struck(ratio), 2000);
                assert_eq!(first, None, "r = {ratio}, seed {seed}");
                assert!(growth < 1.0 / (1.0 - ratio * ratio), "r = {ratio}: {growth}");
            }
            for ratio in [1.01, 1.02, 1.05, 1.5] {
                let (first, repeated, growth) = ring(struck(ratio), 2000);
                assert!(first.is_some_and(|tick| tick <= 10), "r = {ratio}, seed {seed}: {first:?}");
                // An undamped body rings on: fewer substeps are never tried again.
                assert!(repeated == 1 && growth < 20.0, "r = {ratio}, seed {seed}: {repeated}, {growth}");
            }
        }
    }
}

fn settings(precision: Precision) -> palpate_physics::Settings {
    palpate_physics::Settings { precision, ..block().settings }
}

/// Mass damping answers a step as stress does, and is not taken for it; nor does it hide a step that is too long.
#[test]
fn mass_damping_neither_alarms_nor_hides() {
    for damping_per_s in [60.0, 500.0, 1000.0] {
        for seed in 0..4 {
            let struck = |ratio: f64| {
                let mut spec = block();
                spec.settings.mass_damping_per_s = damping_per_s;
                let mut rig = one_step(spec, ratio);
                strike(&mut rig, 1e-5, seed);
                rig
            };
            for ratio in [0.5, 0.9, 0.97] {
                assert_eq!(ring(struck(ratio), 500).0, None, "{damping_per_s} /s, r = {ratio}, seed {seed}");
            }
            // |z| = 1 at k = 4 cosh ½c dt: what is damped is stable a little further.
            let omega = struck(1.0).model.body().max_natural_frequency_rad_per_s();
            let ratio =
                (100..200).map(|r| 0.01 * f64::from(r)).find(|r| r * r > 1.2 * (damping_per_s * r / omega).cosh());
            let (first, _, growth) = ring(struck(ratio.unwrap()), 500);
            assert!(first.is_some() && growth < 20.0, "{damping_per_s} /s, seed {seed}: {first:?}, {growth}");
        }
    }
}

/// With viscosity the limit is `k + 2d ≤ 4`: at `k = 4r²` and `C = τK`, `d = kτ/dt`, so `τ = ½dt (1/r² − 1)` is its edge.
#[test]
fn viscosity_shortens_the_step_that_is_noticed() {
    let ratio = 0.7;
    let omega = one_step(block(), ratio).model.body().max_natural_frequency_rad_per_s();
    let edge_s = 0.5 * (2.0 * ratio / omega) * (1.0 / (ratio * ratio) - 1.0);
    for (times, noticed) in [(0.8, false), (1.1, true), (2.0, true)] {
        let mut spec = block();
        let material = &mut solid_mut(&mut spec).regions[0].material;
        let tau_s = times * edge_s;
        material.viscosity =
            Viscosity { phi_pa_s: tau_s * material.lame.lambda_pa, psi_pa_s: tau_s * material.lame.mu_pa };
        let mut rig = one_step(spec, ratio);
        strike(&mut rig, 1e-5, 1);
        let (first, _, growth) = ring(rig, 500);
        println!("{times} of the edge: {first:?}, {growth}");
        assert_eq!(first.is_some(), noticed, "{times} of the edge: {first:?}");
        assert!(growth < 5.0, "{times} of the edge: {growth}");
    }
}

/// ω_max (rad/s) of the body as it is now, by power iteration on `M⁻¹K(x)`.
fn frequency_now(rig: &Rig, direction: &mut [DVec3]) -> f64 {
    let (model, kernel) = (&rig.model, rig.model.body().as_tet().unwrap().kernel());
    let (mut scratch, mut product) = (kernel.scratch_for_products(), vec![DVec3::ZERO; direction.len()]);
    kernel.linearise_at(model.rest_positions_m(), &rig.state.mechanical.x, &mut scratch);
    let mut largest = 0.0;
    for _ in 0..100 {
        kernel.products_n([-1.0, 0.0], direction, &mut product, &mut scratch);
        let weighted: f64 = direction.iter().zip(model.body().mass_kg()).map(|(a, m)| a.length_squared() * m).sum();
        largest = direction.iter().zip(&product).map(|(a, p)| a.dot(*p)).sum::<f64>() / weighted;
        for ((a, p), inverse_mass) in
            direction.iter_mut().zip(&product).zip(model.body().as_tet().unwrap().inverse_mass_per_kg())
        {
            *a = *p * *inverse_mass / largest;
        }
    }
    largest.sqrt()
}

/// A bar pulled at both ends to 1.5 times its length and let back, with a step that is stable at rest and not there.
#[test]
fn a_body_that_stiffens_past_the_limit_while_it_is_stretched() {
    let side = even(-0.01, 0.01, 2);
    let mesh = bricks(&even(-0.04, 0.04, 8), &side, &side);
    let mut spec = body(mesh, material(Law::StVenantKirchhoff, 10e3, 0.3));
    let ends = [("left", -1.0), ("right", 1.0)]
        .map(|(name, sign)| hold(name, nodes_where(mesh_of(&spec), |p| sign * p.x > 0.0399), [true; 3]));
    spec.prescribed = ends.to_vec();
    let run = |subcycle_unstable: bool| {
        let mut spec = spec.clone();
        spec.settings.subcycle_unstable = subcycle_unstable;
        let mut rig = one_step(spec, 0.9);
        strike(&mut rig, 1e-4, 3);
        let period_s = rig.model.settings().tick_period_s;
        let mut direction: Vec<DVec3> = {
            let mut random = Random(7);
            rig.state.mechanical.x.iter().map(|_| random.vector()).collect()
        };
        let (mut crossed, mut noticed, mut moved_j, mut gained_j) = (None, None, 0.0_f64, 0.0_f64);
        for tick in 1..=3000_u32 {
            let pull_m = 0.02 * (f64::from(tick.min(3000 - tick)) / 1000.0).min(1.0);
            let drive = Drive { prescribed: vec![-DVec3::X * pull_m, DVec3::X * pull_m], ..rig.still() };
            if crossed.is_none() && frequency_now(&rig, &mut direction) * period_s > 2.0 * 1.01 {
                crossed = Some(tick);
            }
            let report = rig.tick(&drive);
            if report.repeated > 0 {
                noticed.get_or_insert(tick);
            }
            if report.quarantined.is_some() {
                return (crossed, noticed, f64::INFINITY, rig.state.pace.substeps);
            }
            let energies = Energies::of(&rig.model, &rig.state);
            moved_j = moved_j.max(energies.external_work_j);
            gained_j = gained_j.max(energies.balance_j());
        }
        // Rest again: long enough for fewer substeps to be tried.
        let still = rig.still();
        for _ in 0..400 {
            rig.tick(&still);
        }
        (crossed, noticed, gained_j / moved_j, rig.state.pace.substeps)
    };
    let (crossed, noticed, gain, substeps) = run(true);
    println!("past 1.01 of the limit before tick {crossed:?}, noticed in tick {noticed:?}; energy gained {gain:e}");
    assert!(crossed.is_some() && noticed.is_some());
    // The mode that grows is one of many, and grows slowly so near the limit, before it stands out.
    assert!(noticed.unwrap() <= crossed.unwrap() + 20);
    assert!(gain < 1e-4, "{gain}");
    assert_eq!(substeps, 1);
    let (_, _, without, _) = run(false);
    assert!(without > 1.0, "{without}");
}

/// A pressed, rubbed, loaded block on the floor.
fn pressed(precision: Precision, ratio: Option<f64>) -> Rig {
    let mut spec = block();
    spec.settings.precision = precision;
    spec.gravity_m_per_s2 = DVec3::new(0.0, 0.0, -9.81);
    spec.prescribed = vec![hold("floor", nodes_where(mesh_of(&spec), |p| p.z < -0.0199), [true; 3])];
    solid_mut(&mut spec).regions[0].material.viscosity = Viscosity { phi_pa_s: 0.02, psi_pa_s: 0.02 };
    spec.tools = vec![sphere(0.008, DVec3::new(0.0, 0.0, 0.0085), Coupling::Rigid)];
    spec.tools[0].friction_coefficient = 0.4;
    match ratio {
        Some(ratio) => one_step(spec, ratio),
        None => Rig::new(spec),
    }
}

fn press(rig: &mut Rig, tick: u32) -> palpate_physics::StepReport {
    press_to(rig, tick, 2.5e-3)
}

fn press_to(rig: &mut Rig, tick: u32, depth_m: f64) -> palpate_physics::StepReport {
    let t = f64::from(tick) * 1e-3;
    rig.tick_at(DVec3::new(0.004 * (40.0 * t).sin(), 0.0, (0.0085 - 0.05 * t).max(8e-3 - depth_m)))
}

/// On a stable body, whatever happens to it, judging changes no bit. Contact is as stiff as at rest: where it is stiffer,
/// the pace counts it.
#[test]
fn switched_off_and_on_agree_bit_for_bit_where_steps_are_stable() {
    for precision in [Precision::Single, Precision::Double] {
        for ratio in [None, Some(0.5)] {
            let mut on = pressed(precision, ratio);
            let mut spec = on.spec.clone();
            spec.settings.subcycle_unstable = false;
            let mut off = Rig::new(spec);
            for tick in 0..3000 {
                assert_eq!(press_to(&mut on, tick, 1e-3).repeated, 0, "{precision:?}, {ratio:?}, tick {tick}");
                press_to(&mut off, tick, 1e-3);
            }
            assert!(on.state.mechanical.tools[0].contacts > 0);
            assert_eq!(on.state.mechanical.x, off.state.mechanical.x);
            assert_eq!(on.state.mechanical.v, off.state.mechanical.v);
            assert_eq!(on.state.mechanical.ledger, off.state.mechanical.ledger);
        }
    }
}

/// The repetition begins where the tick began: ledger, tools, friction and loads included.
#[test]
fn a_repeated_tick_is_the_tick_in_more_substeps() {
    let mut rig = pressed(Precision::Double, Some(1.05));
    let mut checked = 0;
    for tick in 0..600 {
        let before = rig.state.clone();
        let report = press(&mut rig, tick);
        assert_eq!(report.quarantined, None);
        if report.repeated > 0 {
            let mut at_once = Rig { state: before, ..Rig::new(rig.spec.clone()) };
            at_once.state.pace.substeps = report.substeps;
            let direct = press(&mut at_once, tick);
            assert_eq!((direct.substeps, direct.repeated), (report.substeps, 0));
            at_once.state.pace = rig.state.pace.clone();
            assert_eq!(at_once.state, rig.state);
            checked += 1;
        }
    }
    assert!(checked > 0 && rig.state.mechanical.tools[0].friction_heat_j > 0.0, "{checked}");
}

/// What a tick is judged by is part of the state: alarm and repetition come in the same ticks after a restore.
#[test]
fn a_restored_run_is_judged_as_the_one_that_went_on() {
    let mut first = pressed(Precision::Single, Some(1.05));
    let mut repeated = 0;
    for tick in 0..300 {
        let bytes = snapshot::save(&first.model, &first.state);
        let mut second =
            Rig { state: snapshot::restore(&first.model, &bytes).unwrap(), ..Rig::new(first.spec.clone()) };
        let report = press(&mut first, tick);
        assert_eq!(press(&mut second, tick), report);
        assert_eq!(first.state, second.state);
        repeated += report.repeated;
    }
    assert!(repeated > 0);
}

/// A blow drives single particles on. In steps that are stable for a body at rest they ran through their neighbours, and energy
/// was lost or came from nowhere; a body that moves as a whole is as well off in few.
#[test]
fn no_particle_runs_into_its_neighbours_in_one_step() {
    let struck = |speed_m_per_s: f64, all: bool, subcycle: bool| {
        let mut spec = hybrid_block((0.02, 1, 8), 0.45, 400, Waking::ByHand);
        spec.gravity_m_per_s2 = DVec3::ZERO;
        spec.settings.precision = Precision::Double;
        spec.settings.subcycle_unstable = subcycle;
        let mut rig = Rig::new(spec);
        wake_nearest(&mut rig, 200);
        let still = rig.still();
        rig.tick(&still);
        let nodes = rig.model.body().as_hybrid().unwrap().node_count();
        let velocities = &mut rig.state.mechanical.v;
        let struck = if all { 0..velocities.len() } else { nodes + 50..nodes + 51 };
        velocities[struck].fill(DVec3::X * speed_m_per_s);
        let report = rig.tick(&still);
        (rig, report)
    };
    let spacing_m = 2.5e-3;
    let (rig, report) = struck(40.0, false, true);
    let fastest = rig.state.mechanical.v.iter().map(|v| v.length()).fold(0.0, f64::max);
    let stride_m = fastest * rig.model.settings().tick_period_s / f64::from(report.substeps);
    println!("{fastest} m/s at the end in {} substeps, taken back {} times", report.substeps, report.repeated);
    assert!(report.repeated > 0 && stride_m <= 0.25 * spacing_m, "{stride_m} m");
    let (rig, report) = struck(40.0, true, true);
    assert_eq!((report.repeated, report.substeps), (0, rig.model.substeps()), "it moves as a whole");
    let (rig, report) = struck(40.0, false, false);
    assert_eq!((report.repeated, report.substeps), (0, rig.model.substeps()), "it is switched off");
}
