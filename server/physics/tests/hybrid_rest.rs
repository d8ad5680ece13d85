//! Equilibria of bodies with particles: `solve_static` and `step` come to the same rest, and known answers.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, LoadSpec, Model, ModelSpec, Settings,
    bodies::hybrid::Waking,
    contact::Coupling,
    statics::{Goal, SolveError, StaticSettings, StaticSolution, solve_static},
    world::wake_only,
};
use rig::{
    Drive, Rig, at, held_below, hold, hybrid_block, mesh_of, nodes_where, particles, particles_mut, smooth, sphere,
};
use std::ops::ControlFlow;

/// 40 × 40 × 20 mm in 24 coarse tets, particles 2.5 mm apart, its upper face at z = 0.
fn block(waking: Waking) -> ModelSpec {
    let mut spec = hybrid_block((0.02, 1, 8), 0.45, 400, waking);
    spec.settings.mass_damping_per_s = 40.0;
    spec
}

fn skin_vertices(spec: &ModelSpec, wanted: impl Fn(DVec3) -> bool) -> Vec<u32> {
    let positions = particles(spec).skin.positions_m();
    (0..positions.len() as u32).filter(|&v| wanted(positions[v as usize])).collect()
}

fn skin_triangles(spec: &ModelSpec, wanted: impl Fn(DVec3) -> bool) -> Vec<u32> {
    let skin = &particles(spec).skin;
    (0..skin.triangles().len()).filter(|&t| skin.corners_m(t).into_iter().all(&wanted)).map(|t| t as u32).collect()
}

fn settings() -> StaticSettings {
    StaticSettings { relative_residual: 1e-12, ..StaticSettings::default() }
}

/// The largest distance (m) of the skin in time and in equilibrium, and the largest displacement.
fn apart_m(rig: &Rig, found: &StaticSolution) -> (f64, f64) {
    let (mut moving, mut still) = (Vec::new(), Vec::new());
    let rest = found.state(&rig.model, &vec![0.0; rig.model.loads().len()]);
    rig.model.surface_positions_m(&rig.state, &mut moving);
    rig.model.surface_positions_m(&rest, &mut still);
    let skin = rig.model.surface_rest_positions_m();
    let largest = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    (largest(&moving, &still), largest(&still, skin))
}

#[test]
fn loads_weight_and_moved_supports_come_to_the_same_rest_in_time() {
    loads_come_to_the_same_rest(held_below(block(Waking::ByHand)));
    loads_come_to_the_same_rest(smooth(held_below(block(Waking::ByHand))));
    loads_come_to_the_same_rest(held_across_the_lattice(0.7));
}

/// The block held below, where the held face lies so far (in spacings) above a plane of the lattice.
fn held_across_the_lattice(above: f64) -> ModelSpec {
    let mut spec = held_below(block(Waking::ByHand));
    let particles = particles_mut(&mut spec);
    particles.lattice_through_m = DVec3::Z * (-0.02 - above * particles.spacing_m);
    particles.most_active = 4000;
    spec
}

/// Pushed aside at its upper face, all of it awake, the block gives way alike wherever the held face lies between planes of the lattice, and in
/// the mean as where it lies in one. What followed free coarse nodes there was not held: the block gave way by much more.
#[test]
fn a_block_is_held_firmly_wherever_its_held_face_lies_in_the_lattice() {
    let aside_m = |above: f64| {
        let mut spec = held_across_the_lattice(above);
        let top = skin_triangles(&spec, |p| p.z > -1e-6);
        spec.loads = vec![LoadSpec::Traction { triangles: top, traction_pa: DVec3::X * 100.0 }];
        let model = Model::build(spec).unwrap();
        let partition = model.body().as_hybrid().unwrap().partition();
        let all: Vec<u32> = (0..partition.particle_count() as u32).collect();
        let goal = Goal {
            load_factors: &[1.0],
            prescribed_displacements_m: &[DVec3::ZERO],
            awake: Some(&all),
            ..Goal::default()
        };
        let found = solve_static(&model, &goal, &settings(), &mut |_| ControlFlow::Continue(())).unwrap();
        let held_n = found.reactions_n[0];
        assert!((held_n - DVec3::X * -0.16).length() < 1e-9, "{held_n}");
        let mut x = Vec::new();
        model.surface_positions_m(&found.state(&model, &[1.0]), &mut x);
        let moved = x.iter().zip(model.surface_rest_positions_m()).filter(|(_, rest)| rest.z > -1e-6);
        let moved: Vec<f64> = moved.map(|(x, rest)| x.x - rest.x).collect();
        moved.iter().sum::<f64>() / moved.len() as f64
    };
    let in_plane_m = aside_m(0.0);
    let parts = [0.1, 0.3, 0.5, 0.7, 0.9].map(|above| aside_m(above) / in_plane_m - 1.0);
    let mean = parts.iter().sum::<f64>() / 5.0;
    println!("{in_plane_m:.3e} m; off by {parts:.3?}, {mean:.3} in the mean");
    // By `held_particles` a block of eight spacings is up to e^{-1/2} of them too short, or as much as e^{1/2} - e^{-1/2} too long.
    assert!(mean.abs() < 0.02 && parts.iter().all(|part| (-0.1..0.15).contains(part)), "{parts:?}, {mean}");
}

