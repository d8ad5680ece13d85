//! What every method keeps: energy, momentum, affine motion, volume.
use super::*;
use crate::fine_levels::{
    level::FineLevel,
    testing::{CORRECTED, RAW, Random, ball_in_cage, half, half_awake, moved, plus, random_like, stretch, tissue},
};
use glam::{DMat3, DQuat};
use palpate_physics::{
    bodies::hybrid::patch::{Field, Materials},
    linalg::tensor::outer,
};

fn force_sums(at: &Field, forces: &Field) -> (DVec3, DVec3, f64) {
    let pairs = || at.nodes.iter().zip(&forces.nodes).chain(at.particles.iter().zip(&forces.particles));
    let torque: DVec3 = pairs().map(|(x, f)| x.cross(*f)).sum();
    (pairs().map(|(_, f)| *f).sum(), torque, pairs().map(|(_, f)| f.length()).sum())
}

#[test]
fn forces_are_the_energys_gradient_and_products_theirs() {
    let partition = ball_in_cage();
    let of_tet = vec![0; partition.residual_elements().len()];
    let mut random = Random(41);
    for method in RAW.into_iter().chain(CORRECTED) {
        let patch = half_awake(&partition, method);
        let rest = patch.at_rest(&partition);
        let still = moved(&rest, |_| DVec3::ZERO);
        for material in tissue() {
            let materials = Materials { materials: &[material], of_tet: &of_tet };
            let at = plus(&rest, &random_like(&rest, 0.1e-3, &mut random), 1.0);
            let (a, s) = (random_like(&rest, 0.1e-3, &mut random), 2e-4);
            let (ahead, behind) = (plus(&at, &a, s), plus(&at, &a, -s));
            let slope = (patch.energy_j(&materials, &ahead) - patch.energy_j(&materials, &behind)) / (2.0 * s);
            let (forces, _) = patch.forces_n(&materials, &at, &still);
            assert!((slope + forces.dot(&a)).abs() < 1e-6 * slope.abs(), "{method:?}: {slope} {}", forces.dot(&a));
            let (ahead, behind) =
                (patch.forces_n(&materials, &ahead, &still).0, patch.forces_n(&materials, &behind, &still).0);
            let products = patch.products_n(&materials, &at, &a);
            let difference = plus(&products, &plus(&ahead, &behind, -1.0), -0.5 / s);
            assert!(difference.dot(&difference) < 1e-8 * products.dot(&products), "{method:?}");
            // K is symmetric, and the viscous power is what its forces do.
            let b = random_like(&rest, 0.1e-3, &mut random);
            let (ab, ba) = (products.dot(&b), patch.products_n(&materials, &at, &b).dot(&a));
            let size = products.dot(&products).sqrt() * b.dot(&b).sqrt();
            assert!((ab - ba).abs() < 1e-12 * size, "{method:?}: {ab} {ba}");
            let (viscous, power_w) = patch.forces_n(&materials, &at, &b);
            let work = plus(&viscous, &forces, -1.0).dot(&b);
            assert!(power_w > 0.0 && (work + power_w).abs() < 1e-10 * power_w, "{method:?}: {work} {power_w}");
        }
    }
}

#[test]
fn the_diagonal_is_that_of_the_products_at_rest() {
    let partition = ball_in_cage();
    let of_tet = vec![0; partition.residual_elements().len()];
    let [material, ..] = tissue();
    let materials = Materials { materials: &[material], of_tet: &of_tet };
    for method in RAW.into_iter().chain(CORRECTED) {
        let patch = half_awake(&partition, method);
        let rest = patch.at_rest(&partition);
        let blocks = patch.diagonal_n_per_m(&materials, rest.nodes.len());
        for particle in (0..rest.particles.len()).step_by(301) {
            let mut unit = moved(&rest, |_| DVec3::ZERO);
            unit.particles[particle] = DVec3::new(0.3, -0.5, 0.8);
            let product = -patch.products_n(&materials, &rest, &unit).particles[particle];
            let expected = blocks[rest.nodes.len() + particle] * unit.particles[particle];
            assert!((product - expected).length() < 1e-10 * expected.length(), "{method:?}: {product} {expected}");
        }
    }
}

