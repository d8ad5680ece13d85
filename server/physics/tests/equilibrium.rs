//! The static solve: known equilibria, agreement with the dynamics, and errors that say what is wrong.
#![allow(clippy::unwrap_used)]
use crate::common;
use common::{block, equilibrium, held, material, mean_displacement_m, nodes_where, spec, triangles_where};
use glam::DVec3;
use palpate_physics::{
    LoadSpec, Model, Precision, PrescribedSpec, Scratch, State, Substeps, TetMesh, TickInput,
    elements::rigid_motion::RigidMotion,
    material::Law,
    statics::{Goal, SolveError, StaticSettings, solve_static},
    step,
};
use std::ops::ControlFlow;

const YOUNG_PA: f64 = 10e3;

/// Three planes of symmetry hold a unit of material in uniaxial stress.
fn symmetry_planes(mesh: &TetMesh) -> Vec<PrescribedSpec> {
    vec![
        held(mesh, "x = 0", [true, false, false], |p| p.x == 0.0),
        held(mesh, "y = 0", [false, true, false], |p| p.y == 0.0),
        held(mesh, "z = 0", [false, false, true], |p| p.z == 0.0),
    ]
}

#[test]
fn stvk_uniaxial_stress_by_displacement() {
    let mesh = block(DVec3::splat(0.1), [3, 2, 2]);
    let mut prescribed = symmetry_planes(&mesh);
    prescribed.push(held(&mesh, "pulled", [true, false, false], |p| p.x == 0.1));
    let model = Model::build(spec(mesh, material(Law::StVenantKirchhoff, YOUNG_PA, 0.3), prescribed, vec![])).unwrap();
    for (stretch, expected) in [(0.8, -0.144), (1.2, 0.264), (1.5, 0.9375)] {
        let moved = DVec3::X * (0.1 * (stretch - 1.0));
        let found = equilibrium(&model, 1.0, &[DVec3::ZERO, DVec3::ZERO, DVec3::ZERO, moved]);
        let stress_over_young = found.reactions_n[3].x / (0.01 * YOUNG_PA);
        println!("StVK uniaxial s = {stretch}: P/E = {stress_over_young:.12}, expected {expected}");
        assert!((stress_over_young - expected).abs() < 1e-12);
        // What is pulled on one side is held on the other.
        assert!((found.reactions_n[0].x + found.reactions_n[3].x).abs() < 1e-10 * found.reactions_n[3].x.abs());
        // E_yy = −ν E_xx.
        let lateral = (1.0 - 0.3 * (stretch * stretch - 1.0_f64)).sqrt();
        let side = nodes_where(model.body().tets().unwrap(), |p| p.y == 0.1);
        let moved = mean_displacement_m(&model, &found.x, &side).y;
        assert!((moved / 0.1 + 1.0 - lateral).abs() < 1e-11);
    }
}

#[test]
fn stvk_uniaxial_stress_by_dead_traction() {
    let mesh = block(DVec3::splat(0.1), [3, 2, 2]);
    let end = triangles_where(&mesh, |p| p.x == 0.1);
    let loads = vec![LoadSpec::Traction { triangles: end, traction_pa: DVec3::X * 0.264 * YOUNG_PA }];
    let prescribed = symmetry_planes(&mesh);
    let model = Model::build(spec(mesh, material(Law::StVenantKirchhoff, YOUNG_PA, 0.3), prescribed, loads)).unwrap();
    let found = equilibrium(&model, 1.0, &[]);
    let end = nodes_where(model.body().tets().unwrap(), |p| p.x == 0.1);
    assert!((mean_displacement_m(&model, &found.x, &end).x - 0.02).abs() < 1e-11);
    assert!(found.stable);
    let last: Vec<f64> = found.history.iter().map(|p| p.relative_residual).collect();
    println!("StVK traction: relative residuals {last:?}, {} factorisations", found.factorisations);
}