fn loads_come_to_the_same_rest(mut spec: ModelSpec) {
    let pressed = skin_vertices(&spec, |p| p.length() < 5e-3);
    let force_n = DVec3::new(2e-3, 0.0, -2e-2) / pressed.len() as f64;
    let side = skin_triangles(&spec, |p| p.x > 0.02 - 1e-6 && p.z > -0.011);
    let top = skin_triangles(&spec, |p| p.z > -1e-6 && p.y < -0.004);
    spec.loads = vec![
        LoadSpec::NodalForces(pressed.iter().map(|&v| (v, force_n)).collect()),
        LoadSpec::Pressure { triangles: side, pressure_pa: 150.0, follower: true },
        LoadSpec::Traction { triangles: top, traction_pa: DVec3::new(0.0, 60.0, -50.0) },
    ];
    spec.gravity_m_per_s2 = DVec3::new(0.0, -1.0, -9.81);
    let mut rig = Rig::new(spec);
    let partition = rig.model.body().as_hybrid().unwrap().partition();
    let particles = 0..partition.particle_count() as u32;
    let awake: Vec<u32> = particles.filter(|&p| partition.particle_m(p).length() < 10e-3).collect();
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, awake.iter().copied());
    let drive =
        Drive { load_factors: vec![1.0, 1.0, -0.7], prescribed: vec![DVec3::new(1e-3, 0.0, 0.5e-3)], ..rig.still() };
    for _ in 0..2000 {
        assert!(rig.tick(&drive).quarantined.is_none());
    }
    let goal = Goal {
        load_factors: &drive.load_factors,
        prescribed_displacements_m: &drive.prescribed,
        awake: Some(&awake),
        ..Goal::default()
    };
    let found = solve_static(&rig.model, &goal, &settings(), &mut |_| ControlFlow::Continue(())).unwrap();
    assert_eq!(found.awake.ids, rig.state.body.active_particles());
    assert!(found.awake.ids.len() > 120 && found.stable && found.relative_residual <= 1e-12, "{found:?}");
    let (apart, moved) = apart_m(&rig, &found);
    println!("loads: {apart:.1e} m apart of {moved:.1e}, {} iterations", found.iterations);
    assert!(moved > 1e-3 && apart < 1e-9 * moved, "{apart:e} of {moved:e}");
    let held = rig.scratch.reactions_n().iter().sum::<DVec3>();
    assert!((held - found.reactions_n[0]).length() < 1e-8 * held.length(), "{held} {}", found.reactions_n[0]);
}

/// A sphere of 6 mm above the block, which weighs, with particles that it wakes.
fn pressed(coupling: Coupling, fine_depth_m: Option<f64>, smooth_skin: bool) -> Rig {
    let mut spec = held_below(block(Waking::ByTools { reach_m: 11e-3 }));
    particles_mut(&mut spec).fine_depth_m = fine_depth_m;
    particles_mut(&mut spec).smooth_skin = smooth_skin;
    spec.settings = Settings { mass_damping_per_s: 60.0, ..spec.settings };
    spec.tools = vec![sphere(6e-3, DVec3::new(0.4e-3, 0.3e-3, 9e-3), coupling)];
    spec.gravity_m_per_s2 = DVec3::Z * -9.81;
    Rig::new(spec)
}

