//! After `Scratch::new` a tick neither allocates nor frees.
#![allow(clippy::unwrap_used)]
mod rig;
mod walls;
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::DVec3;
use palpate_physics::{
    Integrator, LoadSpec, PointForce, Precision, SelfContactChoice, Substeps, TickInput,
    bodies::hybrid::{ParticleSpec, Skin, Waking},
    contact::{Coupling, ToolShape, ToolTarget},
    material::{Lame, Law, Viscosity},
};
use rig::{
    Rig, at, body, bricks, even, hold, material, mesh_of, nodes_where, particles_mut, pressed_block, solid_mut, sphere,
    with_particles,
};
use walls::{gripped_clamp, hybrid_clamp, squeeze_hybrid};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// A loaded, damped, viscous block with a rigid and a coupled tool that rub.
fn rig(integrator: Integrator) -> Rig {
    let side = even(-0.02, 0.02, 4);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 2));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    solid_mut(&mut spec).regions[0].material.viscosity = Viscosity { phi_pa_s: 0.2, psi_pa_s: 0.2 };
    spec.settings.mass_damping_per_s = 2.0;
    spec.settings.integrator = integrator;
    spec.gravity_m_per_s2 = DVec3::new(0.0, 0.0, -9.81);
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec.loads = vec![
        LoadSpec::NodalForces(vec![(70, DVec3::X * 0.01)]),
        LoadSpec::Traction { triangles: vec![0, 1, 2], traction_pa: DVec3::Y * 20.0 },
        LoadSpec::Pressure { triangles: vec![3, 4, 5], pressure_pa: 50.0, follower: true },
    ];
    let coupled = Coupling::Spring { stiffness_n_per_m: 300.0, damping_n_s_per_m: 2.0, mass_kg: 0.01 };
    spec.tools = vec![
        sphere(0.006, DVec3::new(0.01, 0.0, 0.03), Coupling::Rigid),
        sphere(0.008, DVec3::new(-0.01, 0.0, 0.03), coupled),
    ];
    for tool in &mut spec.tools {
        tool.friction_coefficient = 0.4;
    }
    Rig::new(spec)
}

/// Up and down through contact, far away for a part of each round, rubbing along.
fn targets(tick: u32) -> [ToolTarget; 2] {
    let phase = f64::from(tick) * 0.02;
    let z = |lift: f64| 0.02 + lift + 0.014 * phase.cos() + if tick % 1000 > 800 { 0.3 } else { 0.0 };
    [at(DVec3::new(0.01, 0.01 * phase.sin(), z(-0.004))), at(DVec3::new(-0.01, 0.008 * (0.7 * phase).sin(), z(-0.003)))]
}

#[test]
fn thousands_of_ticks_allocate_nothing() {
    ticks_allocate_nothing(Integrator::Leapfrog, 5000);
}

#[test]
fn nor_do_ticks_of_the_other_integrators() {
    for integrator in [Integrator::SeedVerlet, Integrator::SeedSemiImplicit, Integrator::BackwardEuler] {
        ticks_allocate_nothing(integrator, 2000);
    }
}

#[test]
fn nor_do_capsules() {
    let mut spec = rig(Integrator::Leapfrog).spec;
    for tool in &mut spec.tools {
        tool.shape = ToolShape::capsule(tool.coupling, tool.radius_m, 0.006, DVec3::new(1.0, 0.0, 1.0));
    }
    run_without_allocating(Rig::new(spec), 2000);
}

/// One step per tick is too long for a body of 200 kPa.
#[test]
fn nor_do_ticks_that_are_repeated() {
    let mut spec = rig(Integrator::Leapfrog).spec;
    spec.settings.substeps = Substeps::Fixed(1);
    solid_mut(&mut spec).regions[0].material.lame = Lame::from_young_poisson(200e3, 0.45).unwrap();
    let rig = Rig::new(spec);
    assert!(run_without_allocating(rig, 2000) > 0);
}

/// Two tools rub and tap on a body with particles, which wake and sleep under load.
#[test]
fn nor_does_waking_particles() {
    for fine_depth_m in [None, Some(2e-3)] {
        for half_length_m in [None, Some(8e-3)] {
            wake_and_sleep(fine_depth_m, half_length_m);
        }
    }
}

