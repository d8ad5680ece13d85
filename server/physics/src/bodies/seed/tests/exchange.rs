//! Tests of the exchange between particles, core and skin.
use super::{ball, ball_with, press, touched};
use crate::{
    bodies::seed::{Exchange, Motion, SeedContact, SeedModel, SeedScratch, SeedState, exchange},
    testing::Random,
};
use glam::{DQuat, DVec3};

/// Returns a state in which everything moves.
fn stirred(model: &SeedModel) -> SeedState {
    let (mut state, mut scratch) = (SeedState::at_rest(model), SeedScratch::new(model));
    let contact = SeedContact { triangle: Some(touched(model).0), ..SeedContact::default() };
    model.step(&mut state, &mut scratch, &contact);
    let mut random = Random(21);
    for motion in [&mut state.core, &mut state.particles] {
        for (x, v) in motion.x.iter_mut().zip(&mut motion.v) {
            (*x, *v) = (*x + random.vector() * 5e-4, random.vector() * 0.01);
        }
    }
    state
}

#[test]
fn repaired_exchange_conserves_linear_momentum_and_closes_the_gap() {
    let model = ball_with(|spec| spec.held_nodes.clear());
    let mass = model.layer().unwrap().mass_kg;
    let mut state = stirred(&model);
    let before = model.momentum_kg_m_per_s(&state);
    let start = state.clone();
    exchange::tie(model.core(), touched(&model).1, mass, model.parameters().dt_s, &mut state);
    let given: f64 = state
        .core
        .v
        .iter()
        .zip(&start.core.v)
        .zip(model.core().mass_kg())
        .map(|((a, b), m)| (*a - *b).length() * m)
        .sum();
    let change = model.momentum_kg_m_per_s(&state) - before;
    println!("momentum passed {given:.2e}, lost {:.1e} kg m/s", change.length());
    assert!(given > 1e-9 && change.length() < 1e-12 * given.max(before.length()));
    // Positions moved by what the velocities did: the mass centre stays.
    let moved = state.core.x.iter().zip(&start.core.x).zip(model.core().mass_kg()).map(|((a, b), m)| (*a - *b) * *m);
    let core: DVec3 = moved.sum();
    let particles: DVec3 = state.particles.x.iter().zip(&start.particles.x).map(|(a, b)| (*a - *b) * mass).sum();
    assert!((core + particles).length() < 1e-12 * core.length());
}

#[test]
fn printed_exchange_makes_momentum_from_displacements() {
    let model = ball_with(|spec| {
        spec.held_nodes.clear();
        spec.parameters.exchange = Exchange::Displacements;
    });
    let region = touched(&model).1;
    let (mass, dt_s) = (model.layer().unwrap().mass_kg, model.parameters().dt_s);
    // One particle crosses by 0.1 mm.
    let crossing = region.on_core[0].slot as usize;
    let step = DVec3::new(0.0, 0.0, 1e-4);
    let mut x = model.core().rest_m().to_vec();
    let mut sums = vec![(DVec3::ZERO, 0.0); x.len()];
    exchange::nodes_follow(model.core(), region, |slot| (slot == crossing).then_some(step), &mut sums, &mut x);
    let moved =
        x.iter().zip(model.core().rest_m()).zip(model.core().mass_kg()).map(|((a, b), m)| (*a - *b) * (m / dt_s));
    let gained: DVec3 = moved.sum();
    let brought = step * (mass / dt_s);
    let ratio = gained.length() / brought.length();
    println!("the nodes take on {ratio:.0} times the momentum that the particle brings");
    assert!(ratio > 50.0);
    // Every corner of the face moves by all of the step, whatever its weight.
    let face = model.core().outer_triangles()[region.on_core[0].attachment.triangle as usize];
    for node in face {
        assert!((x[node as usize] - model.core().rest_m()[node as usize] - step).length() < 1e-15);
    }
}

#[test]
fn links_are_free_at_rest_and_in_translation_and_resist_rotation() {
    let model = ball();
    let (core, links) = (model.core().rest_m(), model.links().unwrap());
    let skin = model.surface_rest_m();
    let still = vec![DVec3::ZERO; core.len()];
    let forces = |moved: &dyn Fn(DVec3) -> DVec3, speed: DVec3| -> Vec<DVec3> {
        let nodes: Vec<DVec3> = core.iter().map(|&x| moved(x)).collect();
        let speeds: Vec<DVec3> = still.iter().map(|_| speed).collect();
        let core = Motion { x: nodes, v: speeds };
        (0..skin.len()).map(|vertex| links.force_n(vertex, moved(skin[vertex]), speed, &core)).collect()
    };
    let largest = |forces: &[DVec3]| forces.iter().map(|f| f.length()).fold(0.0, f64::max);
    assert!(largest(&forces(&|x| x, DVec3::ZERO)) < 1e-15);
    assert!(largest(&forces(&|x| x + DVec3::new(0.1, 0.2, -0.3), DVec3::new(1.0, 2.0, 3.0))) < 1e-15);
    let angle = 0.1;
    let turned = forces(&|x| DQuat::from_rotation_z(angle) * x, DVec3::ZERO);
    let mut torque = DVec3::ZERO;
    let mut expected = 0.0;
    for (vertex, force) in turned.iter().enumerate() {
        // f = −k (R − I) o
        let offset = links.offset_m[vertex];
        let away = DQuat::from_rotation_z(angle) * offset - offset;
        assert!((*force + away * links.stiffness_n_per_m[vertex]).length() < 1e-12);
        // The torque is about the attachment point, which the reaction passes through.
        let turned_offset = DQuat::from_rotation_z(angle) * offset;
        torque += turned_offset.cross(*force);
        expected -= links.stiffness_n_per_m[vertex] * offset.truncate().length_squared() * angle.sin();
    }
    println!("torque {:.3e} N m at 0.1 rad", torque.z);
    assert!((torque.z / expected - 1.0).abs() < 1e-9 && torque.z < -1e-7);
}

/// Particles are free within half a voxel: until they cross, the printed exchange leaves an awake region without
/// support. A press of 1 mm, which is less, only pushes the region before it.
#[test]
fn only_the_repaired_exchange_supports_the_layer_from_below() {
    let late = |exchange| {
        let model = ball_with(|spec| spec.parameters.exchange = exchange);
        press(&model, 1e-3, 500).0[5..].iter().sum::<f64>() / 5.0
    };
    let (impulses, displacements) = (late(Exchange::Impulses), late(Exchange::Displacements));
    println!("mean force of the second half: {:.2} µN tied, {:.2} µN as printed", impulses * 1e6, displacements * 1e6);
    assert!(impulses > 0.0 && displacements.abs() < 0.1 * impulses);
}