fn solved(model: &Model, device_m: DVec3) -> StaticSolution {
    let moved = vec![DVec3::ZERO; model.prescribed().len()];
    solve_static(
        model,
        &Goal { prescribed_displacements_m: &moved, tools: &[at(device_m)], ..Goal::default() },
        &settings(),
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap()
}

fn a_tool_rests_where_the_loop_has_it(
    coupling: Coupling,
    (fine_depth_m, smooth_skin): (Option<f64>, bool),
    device_z_m: f64,
) -> StaticSolution {
    let mut rig = pressed(coupling, fine_depth_m, smooth_skin);
    let (start, device) = (DVec3::new(0.4e-3, 0.3e-3, 9e-3), DVec3::new(0.4e-3, 0.3e-3, device_z_m));
    for tick in 1..=2500 {
        rig.tick_at(start.lerp(device, (f64::from(tick) / 500.0).min(1.0)));
    }
    let found = solved(&rig.model, device);
    assert_eq!(
        found.awake.ids,
        rig.state.body.active_particles(),
        "{} {}",
        found.awake.ids.len(),
        rig.state.body.active_particles().len()
    );
    assert!(found.awake.ids.len() > 120 && found.stable && found.inverted_tets == 0, "{found:?}");
    let (apart, moved) = apart_m(&rig, &found);
    let (still, moving) = (found.tools[0], &rig.state.mechanical.tools[0]);
    let force = still.contact_force_n.distance(moving.contact_force_n) / still.contact_force_n.length();
    println!(
        "{coupling:?}: {:.4} N, {force:.1e} apart; skin {apart:.1e} m of {moved:.1e}, tool {:.1e} m; {} iterations, {} load steps, {} awake",
        still.contact_force_n.z,
        still.centre_m.distance(moving.centre_m),
        found.iterations,
        found.load_steps,
        found.awake.ids.len(),
    );
    assert!(apart < 1e-8 * moved && force < 1e-8, "{apart:e} {force:e}");
    assert!(still.centre_m.distance(moving.centre_m) < 1e-8 * moved);
    assert_eq!(still.contacts, moving.contacts);
    // The table carries the weight and what the tool gives.
    let weight_n = 0.04 * 0.04 * 0.02 * 1000.0 * 9.81;
    let sum = found.reactions_n[0] - still.device_force_n - DVec3::Z * weight_n;
    assert!(sum.length() < 1e-9 * still.contact_force_n.length(), "{sum}");
    let energies = Energies::of(&rig.model, &found.state(&rig.model, &[]));
    let in_time = Energies::of(&rig.model, &rig.state);
    assert!((energies.elastic_j / in_time.elastic_j - 1.0).abs() < 1e-7, "{energies:?} {in_time:?}");
    found
}

#[test]
fn a_rigid_tool_wakes_what_it_would_in_the_loop_and_rests_as_there() {
    for of_block in [(None, false), (Some(2.5e-3), false), (None, true), (Some(2.5e-3), true)] {
        let found = a_tool_rests_where_the_loop_has_it(Coupling::Rigid, of_block, 5e-3);
        assert!(found.tools[0].contact_force_n.z > 0.02);
    }
}

#[test]
fn a_tool_on_a_spring_too() {
    let (mass_kg, stiffness_n_per_m) = (0.02_f64, 100.0);
    let damping_n_s_per_m = 2.0 * (stiffness_n_per_m * mass_kg).sqrt();
    let spring = Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg };
    for smooth_skin in [false, true] {
        let found = a_tool_rests_where_the_loop_has_it(spring, (None, smooth_skin), 4e-3);
        assert!((found.tools[0].contact_force_n - found.tools[0].device_force_n).length() < 1e-10);
    }
}

/// Uniaxial stress of the stable neo-Hookean law: the transverse stretch that frees the sides, and `P` along (Pa).
fn uniaxial_pa(spec: &ModelSpec, stretch: f64) -> (f64, f64) {
    let material = &spec.body.solid().unwrap().regions[0].material;
    let piola = |t: f64| material.piola(&glam::DMat3::from_diagonal(DVec3::new(t, t, stretch)));
    let (mut low, mut high) = (0.5_f64, 1.5_f64);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if piola(middle).x_axis.x > 0.0 { high = middle } else { low = middle }
    }
    (low, piola(low).z_axis.z)
}

