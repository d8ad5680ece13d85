//! The coarse level of a body with particles in steps of its own.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{Energies, ModelSpec, Precision, Settings, Substeps, bodies::hybrid::Waking, contact::Coupling};
use rig::{Rig, held_below, hybrid_block, sphere, wake_nearest};

/// 80 × 80 × 40 mm in 192 coarse tets, particles 2.5 mm apart, held below.
fn block(substeps: u32, long_coarse_steps: bool) -> ModelSpec {
    let mut spec = held_below(hybrid_block((0.04, 2, 16), 0.45, 300, Waking::ByHand));
    spec.settings =
        Settings { precision: Precision::Double, substeps: Substeps::Fixed(substeps), ..Settings::for_particles() };
    spec.settings.long_coarse_steps = long_coarse_steps;
    spec
}

/// The particles nearest to the middle of the upper face awake.
fn with_awake(spec: ModelSpec, count: usize) -> Rig {
    let mut rig = Rig::new(spec);
    wake_nearest(&mut rig, count);
    rig
}

/// Forces (N) on a sphere that presses 2 mm deep within `ramp` ticks and stays.
fn pressed_n(substeps: u32, long_coarse_steps: bool, ramp: u32) -> Vec<f64> {
    let mut spec = block(substeps, long_coarse_steps);
    spec.settings.mass_damping_per_s = 20.0;
    spec.tools = vec![sphere(8e-3, DVec3::Z * 8.01e-3, Coupling::Rigid)];
    let mut rig = with_awake(spec, 200);
    let every = if long_coarse_steps { substeps } else { 1 };
    assert_eq!((rig.model.substeps(), rig.model.substeps_per_long_step()), (substeps, every));
    let force_n = |tick: u32| {
        let report = rig.tick_at(DVec3::Z * (8e-3 - 2e-3 * f64::from(tick.min(ramp)) / f64::from(ramp)));
        assert_eq!(report.repeated, 0);
        rig.state.mechanical.tools[0].contact_force_n.z
    };
    (0..400).map(force_n).collect()
}

/// Against half of the step: one step a tick of the coarse level is as near as six, while the sphere comes, just after, and at rest.
#[test]
fn one_long_step_a_tick_presses_as_short_ones_do() {
    for ramp in [20, 100] {
        let reference = pressed_n(12, false, ramp);
        let last = reference[399];
        let worst = |forces: &[f64], ticks: std::ops::Range<usize>| {
            ticks.map(|t| (forces[t] - reference[t]).abs() / last).fold(0.0, f64::max)
        };
        let (short, long) = (pressed_n(6, false, ramp), pressed_n(6, true, ramp));
        for ticks in [0..ramp as usize, ramp as usize..ramp as usize + 100] {
            let [short, long] = [&short, &long].map(|forces| worst(forces, ticks.clone()));
            assert!(long < short + 2e-3, "ramp of {ramp}, ticks {ticks:?}: {long:e}, short steps {short:e}");
        }
        // It still trembles by a thousandth.
        let mean = |forces: &[f64]| forces[300..].iter().sum::<f64>() / 100.0;
        let (mean_n, rest_n) = (mean(&long), mean(&reference));
        assert!((mean_n / rest_n - 1.0).abs() < 1e-3, "{mean_n} {rest_n}");
    }
}

/// What `b` follows late feeds a body that nothing damps: less than a per cent of its energy in a second.
#[test]
fn a_trembling_body_hardly_gains_energy() {
    let mut rig = with_awake(block(4, true), 300);
    assert_eq!(rig.model.substeps_per_long_step(), 4);
    let nodes = rig.model.body().mass_kg().len();
    for (number, v) in rig.state.mechanical.v.iter_mut().enumerate() {
        let s = number as f64;
        let free =
            number >= nodes || rig.model.body().as_hybrid().unwrap().inverse_mass_per_kg()[number] != DVec3::ZERO;
        *v = if free { DVec3::new((s * 0.7).sin(), (s * 1.9).cos(), (s * 2.3).sin()) * 1e-4 } else { DVec3::ZERO };
    }
    let drive = rig.still();
    let mut means = vec![];
    for _ in 0..4 {
        let mut sum = 0.0;
        for tick in 0..500 {
            rig.tick(&drive);
            if tick % 10 == 0 {
                sum += Energies::of(&rig.model, &rig.state).held_j();
            }
        }
        means.push(sum);
    }
    let gain_per_s = (means[3] / means[1]).ln();
    assert!(gain_per_s.abs() < 1e-2, "{gain_per_s:e} a second");
}

/// Far beyond what its steps are made for: noticed, taken back and repeated in more of them.
#[test]
fn a_long_step_that_is_too_long_is_noticed() {
    let run = |subcycle_unstable: bool| {
        let mut spec = block(4, true);
        spec.settings.subcycle_unstable = subcycle_unstable;
        let mut rig = with_awake(spec, 0);
        assert_eq!(rig.model.substeps_per_long_step(), 4);
        for (x, inverse) in
            rig.state.mechanical.x.iter_mut().zip(rig.model.body().as_hybrid().unwrap().inverse_mass_per_kg())
        {
            if *inverse != DVec3::ZERO {
                *x = *x * 1.5 + DVec3::Z * 0.02;
            }
        }
        rig.state.mechanical.force_is_current = false;
        let drive = rig.still();
        let (start_j, mut most_j, mut repeated) = (Energies::of(&rig.model, &rig.state).held_j(), 0.0_f64, 0);
        for _ in 0..60 {
            let report = rig.tick(&drive);
            repeated += report.repeated;
            let now_j = Energies::of(&rig.model, &rig.state).held_j();
            most_j = most_j.max(if report.quarantined.is_some() { f64::INFINITY } else { now_j / start_j });
        }
        (most_j, repeated)
    };
    let (most, repeated) = run(false);
    assert!(most > 3.0 && repeated == 0, "{most} {repeated}");
    let (most, repeated) = run(true);
    assert!(most < 1.1 && (1..5).contains(&repeated), "{most} {repeated}");
}