/// Beneath spheres, or capsules of this half length.
fn wake_and_sleep(fine_depth_m: Option<f64>, half_length_m: Option<f64>) {
    let tets = rig(Integrator::Leapfrog);
    let mut spec = tets.spec.clone();
    for tool in &mut spec.tools {
        let capsule = |half_m| ToolShape::capsule(tool.coupling, tool.radius_m, half_m, DVec3::new(1.0, 0.5, 0.0));
        tool.shape = half_length_m.map_or(ToolShape::Sphere, capsule);
    }
    let surface = tets.model.surface();
    let positions = surface.nodes.iter().map(|&n| tets.model.rest_positions_m()[n as usize]).collect();
    let solid = solid_mut(&mut spec);
    solid.mesh = bricks(&even(-0.02, 0.02, 2), &even(-0.02, 0.02, 2), &even(-0.02, 0.0, 1));
    solid.tet_region = vec![0; solid.mesh.tets().len()];
    let particles = ParticleSpec {
        skin: Skin::new(positions, surface.triangles.clone()).unwrap(),
        spacing_m: 2e-3,
        fine_depth_m,
        smooth_skin: false,
        lattice_through_m: DVec3::ZERO,
        most_active: 300,
        waking: Waking::ByTools { reach_m: 7e-3 },
    };
    let mut spec = with_particles(spec, particles);
    spec.prescribed[0].nodes = nodes_where(mesh_of(&spec), |p| p.z < -0.0199);
    spec.loads[0] = LoadSpec::NodalForces(vec![(7, DVec3::X * 0.01)]);
    let mut rig = Rig::new(spec);
    let mut saved = rig.state.clone();
    saved.copy_from(&rig.state);
    let (mut sets, mut prestrained, mut count) = (0, 0, 0);
    assert_no_alloc(|| {
        for tick in 0..3000 {
            let factor = (f64::from(tick) * 0.003).sin();
            let input = TickInput {
                tools: &targets(tick),
                load_factors: &[factor; 3],
                prescribed_displacements_m: &[DVec3::X * 1e-3 * factor],
                point_forces: &[PointForce { node: tick % 50, force_n: DVec3::Z * 1e-3 }],
            };
            palpate_physics::step(&rig.model, &mut rig.state, &mut rig.scratch, &input);
            sets += u32::from(rig.state.body.active_particles().len() != count);
            count = rig.state.body.active_particles().len();
            prestrained += u32::from(!rig.state.body.as_hybrid().unwrap().prestrain().is_empty());
            if tick == 1500 {
                rig.state.reset(&rig.model);
            }
        }
    });
    assert!(rig.state.quarantine.is_none() && sets > 20 && prestrained > 100, "{sets} {prestrained}");
}

/// Falls asleep, sleeps, and wakes for a load.
#[test]
fn nor_does_sleep() {
    let mut spec = rig(Integrator::Leapfrog).spec;
    spec.settings.mass_damping_per_s = 60.0;
    spec.settings.sleep_tolerance_m = 1e-6;
    let mut rig = Rig::new(spec);
    let mut slept = 0;
    assert_no_alloc(|| {
        for tick in 0..3000 {
            let factor = if tick < 2000 { 0.0 } else { 1.0 };
            let input = TickInput {
                tools: &[at(DVec3::Z * 0.3), at(DVec3::Z * (0.3 + 1e-4 * f64::from(tick)))],
                load_factors: &[factor; 3],
                prescribed_displacements_m: &[DVec3::ZERO],
                point_forces: &[],
            };
            palpate_physics::step(&rig.model, &mut rig.state, &mut rig.scratch, &input);
            slept += u32::from(rig.state.sleep.asleep);
            assert!(!(2000..2050).contains(&tick) || !rig.state.sleep.asleep);
        }
    });
    assert!(slept > 200, "{slept}");
}

/// A hybrid falls asleep, sleeps while its tool comes, and wakes.
#[test]
fn nor_does_the_sleep_of_a_hybrid() {
    let mut spec = pressed_block(Precision::Single, None);
    spec.settings.sleep_tolerance_m = 1e-6;
    particles_mut(&mut spec).waking = Waking::ByTools { reach_m: 8e-3 };
    let mut rig = Rig::new(spec);
    let (mut slept, mut woke) = (0, 0);
    assert_no_alloc(|| {
        for tick in 0..4000 {
            let above_m = 0.03 - 0.026 * ((f64::from(tick) - 3000.0) / 500.0).clamp(0.0, 1.0);
            let input = TickInput {
                tools: &[at(DVec3::Z * above_m)],
                load_factors: &[],
                prescribed_displacements_m: &[DVec3::ZERO],
                point_forces: &[],
            };
            palpate_physics::step(&rig.model, &mut rig.state, &mut rig.scratch, &input);
            slept += u32::from(rig.state.sleep.asleep);
            woke += u32::from(!rig.state.body.active_particles().is_empty());
        }
    });
    assert!(slept > 200 && woke > 200, "{slept} {woke}");
}