#[test]
fn forces_sum_to_zero_and_objective_methods_know_no_torque_nor_rotation() {
    let partition = ball_in_cage();
    let of_tet = vec![0; partition.residual_elements().len()];
    let turn = DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 2.1);
    let scale = 10e3 * partition.sites().spacing_m().powi(2);
    let mut random = Random(43);
    for method in RAW.into_iter().chain(CORRECTED) {
        let patch = half_awake(&partition, method);
        let rest = patch.at_rest(&partition);
        let still = moved(&rest, |_| DVec3::ZERO);
        for material in tissue() {
            let materials = Materials { materials: &[material], of_tet: &of_tet };
            let largest = |at: &Field| {
                let (forces, _) = patch.forces_n(&materials, at, &still);
                forces.nodes.iter().chain(&forces.particles).map(|f| f.length()).fold(0.0, f64::max) / scale
            };
            assert!(largest(&rest) < 1e-11, "{method:?}: {:e}", largest(&rest));
            let at = moved(&rest, |p| turn * p + DVec3::new(0.3, -0.2, 0.5));
            let turned = largest(&at);
            let at = plus(&at, &random_like(&rest, 0.3e-3, &mut random), 1.0);
            let (forces, _) = patch.forces_n(&materials, &at, &random_like(&rest, 0.1, &mut random));
            let (total, torque, sizes) = force_sums(&at, &forces);
            assert!(total.length() < 1e-13 * sizes, "{method:?}: {total} {sizes}");
            if RAW.contains(&method) {
                // Gradients of displacement, wrong by a factor, take rotation for strain.
                assert!(turned > 0.05 && torque.length() > 1e-6 * sizes, "{method:?}: {turned:e} {torque} {sizes}");
            } else {
                assert!(turned < 1e-10, "{method:?}: {turned:e}");
                assert!(torque.length() < 1e-13 * sizes, "{method:?}: {torque} {sizes}");
            }
        }
    }
}

#[test]
fn corrected_methods_reproduce_affine_motion_at_every_point() {
    let partition = ball_in_cage();
    let f = stretch(&mut Random(47));
    for method in CORRECTED {
        let points = method.points(&partition, &half(&partition));
        for row in &points.rows {
            let gradient = row.terms.iter().fold(DMat3::ZERO, |sum, t| sum + outer(f * t.span_m, t.gradient_per_m));
            assert!(gradient.abs_diff_eq(f, 1e-11), "{method:?}: {gradient} at {}", partition.particle_m(row.origin));
        }
    }
}

/// So that the force on every active particle is complete.
#[test]
fn all_points_that_see_an_active_particle_are_awake() {
    let partition = ball_in_cage();
    let (active, all) = (half(&partition), (0..partition.particle_count() as u32).collect());
    for method in RAW.into_iter().chain(CORRECTED) {
        // A tet's volume depends on how many of its corners are awake.
        let at_particles = |row: &Row| !matches!(row.role, Role::Stabilising { .. });
        let mut expected = method.points(&partition, &all).rows;
        expected.retain(|row| at_particles(row) && row.touches(|particle| active.contains(&particle)));
        let mut found = method.points(&partition, &active).rows;
        found.retain(at_particles);
        assert!(found == expected, "{method:?}: {} of {}", found.len(), expected.len());
    }
}

/// So the energy of uniform strain is exactly that of the whole body, whichever particles are awake.
#[test]
fn volume_is_counted_once() {
    let partition = ball_in_cage();
    let of_tet = vec![0; partition.residual_elements().len()];
    let f = stretch(&mut Random(53));
    for method in CORRECTED {
        let patch = half_awake(&partition, method);
        let at = moved(&patch.at_rest(&partition), |p| f * p);
        for material in tissue() {
            let materials = Materials { materials: &[material], of_tet: &of_tet };
            let expected = partition.volume_m3() * material.energy_density(&f);
            let energy = patch.energy_j(&materials, &at);
            assert!((energy / expected - 1.0).abs() < 1e-11, "{method:?}: {energy} {expected}");
        }
    }
}
