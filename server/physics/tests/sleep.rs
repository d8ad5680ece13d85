//! A body at rest is left alone: never further from the truth than the tolerance, and awake when anything changes.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, Integrator, LoadSpec, Model, ModelError, ModelSpec, PointForce, PrescribedSpec, bodies::hybrid::Waking,
    contact::Coupling, material::Law, snapshot, tick::EnvironmentError,
};
use rig::{
    Drive, Rig, at, body, bricks, even, held_below, hold, hybrid_block, material, nodes_where, particles,
    particles_mut, solid_mut, sphere,
};

const TOLERANCE_M: f64 = 1e-7;
const RADIUS_M: f64 = 0.006;
const AWAY: DVec3 = DVec3::new(0.001, 0.002, 0.03);

/// A damped block on its floor under gravity, with a load that may push its top sideways, and a tool above it.
fn block(tolerance_m: f64) -> ModelSpec {
    let side = even(-0.02, 0.02, 4);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 3));
    let floor = nodes_where(&mesh, |p| p.z < -0.0199);
    let top = nodes_where(&mesh, |p| p.z > -1e-9);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.gravity_m_per_s2 = DVec3::NEG_Z * 9.81;
    spec.prescribed = vec![hold("floor", floor, [true; 3])];
    spec.loads = vec![LoadSpec::NodalForces(top.into_iter().map(|node| (node, DVec3::X * 1e-3)).collect())];
    spec.tools = vec![sphere(RADIUS_M, AWAY, Coupling::Rigid)];
    spec.settings.mass_damping_per_s = 60.0;
    spec.settings.sleep_tolerance_m = tolerance_m;
    spec
}

/// What is done in a tick.
type Script = fn(u32) -> (DVec3, f64, Option<PointForce>);

fn drive(rig: &Rig, (tool, load, force): (DVec3, f64, Option<PointForce>)) -> Drive {
    Drive { tools: vec![at(tool)], load_factors: vec![load], point_forces: force.into_iter().collect(), ..rig.still() }
}

