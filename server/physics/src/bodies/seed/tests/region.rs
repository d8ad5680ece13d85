//! Tests of which particles are awake, and of the interface of their region.
use super::{TOUCHED, ball, ball_with, press, touched};
use crate::bodies::seed::{InterfaceForce, SeedContact, SeedScratch, SeedState, region::Place};
use glam::DVec3;

/// Returns whether the ray from `from` through `point` meets a triangle (Möller & Trumbore).
fn ray_meets(from: DVec3, point: DVec3, [a, b, c]: [DVec3; 3]) -> bool {
    let (along, ab, ac) = (point - from, b - a, c - a);
    let p = along.cross(ac);
    let determinant = ab.dot(p);
    let t = from - a;
    let (u, q) = (t.dot(p) / determinant, t.cross(ab));
    let (v, distance) = (along.dot(q) / determinant, ac.dot(q) / determinant);
    u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9 && distance > 0.0
}

#[test]
fn a_region_holds_the_particles_in_the_cone_of_its_triangles_and_no_others() {
    let model = ball();
    let layer = model.layer().unwrap();
    let (triangle, region) = touched(&model);
    let corners = model.surface_triangles()[triangle as usize];
    let patch: Vec<[DVec3; 3]> = model
        .surface_triangles()
        .iter()
        .filter(|t| t.iter().any(|v| corners.contains(v)))
        .map(|t| t.map(|v| model.surface_rest_m()[v as usize]))
        .collect();
    assert_eq!(patch.len(), 13);
    for particle in 0..layer.particle_count() as u32 {
        let met = patch.iter().any(|t| ray_meets(DVec3::ZERO, layer.rest_m(particle), *t));
        assert_eq!(region.particles.binary_search(&particle).is_ok(), met, "particle {particle}");
    }
    // 13 of 320 triangles hold about 13/320 of the particles.
    assert!((250..450).contains(&region.len()), "{}", region.len());
    let opposite = (0..layer.particle_count() as u32).filter(|&p| layer.rest_m(p).dot(TOUCHED) < 0.0);
    assert!(opposite.clone().count() > 3000);
    assert!(opposite.into_iter().all(|p| region.particles.binary_search(&p).is_err()));
    // Without first neighbours: the cone of the triangle alone.
    let alone = ball_with(|spec| spec.parameters.first_neighbours = false);
    let own = corners.map(|v| model.surface_rest_m()[v as usize]);
    let small = &alone.regions()[triangle as usize];
    assert!(small.len() > 5 && small.particles.iter().all(|&p| ray_meets(DVec3::ZERO, layer.rest_m(p), own)));
}

#[test]
fn the_interface_is_where_the_region_meets_the_rest_of_the_body() {
    let model = ball();
    let layer = model.layer().unwrap();
    let (_, region) = touched(&model);
    let (mut interface, mut free_side) = (0, 0);
    for slot in 0..region.len() {
        let voxel = region.voxel_of[slot] as usize;
        let beside: Vec<Place> = region.voxels.beside(voxel).map(|v| region.places[v]).collect();
        let is_interface = region.places[voxel] == Place::Interface;
        assert_eq!(is_interface, beside.contains(&Place::Beyond));
        assert!(region.rest_m(slot).distance(layer.rest_m(region.particles[slot])) < 1e-15);
        interface += usize::from(is_interface);
        free_side += usize::from(!is_interface && beside.contains(&Place::Free));
    }
    assert!(interface > 50 && free_side > 20, "{interface} at the interface, {free_side} at the free surface");
    assert!(region.on_core.len() > 20);
    for voxel in 0..region.voxels.count() {
        let gradient = region.gradient_m(voxel);
        let end = region.voxels.holding(region.voxels.centre_m(voxel) + gradient).unwrap();
        assert_eq!(region.places[end], Place::Interface);
        assert_eq!(gradient == DVec3::ZERO, region.places[voxel] == Place::Interface);
        for &slot_voxel in region.voxel_of.iter().filter(|&&v| region.places[v as usize] == Place::Interface) {
            let distance = region.voxels.centre_m(slot_voxel as usize).distance(region.voxels.centre_m(voxel));
            assert!(distance > gradient.length() - 1e-12);
        }
    }
}

#[test]
fn the_interface_draws_back_what_leaves_it() {
    let model = ball();
    let (_, region) = touched(&model);
    let spacing = region.voxels.spacing_m;
    for slot in 0..region.len() {
        let here = region.rest_m(slot);
        let is_interface = region.places[region.voxel_of[slot] as usize] == Place::Interface;
        for direction in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_ONE] {
            let force = |x| region.interface_force_n(InterfaceForce::OwnVoxel, 2.0, slot, x);
            assert_eq!(force(here + direction * 0.49 * spacing), DVec3::ZERO);
            let out = force(here + direction * 1.5 * spacing);
            let expected = if is_interface { direction * (-2.0 * spacing) } else { DVec3::ZERO };
            assert!((out - expected).length() < 1e-12);
            // As printed: towards the nearest interface voxel, in steps of a voxel.
            let there = here + direction * 1.2 * spacing;
            let printed = region.interface_force_n(InterfaceForce::NearestVoxel, 2.0, slot, there);
            let voxel = region.voxels.holding(there).unwrap();
            let acts = is_interface || region.places[voxel] == Place::Beyond;
            assert_eq!(printed, if acts { region.gradient_m(voxel) * 2.0 } else { DVec3::ZERO });
        }
    }
}

#[test]
fn sleeping_particles_are_never_looked_at() {
    let model = ball();
    let layer = model.layer().unwrap();
    let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
    let (triangle, region) = touched(&model);
    let mut count = |triangle| {
        let contact = SeedContact { triangle, ..SeedContact::default() };
        model.step(&mut state, &mut scratch, &contact).particles_touched as usize
    };
    assert_eq!(count(None), 0);
    assert_eq!(count(Some(triangle)), region.len());
    assert_eq!(count(None), 0);
    // What changes in time, and the buffers, have room for one region only.
    assert!(model.most_awake() * 15 < layer.particle_count());
    assert_eq!(state.particles.x.len(), model.most_awake());
}

#[test]
fn a_region_that_wakes_beside_another_keeps_what_both_hold() {
    let model = ball();
    let (_, mut state) = press(&model, 1e-3, 100);
    let first = state.touched.unwrap();
    let corners = model.surface_triangles()[first as usize];
    let beside = (0..model.surface_triangles().len() as u32)
        .find(|&t| t != first && model.surface_triangles()[t as usize].contains(&corners[0]))
        .unwrap();
    let (old, new) = (&model.regions()[first as usize], &model.regions()[beside as usize]);
    let before = state.clone();
    let mut scratch = SeedScratch::new(&model);
    let dt_s = model.parameters().dt_s;
    model.step(&mut state, &mut scratch, &SeedContact { triangle: Some(beside), ..SeedContact::default() });
    let mut kept = 0;
    for (slot, particle) in new.particles.iter().enumerate() {
        if let Ok(was) = old.particles.binary_search(particle) {
            // One step on, it is near where its velocity leads.
            let free = before.particles.x[was] + before.particles.v[was] * dt_s;
            assert!(state.particles.x[slot].distance(free) < 2e-4);
            kept += 1;
        } else {
            assert!(state.particles.x[slot].distance(new.rest_m(slot)) < 1e-3);
        }
    }
    assert!(kept > 50 && kept < new.len());
    assert!(state.particles.x[new.len()..].iter().all(|x| *x == DVec3::ZERO));
}
