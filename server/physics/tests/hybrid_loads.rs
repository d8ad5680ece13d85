//! Whatever presses, wakes. Loads and injected forces met coarse tets alone in the loop: 0.02 N on a patch bent it by 12 to
//! 46 % less than at rest in `static`, and a load per vertex woke less in `static` than one load on the region.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    LoadSpec, ModelSpec, PointForce,
    bodies::hybrid::Waking,
    statics::{Goal, StaticSettings, StaticSolution, solve_static},
};
use rig::{Drive, Rig, held_below, hybrid_block, particles};
use std::ops::ControlFlow;

const FORCE_N: DVec3 = DVec3::new(0.0, 0.0, -0.02);

/// 40 × 40 × 20 mm in 24 coarse tets, particles 2.5 mm apart, its upper face at z = 0.
fn block() -> ModelSpec {
    let mut spec = held_below(hybrid_block((0.02, 1, 8), 0.45, 400, Waking::ByTools { reach_m: 0.012 }));
    spec.settings.mass_damping_per_s = 60.0;
    spec
}

fn patch(spec: &ModelSpec) -> Vec<u32> {
    let positions = particles(spec).skin.positions_m();
    (0..positions.len() as u32).filter(|&v| positions[v as usize].length() < 4e-3).collect()
}

fn of_patch(patch: &[u32]) -> Vec<(u32, DVec3)> {
    patch.iter().map(|&vertex| (vertex, FORCE_N / patch.len() as f64)).collect()
}

fn at_rest(rig: &Rig, load_factors: &[f64]) -> StaticSolution {
    let goal = Goal { load_factors, prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() };
    solve_static(&rig.model, &goal, &StaticSettings::default(), &mut |_| ControlFlow::Continue(())).unwrap()
}

/// How far (m) the patch has moved down, in the mean.
fn dent_m(rig: &Rig, state: &palpate_physics::State, patch: &[u32]) -> f64 {
    let mut surface_m = Vec::new();
    rig.model.surface_positions_m(state, &mut surface_m);
    let rest_m = rig.model.surface_rest_positions_m();
    let surface = rig.model.surface();
    let down = |&vertex: &u32| {
        let number = surface.vertex_of_node[vertex as usize] as usize;
        rest_m[vertex as usize].z - surface_m[number].z
    };
    patch.iter().map(down).sum::<f64>() / patch.len() as f64
}

#[test]
fn a_load_comes_to_the_rest_that_static_finds_and_wakes_in_its_first_ticks() {
    let mut spec = block();
    let patch = patch(&spec);
    spec.loads = vec![LoadSpec::NodalForces(of_patch(&patch))];
    let mut rig = Rig::new(spec);
    let drive = Drive { load_factors: vec![1.0], ..rig.still() };
    for tick in 0..600 {
        assert!(rig.tick(&drive).quarantined.is_none());
        assert!(tick < 2 || rig.state.body.active_particles().len() > 100, "tick {tick}");
    }
    let found = at_rest(&rig, &[1.0]);
    assert_eq!(found.awake.ids, rig.state.body.active_particles());
    let rest_m = dent_m(&rig, &found.state(&rig.model, &[1.0]), &patch);
    let in_time_m = dent_m(&rig, &rig.state, &patch);
    assert!((in_time_m / rest_m - 1.0).abs() < 0.01 && rest_m > 2e-4, "{in_time_m} {rest_m}");
}

#[test]
fn many_loads_on_one_place_answer_as_one() {
    let mut spec = block();
    let patch = patch(&spec);
    spec.loads = vec![LoadSpec::NodalForces(of_patch(&patch))];
    let one = Rig::new(spec.clone());
    spec.loads = of_patch(&patch).into_iter().map(|force| LoadSpec::NodalForces(vec![force])).collect();
    let many = Rig::new(spec);
    let factors = vec![1.0; patch.len()];
    let (of_one, of_many) = (at_rest(&one, &[1.0]), at_rest(&many, &factors));
    assert!(of_one.awake.ids.len() > 100 && patch.len() > 5);
    assert_eq!(of_one.awake.ids, of_many.awake.ids);
    let dents_m = [
        dent_m(&one, &of_one.state(&one.model, &[1.0]), &patch),
        dent_m(&many, &of_many.state(&many.model, &factors), &patch),
    ];
    assert!((dents_m[1] / dents_m[0] - 1.0).abs() < 1e-6, "{dents_m:?}");
}

#[test]
fn injected_forces_wake_as_loads_do_and_what_they_woke_falls_asleep() {
    let mut spec = block();
    let patch = patch(&spec);
    spec.loads = vec![LoadSpec::NodalForces(of_patch(&patch))];
    let (mut loaded, mut injected) = (Rig::new(spec.clone()), Rig::new(spec));
    let load = Drive { load_factors: vec![1.0], ..loaded.still() };
    let points = of_patch(&patch).into_iter().map(|(node, force_n)| PointForce { node, force_n }).collect();
    let inject = Drive { point_forces: points, ..injected.still() };
    for _ in 0..600 {
        loaded.tick(&load);
        assert!(injected.tick(&inject).quarantined.is_none());
    }
    assert_eq!(loaded.state.body.active_particles(), injected.state.body.active_particles());
    let dents_m = [dent_m(&loaded, &loaded.state, &patch), dent_m(&injected, &injected.state, &patch)];
    assert!((dents_m[1] / dents_m[0] - 1.0).abs() < 1e-3, "{dents_m:?}");
    let still = injected.still();
    for _ in 0..600 {
        injected.tick(&still);
    }
    assert_eq!(injected.state.body.active_particles().len(), 0);
    assert!(dent_m(&injected, &injected.state, &patch).abs() < 1e-3 * dents_m[0]);
}

/// A load that is taken away, far from one that stays, and a pressure on all of the upper face, which is spread wide.
#[test]
fn loads_apart_share_the_room_and_a_wide_one_takes_none() {
    let mut spec = block();
    let positions = particles(&spec).skin.positions_m().to_vec();
    let around = |x: f64| {
        let middle = DVec3::new(x, 0.0, 0.0);
        let near: Vec<u32> =
            (0..positions.len() as u32).filter(|&v| positions[v as usize].distance(middle) < 2e-3).collect();
        LoadSpec::NodalForces(near.into_iter().map(|vertex| (vertex, FORCE_N * 0.05)).collect())
    };
    let skin = &particles(&spec).skin;
    let top = (0..skin.triangles().len()).filter(|&t| skin.corners_m(t).iter().all(|p| p.z > -1e-6)).map(|t| t as u32);
    let everywhere = LoadSpec::Pressure { triangles: top.collect(), pressure_pa: 10.0, follower: false };
    spec.loads = vec![around(-0.015), around(0.015), everywhere];
    let rig = Rig::new(spec);
    let [both, with_wide, left] =
        [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0], [1.0, 0.0, 0.0]].map(|factors| at_rest(&rig, &factors).awake);
    assert_eq!(both.ids, with_wide.ids);
    assert_eq!([both.spread_loads, with_wide.spread_loads], [0, 1]);
    assert!(both.ids.len() <= 400 && left.ids.iter().all(|id| rig.model.body().as_hybrid().unwrap().may_wake(*id)));
    let partition = rig.model.body().as_hybrid().unwrap().partition();
    let sides = |ids: &[u32]| ids.iter().filter(|&&id| partition.particle_m(id).x < 0.0).count();
    assert!(sides(&both.ids).abs_diff(both.ids.len() - sides(&both.ids)) < 30, "{}", sides(&both.ids));
    assert!(sides(&left.ids) as f64 > 0.95 * left.ids.len() as f64);
}