/// A clamped block under gravity and a side load, brought to rest by leapfrog with mass damping.
fn at_rest_by_dynamics(law: Law, precision: Precision) -> (f64, f64) {
    let mesh = block(DVec3::new(0.06, 0.03, 0.03), [4, 2, 2]);
    let end = triangles_where(&mesh, |p| p.x == 0.06);
    let side = triangles_where(&mesh, |p| p.z == 0.0);
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let loads = vec![
        LoadSpec::Traction { triangles: end, traction_pa: DVec3::new(20.0, 60.0, 0.0) },
        LoadSpec::Pressure { triangles: side, pressure_pa: 100.0, follower: true },
    ];
    let mut wanted = spec(mesh, material(law, YOUNG_PA, 0.45), prescribed, loads);
    wanted.gravity_m_per_s2 = DVec3::new(0.0, 0.0, -9.81);
    wanted.settings.precision = precision;
    // ω_max is about 2c/h ≈ 1 000 rad/s · slivers: 0.2 ms is stable with room.
    wanted.settings.substeps = Substeps::Fixed(8);
    wanted.settings.mass_damping_per_s = 60.0;
    let model = Model::build(wanted).unwrap();
    let found = equilibrium(&model, 1.0, &[]);
    let mut state = State::at_rest(&model);
    let mut scratch = Scratch::new(&model);
    let input = TickInput {
        tools: &[],
        load_factors: &[1.0, 1.0],
        prescribed_displacements_m: &[DVec3::ZERO],
        point_forces: &[],
    };
    for _ in 0..1500 {
        assert_eq!(step(&model, &mut state, &mut scratch, &input).quarantined, None);
    }
    let apart = state.mechanical.x.iter().zip(&found.x).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let moved = found.x.iter().zip(model.rest_positions_m()).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    let reactions = scratch.reactions_n().iter().sum::<DVec3>();
    assert!(
        (reactions - found.reactions_n[0]).length() < 1e-4 * reactions.length(),
        "{reactions} {:?}",
        found.reactions_n
    );
    (apart, moved)
}

#[test]
fn dynamics_come_to_rest_at_the_static_equilibrium() {
    for law in Law::ALL {
        let name = law.name();
        for (precision, bound) in [(Precision::Double, 1e-12), (Precision::Single, 1e-6)] {
            let (apart, moved) = at_rest_by_dynamics(law, precision);
            println!(
                "{name}, {precision:?}: moved {moved:.3e} m, static and dynamic differ by {apart:.2e} m of 0.06 m"
            );
            assert!(moved > 1e-3, "{name}: the load must matter");
            assert!(apart < bound * 0.06, "{name} {precision:?}: {apart:e}");
        }
    }
}

#[test]
fn what_is_free_to_move_is_named() {
    let free = |prescribed: fn(&TetMesh) -> Vec<PrescribedSpec>| {
        let mesh = block(DVec3::splat(0.1), [1, 1, 1]);
        let prescribed = prescribed(&mesh);
        let moved = vec![DVec3::ZERO; prescribed.len()];
        let model = Model::build(spec(mesh, material(Law::default(), YOUNG_PA, 0.3), prescribed, vec![])).unwrap();
        let settings = StaticSettings::default();
        solve_static(&model, &Goal { prescribed_displacements_m: &moved, ..Goal::default() }, &settings, &mut |_| {
            ControlFlow::Continue(())
        })
        .unwrap_err()
    };
    let SolveError::UnderConstrained { motions, .. } = free(|_| vec![]) else { panic!() };
    assert_eq!(motions.len(), 6);
    let error = free(|mesh| vec![held(mesh, "floor", [false, false, true], |p| p.z == 0.0)]);
    let message = error.to_string();
    println!("{message}");
    for part in ["move along x", "move along y", "turn about z"] {
        assert!(message.contains(part), "{message}");
    }
    // Held at one edge: a hinge about it.
    let SolveError::UnderConstrained { motions, .. } =
        free(|mesh| vec![held(mesh, "edge", [true; 3], |p| p.x == 0.0 && p.y == 0.0)])
    else {
        panic!()
    };
    let [RigidMotion::Rotation { axis, through_m, pitch_m }] = motions[..] else { panic!("{motions:?}") };
    assert!(axis.cross(DVec3::Z).length() < 1e-9 && through_m.truncate().length() < 1e-9 && pitch_m.abs() < 1e-9);
}