fn farthest_m(a: &Rig, b: &Rig) -> f64 {
    a.state.mechanical.x.iter().zip(&b.state.mechanical.x).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

/// Runs the script with and without sleep; returns the ticks slept and the largest distance between the two bodies.
fn compare(spec: impl Fn(f64) -> ModelSpec, ticks: u32, script: Script) -> (Vec<u32>, f64) {
    let (mut sleepy, mut awake) = (Rig::new(spec(TOLERANCE_M)), Rig::new(spec(0.0)));
    let (mut slept, mut worst_m) = (Vec::new(), 0.0_f64);
    for tick in 0..ticks {
        let before = sleepy.state.mechanical.x.clone();
        let was_asleep = sleepy.state.sleep.asleep;
        for rig in [&mut sleepy, &mut awake] {
            let input = drive(rig, script(tick));
            rig.tick(&input);
        }
        if was_asleep && sleepy.state.sleep.asleep {
            assert_eq!(sleepy.state.mechanical.x, before);
            slept.push(tick);
        }
        worst_m = worst_m.max(farthest_m(&sleepy, &awake));
    }
    assert!(!awake.state.sleep.asleep && awake.state.mechanical.tick == sleepy.state.mechanical.tick);
    (slept, worst_m)
}

/// Still; pushed at 1 s; back at 1.5 s; touched from 2.5 s.
fn scripted(tick: u32) -> (DVec3, f64, Option<PointForce>) {
    let depth = 0.002 * (f64::from(tick.saturating_sub(2500)) / 200.0).min(1.0);
    let tool = if tick < 2500 { AWAY } else { DVec3::new(0.001, 0.002, RADIUS_M + 0.001 - depth) };
    let load = if (1000..1500).contains(&tick) { 1.0 } else { 0.0 };
    (tool, load, None)
}

#[test]
fn a_sleeping_body_is_where_it_would_be_and_wakes_for_loads_and_tools() {
    for integrator in [Integrator::Leapfrog, Integrator::BackwardEuler] {
        let spec = |tolerance_m| {
            let mut spec = block(tolerance_m);
            spec.settings.integrator = integrator;
            spec
        };
        let (slept, worst_m) = compare(spec, 3000, scripted);
        println!("{integrator:?}: slept {} of 3000 ticks, {worst_m:.1e} m off at worst", slept.len());
        let sleeps_in = |range: std::ops::Range<u32>| slept.iter().filter(|tick| range.contains(tick)).count();
        assert!(sleeps_in(0..1000) > 200 && sleeps_in(1500..2500) > 200, "{integrator:?}");
        assert_eq!(sleeps_in(1000..1100) + sleeps_in(1500..1600), 0, "it is pushed: {integrator:?}");
        // A rigid tool comes after a device that leaps by a radius in 10 ms.
        let arrived = 2500 + (10.0 * (AWAY.z - RADIUS_M) / RADIUS_M).ceil() as u32 + 3;
        assert_eq!(sleeps_in(arrived..3000), 0, "a tool is near: {integrator:?}");
        assert!(worst_m <= 2.0 * TOLERANCE_M, "{integrator:?}: {worst_m}");
        assert!(worst_m > 0.0, "{integrator:?}: sleeping must change something, or it was not compared");
    }
}

#[test]
fn an_injected_force_and_a_prescribed_motion_wake_it_in_their_tick() {
    for moved in [false, true] {
        let mut rig = Rig::new(block(TOLERANCE_M));
        while !rig.state.sleep.asleep {
            let input = drive(&rig, (AWAY, 0.0, None));
            rig.tick(&input);
            assert!(rig.state.mechanical.tick < 3000);
        }
        let kinetic_j = Energies::of(&rig.model, &rig.state).kinetic_j;
        assert_eq!(kinetic_j, 0.0);
        let force = PointForce { node: rig.state.mechanical.x.len() as u32 - 1, force_n: DVec3::X * 0.01 };
        let mut input = drive(&rig, (AWAY, 0.0, (!moved).then_some(force)));
        if moved {
            input.prescribed[0] = DVec3::X * 1e-4;
        }
        let before = rig.state.mechanical.x.clone();
        rig.tick(&input);
        assert!(!rig.state.sleep.asleep && rig.state.mechanical.x != before, "moved {moved}");
    }
}

/// A tool on a spring, thrown at the sleeping body, goes on moving and meets it awake.
#[test]
fn a_tool_on_its_coupling_moves_while_the_body_sleeps() {
    let spec = |tolerance_m| {
        let mut spec = block(tolerance_m);
        spec.tools[0].coupling = Coupling::Spring { stiffness_n_per_m: 200.0, damping_n_s_per_m: 1.0, mass_kg: 0.02 };
        spec
    };
    let script: Script = |tick| {
        let z = AWAY.z - f64::from(tick.saturating_sub(1500)).min(240.0) * 1e-4;
        (DVec3::new(AWAY.x, AWAY.y, z), 0.0, None)
    };
    let (slept, worst_m) = compare(spec, 2000, script);
    assert!(slept.iter().any(|tick| (1520..1600).contains(tick)), "it sleeps while the tool comes");
    assert!(slept.iter().all(|tick| *tick < 1760), "and not when it is there");
    assert!(worst_m <= 2.0 * TOLERANCE_M, "{worst_m}");
}

/// A weighing block with particles that a tool wakes, and loads like [`block`]'s on its skin.
fn hybrid(tolerance_m: f64) -> ModelSpec {
    let mut spec = held_below(hybrid_block((0.02, 1, 8), 0.45, 400, Waking::ByTools { reach_m: 8e-3 }));
    let positions_m = particles(&spec).skin.positions_m();
    let top = (0..positions_m.len() as u32).filter(|&vertex| positions_m[vertex as usize].z > -1e-9);
    let pushed = top.map(|vertex| (vertex, DVec3::X * 1e-4)).collect();
    spec.gravity_m_per_s2 = DVec3::NEG_Z * 9.81;
    spec.loads = vec![LoadSpec::NodalForces(pushed)];
    spec.tools = vec![sphere(RADIUS_M, AWAY, Coupling::Rigid)];
    spec.settings.mass_damping_per_s = 60.0;
    spec.settings.sleep_tolerance_m = tolerance_m;
    spec
}

/// Touched after 1.5 s, and left alone from 2 s on.
fn touched(tick: u32) -> (DVec3, f64, Option<PointForce>) {
    let (to, back) = ((f64::from(tick) - 1500.0) / 300.0, (f64::from(tick) - 2000.0) / 300.0);
    let way = to.clamp(0.0, 1.0) - back.clamp(0.0, 1.0);
    (AWAY.lerp(DVec3::new(0.001, 0.002, RADIUS_M - 0.002), way), 0.0, None)
}

fn sleeps_in(slept: &[u32], range: std::ops::Range<u32>) -> usize {
    slept.iter().filter(|tick| range.contains(tick)).count()
}

/// All of it sleeps once its particles do and its coarse level is at rest. A tool wakes it before it is there, for its particles are to be awake
/// then; whether it slept changes nothing that is felt.
#[test]
fn a_hybrid_sleeps_as_a_whole_and_wakes_with_its_particles() {
    for fine_depth_m in [None, Some(6e-3)] {
        let spec = |tolerance_m| {
            let mut spec = hybrid(tolerance_m);
            particles_mut(&mut spec).fine_depth_m = fine_depth_m;
            spec.settings.precision = palpate_physics::Precision::Double;
            spec
        };
        let (mut sleepy, mut awake) = (Rig::new(spec(TOLERANCE_M)), Rig::new(spec(0.0)));
        let (mut slept, mut worst_n, mut most_n, mut most_awake) = (Vec::new(), 0.0_f64, 0.0_f64, 0);
        for tick in 0..4000 {
            for rig in [&mut sleepy, &mut awake] {
                let input = drive(rig, touched(tick));
                rig.tick(&input);
            }
            if sleepy.state.sleep.asleep {
                assert!(sleepy.state.body.active_particles().is_empty());
                slept.push(tick);
            }
            let force_n = |rig: &Rig| rig.state.mechanical.tools[0].contact_force_n;
            worst_n = worst_n.max(force_n(&sleepy).distance(force_n(&awake)));
            most_n = most_n.max(force_n(&awake).length());
            most_awake = most_awake.max(awake.state.body.active_particles().len());
            assert_eq!(sleepy.state.body.active_particles().len(), awake.state.body.active_particles().len());
        }
        println!(
            "{fine_depth_m:?}: slept {} of 4000 ticks; {worst_n:.1e} of {most_n:.3} N; {most_awake} awake",
            slept.len()
        );
        assert!(sleeps_in(&slept, 0..1500) > 500 && sleeps_in(&slept, 2300..4000) > 300);
        // A moment before it is touched until the last of its particles sleeps.
        assert_eq!(sleeps_in(&slept, 1730..2200), 0);
        assert!(most_n > 0.05 && most_awake > 50 && worst_n < 1e-3 * most_n, "{worst_n} of {most_n}");
    }
}

/// A hybrid is saved and restored, asleep and in every other state, into buffers that know nothing of it: the same bits as without.
#[test]
fn a_restored_hybrid_sleeper_goes_on_bit_for_bit() {
    let (mut whole, mut restored) = (Rig::new(hybrid(1e-6)), Rig::new(hybrid(1e-6)));
    let mut slept = 0;
    for tick in 0..3000 {
        if tick % 97 == 0 {
            let bytes = snapshot::save(&restored.model, &restored.state);
            restored.scratch = palpate_physics::Scratch::new(&restored.model);
            restored.state = snapshot::restore(&restored.model, &bytes).unwrap();
        }
        for rig in [&mut whole, &mut restored] {
            let input = drive(rig, touched(tick));
            rig.tick(&input);
        }
        slept += u32::from(whole.state.sleep.asleep);
        assert!(whole.state == restored.state, "tick {tick}, {slept} of them asleep");
    }
    assert!(slept > 1000, "{slept}");
}

/// Loads, injected forces and moved supports wake a hybrid in their tick.
#[test]
fn a_hybrid_wakes_for_whatever_acts_on_it() {
    for what in 0..3 {
        let mut rig = Rig::new(hybrid(1e-6));
        while !rig.state.sleep.asleep {
            let input = drive(&rig, (AWAY, 0.0, None));
            rig.tick(&input);
            assert!(rig.state.mechanical.tick < 3000);
        }
        assert_eq!(Energies::of(&rig.model, &rig.state).kinetic_j, 0.0);
        let force = PointForce { node: 3, force_n: DVec3::X * 0.01 };
        let mut input = drive(&rig, (AWAY, if what == 0 { 1.0 } else { 0.0 }, (what == 1).then_some(force)));
        if what == 2 {
            input.prescribed[0] = DVec3::X * 1e-4;
        }
        let before = rig.state.mechanical.x.clone();
        let report = rig.tick(&input);
        assert!(!rig.state.sleep.asleep && report.substeps > 0 && rig.state.mechanical.x != before, "{what}");
    }
}

/// What creeps is slow and its force small, by viscous stress or by mass damping; it is not at rest before it is there.
#[test]
fn what_creeps_does_not_sleep_far_from_rest() {
    for (psi_pa_s, damping_per_s) in [(2000.0, 0.0), (0.0, 2000.0)] {
        let spec = |tolerance_m| {
            let mut spec = block(tolerance_m);
            spec.gravity_m_per_s2 = DVec3::ZERO;
            solid_mut(&mut spec).regions[0].material.viscosity.psi_pa_s = psi_pa_s;
            spec.settings.mass_damping_per_s = damping_per_s;
            if psi_pa_s > 0.0 {
                // Leapfrog's step would be short.
                spec.settings.integrator = Integrator::BackwardEuler;
                spec.settings.solver_tolerance = 1e-9;
            }
            spec.settings.precision = palpate_physics::Precision::Double;
            spec
        };
        let script: Script = |tick| (AWAY, if tick < 500 { 1.0 } else { 0.0 }, None);
        let (slept, worst_m) = compare(spec, 12_000, script);
        println!("psi {psi_pa_s}, damping {damping_per_s}: slept {} ticks, {worst_m:.1e} m off", slept.len());
        assert!(slept.len() > 100 && worst_m <= 2.0 * TOLERANCE_M, "{worst_m}");
    }
}

#[test]
fn what_rings_does_not_sleep() {
    let undamped = |tolerance_m| {
        let mut spec = block(tolerance_m);
        spec.settings.mass_damping_per_s = 0.0;
        spec
    };
    assert_eq!(compare(undamped, 2000, |_| (AWAY, 0.0, None)), (vec![], 0.0));
}

/// A displacement that is not finite is refused, and not remembered either: the state could not be restored.
#[test]
fn a_refused_displacement_leaves_a_state_that_can_be_restored() {
    let mut rig = Rig::new(block(TOLERANCE_M));
    let mut input = drive(&rig, (AWAY, 0.0, None));
    input.prescribed[0].x = f64::NAN;
    assert_eq!(rig.tick(&input).inputs_rejected, 1);
    assert_eq!(snapshot::restore(&rig.model, &snapshot::save(&rig.model, &rig.state)).unwrap(), rig.state);
}

/// Saved asleep and in every other state, and restored into a fresh model's buffers: the same bits as without.
#[test]
fn a_restored_sleeper_goes_on_bit_for_bit() {
    let run = |every: Option<u32>| {
        let mut rig = Rig::new(block(TOLERANCE_M));
        for tick in 0..2700 {
            if every.is_some_and(|every| tick % every == 0) {
                let bytes = snapshot::save(&rig.model, &rig.state);
                rig = Rig::new(block(TOLERANCE_M));
                rig.state = snapshot::restore(&rig.model, &bytes).unwrap();
            }
            let input = drive(&rig, scripted(tick));
            rig.tick(&input);
            assert!(rig.scratch.reactions_n().iter().any(|r| *r != DVec3::ZERO), "the floor carries the weight");
        }
        rig.state
    };
    assert_eq!(run(None), run(Some(97)));
}

#[test]
fn the_ledger_balances_over_sleep() {
    let mut rig = Rig::new(block(TOLERANCE_M));
    let mut balance = Vec::new();
    for tick in 0..2400 {
        let input = drive(&rig, scripted(tick));
        rig.tick(&input);
        if [999, 2399].contains(&tick) {
            assert!(rig.state.sleep.asleep);
            balance.push(Energies::of(&rig.model, &rig.state).balance_j());
        }
    }
    let moved_j = rig.state.mechanical.ledger.dissipated_j;
    assert!(balance.iter().all(|b| b.abs() < 1e-3 * moved_j), "{balance:?} of {moved_j}");
}

#[test]
fn what_cannot_sleep_is_told() {
    let free = ModelSpec { prescribed: vec![], ..block(TOLERANCE_M) };
    assert!(matches!(Model::build(free), Err(ModelError::Sleep { .. })));
    let one_axis = |spec: &ModelSpec| vec![PrescribedSpec { axes: [false, false, true], ..spec.prescribed[0].clone() }];
    let sliding = ModelSpec { prescribed: one_axis(&block(TOLERANCE_M)), ..block(TOLERANCE_M) };
    let told = Model::build(sliding).unwrap_err().to_string();
    assert!(told.contains("never sleep"), "{told}");
    for integrator in [Integrator::SeedVerlet, Integrator::SeedSemiImplicit] {
        let mut spec = block(TOLERANCE_M);
        spec.settings.integrator = integrator;
        assert!(matches!(
            Model::build(spec).unwrap_err().environment(),
            Some(EnvironmentError::Setting { name: "sleep_tolerance_m", .. })
        ));
    }
    let mut spec = block(TOLERANCE_M);
    spec.settings.sleep_tolerance_m = -1.0;
    assert!(Model::build(spec).is_err());
}