/// A block on rollers, pulled by dead forces: uniform stretch by a fifth, whichever particles are awake.
#[test]
fn a_block_under_traction_stretches_uniformly() {
    for awake in [0, 400] {
        let mut spec = block(Waking::ByHand);
        let on = |wanted: fn(DVec3) -> bool| nodes_where(mesh_of(&spec), wanted);
        let [below, left, front] = [on(|p| p.z < -0.02 + 1e-6), on(|p| p.x < -0.02 + 1e-6), on(|p| p.y < -0.02 + 1e-6)];
        spec.prescribed = vec![
            hold("below", below, [false, false, true]),
            hold("left", left, [true, false, false]),
            hold("front", front, [false, true, false]),
        ];
        let (across, along_pa) = uniaxial_pa(&spec, 1.2);
        // What a uniform traction gives the corners of squares; that of triangles depends on how they are cut.
        let width_m = |x: f64| if x.abs() > 0.02 - 1e-6 { 1.25e-3 } else { 2.5e-3 };
        let skin = particles(&spec).skin.positions_m().to_vec();
        let force = |v: u32| DVec3::Z * (along_pa * width_m(skin[v as usize].x) * width_m(skin[v as usize].y));
        let top = skin_vertices(&spec, |p| p.z > -1e-6);
        spec.loads = vec![LoadSpec::NodalForces(top.into_iter().map(|v| (v, force(v))).collect())];
        let model = Model::build(spec).unwrap();
        let partition = model.body().as_hybrid().unwrap().partition();
        let inner = |&p: &u32| partition.particle_m(p).distance(DVec3::new(2e-3, 1e-3, -9e-3)) < 8e-3;
        let ids: Vec<u32> = (0..partition.particle_count() as u32).filter(inner).take(awake).collect();
        let goal = Goal {
            load_factors: &[1.0],
            prescribed_displacements_m: &[DVec3::ZERO; 3],
            awake: Some(&ids),
            ..Goal::default()
        };
        let found = solve_static(&model, &goal, &settings(), &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(found.awake.ids.is_empty(), awake == 0);
        let corner = DVec3::new(-0.02, -0.02, -0.02);
        let expected = |rest: DVec3| corner + (rest - corner) * DVec3::new(across, across, 1.2);
        let mut positions = Vec::new();
        model.surface_positions_m(&found.state(&model, &[1.0]), &mut positions);
        let rest = model.surface_rest_positions_m();
        let worst = positions.iter().zip(rest).map(|(x, rest)| x.distance(expected(*rest))).fold(0.0, f64::max);
        println!("{} awake: worst of any vertex {worst:.1e} m of a stretch by 4 mm", found.awake.ids.len());
        assert!(worst < 1e-9 * 4e-3, "{worst:e}");
    }
}

#[test]
fn a_load_on_a_spot_wakes_particles_and_one_on_all_of_a_face_does_not() {
    let reach_m = 8e-3;
    let with = |loaded: &dyn Fn(DVec3) -> bool, factor: f64| {
        let mut spec = held_below(block(Waking::ByTools { reach_m }));
        let triangles = skin_triangles(&spec, loaded);
        spec.loads = vec![LoadSpec::Traction { triangles, traction_pa: DVec3::Z * -100.0 }];
        let model = Model::build(spec).unwrap();
        let found = solve_static(
            &model,
            &Goal { load_factors: &[factor], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
            &settings(),
            &mut |_| ControlFlow::Continue(()),
        );
        (found.unwrap().awake, model)
    };
    let spot = |p: DVec3| p.z > -1e-6 && p.length() < 5e-3;
    let (awake, model) = with(&spot, 1.0);
    assert!((100..=400).contains(&awake.ids.len()) && awake.spread_loads == 0, "{}", awake.ids.len());
    let particle_m = |id: &u32| model.body().as_hybrid().unwrap().partition().particle_m(*id);
    let farthest = awake.ids.iter().map(|id| particle_m(id).length()).fold(0.0, f64::max);
    assert!(farthest <= 5e-3 + reach_m, "{farthest}");
    assert_eq!(with(&spot, 0.0).0.ids.len(), 0);
    let wide = with(&|p| p.z > -1e-6, 1.0).0;
    assert_eq!((wide.ids.len(), wide.spread_loads), (0, 1));
}

#[test]
fn what_is_not_held_or_not_to_be_reached_is_refused() {
    let go_on = &mut |_: &_| ControlFlow::Continue(());
    let free = Model::build(block(Waking::ByHand)).unwrap();
    let error = solve_static(&free, &Goal::default(), &settings(), go_on).unwrap_err();
    assert!(matches!(error, SolveError::UnderConstrained { ref motions, .. } if motions.len() == 6), "{error}");
    let past = Model::build(held_below(block(Waking::ByHand))).unwrap();
    let error =
        solve_static(&past, &Goal { prescribed_displacements_m: &[DVec3::NAN], ..Goal::default() }, &settings(), go_on)
            .unwrap_err();
    assert!(matches!(error, SolveError::InputNotFinite { .. }), "{error}");
    let stop = &mut |_: &_| ControlFlow::Break(());
    let error = solve_static(
        &past,
        &Goal { prescribed_displacements_m: &[DVec3::X * 1e-3], ..Goal::default() },
        &settings(),
        stop,
    )
    .unwrap_err();
    assert!(matches!(error, SolveError::Cancelled { .. }), "{error}");
}