#[test]
fn a_loose_part_is_found() {
    let one = block(DVec3::splat(0.1), [1, 1, 1]);
    let shifted = one.positions_m().iter().map(|p| *p + DVec3::X);
    let positions: Vec<DVec3> = one.positions_m().iter().copied().chain(shifted).collect();
    let tets = one.tets().iter().copied().chain(one.tets().iter().map(|t| t.map(|n| n + 8))).collect();
    let mesh = TetMesh::new(positions, tets).unwrap();
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let model = Model::build(spec(mesh, material(Law::default(), YOUNG_PA, 0.3), prescribed, vec![])).unwrap();
    let settings = StaticSettings::default();
    let error = solve_static(
        &model,
        &Goal { prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap_err();
    let SolveError::UnderConstrained { node, motions } = error else { panic!("{error}") };
    assert_eq!((node, motions.len()), (8, 6));
}

#[test]
fn bad_arguments_and_a_stop_are_errors() {
    let mesh = block(DVec3::splat(0.1), [1, 1, 1]);
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let loads = vec![LoadSpec::NodalForces(vec![(7, DVec3::X)])];
    let model = Model::build(spec(mesh, material(Law::default(), YOUNG_PA, 0.3), prescribed, loads)).unwrap();
    let settings = StaticSettings::default();
    let mut go = |_: &_| ControlFlow::Continue(());
    let error = solve_static(
        &model,
        &Goal { prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
        &settings,
        &mut go,
    )
    .unwrap_err();
    assert_eq!(error, SolveError::InputLength { what: "load factors", found: 0, expected: 1 });
    let error = solve_static(
        &model,
        &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::NAN], ..Goal::default() },
        &settings,
        &mut go,
    )
    .unwrap_err();
    assert_eq!(error, SolveError::InputNotFinite { what: "prescribed displacement", index: 0 });
    let loose = StaticSettings { relative_residual: 0.0, ..settings };
    assert!(matches!(
        solve_static(
            &model,
            &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
            &loose,
            &mut go
        ),
        Err(SolveError::Setting { .. })
    ));
    let error = solve_static(
        &model,
        &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Break(()),
    )
    .unwrap_err();
    assert_eq!(error, SolveError::Cancelled { load_fraction: 1.0 });
    // A load that no body can carry in f64.
    let error = solve_static(
        &model,
        &Goal { load_factors: &[f64::MAX], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
        &settings,
        &mut go,
    )
    .unwrap_err();
    println!("{error}");
    assert!(matches!(error, SolveError::NoConvergence { .. } | SolveError::NonFinite { .. }));
}

#[test]
fn an_unloaded_body_stays_where_it_is() {
    let mesh = block(DVec3::splat(0.1), [2, 2, 2]);
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let model = Model::build(spec(mesh, material(Law::default(), YOUNG_PA, 0.3), prescribed, vec![])).unwrap();
    let found = equilibrium(&model, 1.0, &[]);
    assert_eq!(found.x, model.rest_positions_m());
    // To see that it is stable.
    assert!(found.stable && found.factorisations == 1);
}

#[test]
fn a_stvk_column_past_its_limit_point_is_reported_inverted() {
    // P/E has its minimum −0.19245 at s = 1/√3; no equilibrium carries −0.25 upright.
    let mesh = block(DVec3::splat(0.1), [1, 1, 1]);
    let end = triangles_where(&mesh, |p| p.x == 0.1);
    let loads = vec![LoadSpec::Traction { triangles: end, traction_pa: DVec3::X * -0.25 * YOUNG_PA }];
    let prescribed = symmetry_planes(&mesh);
    let model = Model::build(spec(mesh, material(Law::StVenantKirchhoff, YOUNG_PA, 0.0), prescribed, loads)).unwrap();
    let settings = StaticSettings { load_steps: 10, ..StaticSettings::default() };
    let moved = [DVec3::ZERO; 3];
    let found = solve_static(
        &model,
        &Goal { load_factors: &[1.0], prescribed_displacements_m: &moved, ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap();
    // The only equilibrium left is turned inside out, ½s(s² − 1) = −0.25: found, and reported as inverted.
    let end = nodes_where(model.body().tets().unwrap(), |p| p.x == 0.1);
    let s = 1.0 + mean_displacement_m(&model, &found.x, &end).x / 0.1;
    println!("StVK past its limit point snaps to s = {s:.6}");
    assert!(s < -1.0 && (0.5 * s * (s * s - 1.0) + 0.25).abs() < 1e-9, "{s}");
    assert_eq!(found.inverted_tets, 6);
}

/// The flag was that of the last factorisation, wherever that had been: at an earlier position, or nowhere.
#[test]
fn a_column_compressed_past_its_buckling_load_is_an_unstable_equilibrium() {
    let mesh = block(DVec3::new(0.1, 0.01, 0.01), [20, 2, 2]);
    let prescribed =
        vec![held(&mesh, "foot", [true; 3], |p| p.x == 0.0), held(&mesh, "head", [true; 3], |p| p.x > 0.099_999)];
    let model = Model::build(spec(mesh, material(Law::StableNeoHookean, YOUNG_PA, 0.3), prescribed, vec![])).unwrap();
    // Clamped at both ends: it buckles at a strain of π²h²/3L² = 3.3 %; two tets across it are too stiff in bending.
    for (strain, stable) in [(0.01, true), (0.1, false)] {
        let found = equilibrium(&model, 1.0, &[DVec3::ZERO, DVec3::X * (-0.1 * strain)]);
        let aside =
            found.x.iter().zip(model.rest_positions_m()).map(|(x, rest)| (x.z - rest.z).abs()).fold(0.0, f64::max);
        println!("compressed by {strain}: stable {}, {aside:.1e} m aside, {:?}", found.stable, found.reactions_n[1]);
        assert!(aside < 1e-3, "still straight");
        assert_eq!(found.stable, stable);
    }
}

/// With settings that let only the smallest steps succeed, the load was raised for ever.
#[test]
fn a_load_is_raised_in_a_bounded_number_of_steps() {
    let mesh = block(DVec3::splat(0.1), [1, 1, 1]);
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let end = triangles_where(&mesh, |p| p.x == 0.1);
    let loads = vec![LoadSpec::Traction { triangles: end, traction_pa: DVec3::Z * 2e3 }];
    let model = Model::build(spec(mesh, material(Law::StableNeoHookean, YOUNG_PA, 0.3), prescribed, loads)).unwrap();
    let stopped = |max_iterations, max_halvings| {
        let settings = StaticSettings { relative_residual: 1e-10, max_iterations, load_steps: 1, max_halvings };
        let mut calls = 0;
        let error = solve_static(
            &model,
            &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
            &settings,
            &mut |_| {
                calls += 1;
                ControlFlow::Continue(())
            },
        )
        .unwrap_err();
        println!("{calls} iterations: {error}");
        (error, calls)
    };
    let (error, calls) = stopped(1, 40);
    let SolveError::TooManySteps { reached_fraction, failed } = error else { panic!("{error}") };
    assert!(reached_fraction > 0.0 && reached_fraction < 1.0 && failed > 0 && calls <= 20_000);
    let (error, calls) = stopped(1, 3);
    assert!(matches!(error, SolveError::NoConvergence { reached_fraction: 0.0, .. }) && calls <= 10, "{error}");
}