fn ticks_allocate_nothing(integrator: Integrator, ticks: u32) {
    assert_eq!(run_without_allocating(rig(integrator), ticks), 0);
}

/// Returns how many ticks were repeated.
fn run_without_allocating(mut rig: Rig, ticks: u32) -> u32 {
    let mut repeated = 0;
    let (mut touched, mut far, mut poison) = (0, 0, 0);
    let mut saved = rig.state.clone();
    assert_no_alloc(|| {
        for tick in 0..ticks {
            let tools = targets(tick);
            let factor = (f64::from(tick) * 0.003).sin();
            // Now and then: a force that is not finite, a node that is not there, inputs of the wrong length.
            let odd = tick % 97 == 0;
            let forces = [
                PointForce { node: 40, force_n: if odd { DVec3::NAN } else { DVec3::X * 0.01 } },
                PointForce { node: if odd { u32::MAX } else { 41 }, force_n: DVec3::Y * 0.01 },
            ];
            let input = TickInput {
                tools: if odd { &[] } else { &tools },
                load_factors: &[factor, factor, factor],
                prescribed_displacements_m: &[DVec3::X * 1e-3 * factor],
                point_forces: &forces,
            };
            let report = palpate_physics::step(&rig.model, &mut rig.state, &mut rig.scratch, &input);
            assert!(report.quarantined.is_none());
            poison += report.inputs_rejected;
            repeated += report.repeated;
            touched += u32::from(rig.state.mechanical.tools.iter().any(|t| t.contacts > 0));
            far += u32::from(rig.state.mechanical.tools.iter().all(|t| t.contacts == 0));
            if tick == 1500 {
                saved.copy_from(&rig.state);
            }
        }
        rig.state.copy_from(&saved);
    });
    let least = ticks / 50;
    assert!(touched > 5 * least && far > 5 * least && poison > least, "{touched} {far} {poison}");
    repeated
}

#[test]
fn quarantine_and_reset_allocate_nothing() {
    let mut rig = rig(Integrator::Leapfrog);
    let mut quarantined = 0;
    assert_no_alloc(|| {
        for tick in 0..600 {
            let tools = targets(tick);
            let blow = [PointForce { node: 60, force_n: DVec3::Z * if tick % 100 == 50 { 1e300 } else { 0.0 } }];
            let input = TickInput {
                tools: &tools,
                load_factors: &[1.0, 1.0, 1.0],
                prescribed_displacements_m: &[DVec3::ZERO],
                point_forces: &blow,
            };
            let report = palpate_physics::step(&rig.model, &mut rig.state, &mut rig.scratch, &input);
            quarantined += u32::from(report.quarantined.is_some());
            if tick % 100 == 80 {
                rig.state.reset(&rig.model);
            }
        }
    });
    assert_eq!(quarantined, 6);
}

/// Walls that meet and part, of tets and of a body with particles.
#[test]
fn nor_do_walls_that_meet() {
    for spec in [gripped_clamp(SelfContactChoice::On), hybrid_clamp(SelfContactChoice::On)] {
        let mut rig = Rig::new(spec);
        let drives: Vec<rig::Drive> = (0..260).map(|tick| drive_of_walls(&rig, tick)).collect();
        let mut met = 0;
        assert_no_alloc(|| {
            for drive in &drives {
                rig.tick(drive);
                met += u32::from(rig.scratch.meeting_walls().vertices > 0);
            }
        });
        assert!(met > 20 && rig.state.quarantine.is_none(), "{met}");
    }
}

/// Squeezes a clamp by its sets or by its tools.
fn drive_of_walls(rig: &Rig, tick: u32) -> rig::Drive {
    if !rig.model.tools().is_empty() {
        return squeeze_hybrid(rig, 5.5e-3, tick);
    }
    let depth_m = 4e-3 * (std::f64::consts::PI * (f64::from(tick) / 200.0).min(1.0)).sin();
    rig::Drive { prescribed: vec![DVec3::ZERO, DVec3::Z * depth_m, DVec3::Z * -depth_m], ..rig.still() }
}
