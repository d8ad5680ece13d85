//! What the methods satisfy, and what not: balance of uniform stress, plane waves, frequencies.
use super::{
    Method,
    neighbours::{particle_m3, particles_near},
    patch::PointPatch,
    points::Operator,
    smoothing_kernels::Kernel,
};
use crate::fine_levels::{
    level::FineLevel,
    testing::{CORRECTED, RAW, Random, ball_in_cage, block_in_cage, half, half_awake, moved, stretch, tissue},
};
use glam::DVec3;
use palpate_physics::{
    bodies::hybrid::{
        partition::Partition,
        patch::{Field, KEPT, Materials, Patch},
    },
    material::{Lame, Material},
};
use std::{collections::BTreeSet, f64::consts::PI};

/// Forces of uniform stress over `P h²`: the largest in the middle of a block, and the largest on a particle beneath a face but not in it. Both ought to be zero.
fn out_of_balance(partition: &Partition, method: Method, material: &Material) -> (f64, f64) {
    let active: BTreeSet<u32> = (0..partition.particle_count() as u32).collect();
    let patch = PointPatch::new(partition, &active, &method.points(partition, &active));
    let of_tet = vec![0; partition.residual_elements().len()];
    let materials = Materials { materials: &[*material], of_tet: &of_tet };
    let f = stretch(&mut Random(59));
    let at = moved(&patch.at_rest(partition), |p| f * p);
    let forces = patch.elastic_forces_n(&materials, &at);
    let stress = material.piola(&f);
    let unit = 1e-6 * stress.x_axis.length().max(stress.y_axis.length()).max(stress.z_axis.length());
    let force = |z_mm: f64| {
        let particle = particles_near(partition, DVec3::new(7.0, 7.0, z_mm) * 1e-3, 1e-6)[0];
        forces.particles[particle as usize].length() / unit
    };
    (force(6.0).max(force(7.0)), [1.0, 2.0, 3.0, 4.0].map(force).into_iter().fold(0.0, f64::max))
}

/// On half of a ball, what uniform stress puts on a particle beside the traction that the cells give it, at most, over `P h²`; and on the middle node of a block that is half awake,
/// over `P` times the area of its section.
fn beside_traction(ball: &Partition, block: &Partition, method: Method, material: &Material) -> (f64, f64) {
    let f = stretch(&mut Random(61));
    let stress = material.piola(&f);
    let unit_pa = stress.x_axis.length().max(stress.y_axis.length()).max(stress.z_axis.length());
    let forces = |partition: &Partition, patch: &dyn FineLevel| {
        let of_tet = vec![0; partition.residual_elements().len()];
        let materials = Materials { materials: &[*material], of_tet: &of_tet };
        let at = moved(&patch.at_rest(partition), |p| f * p);
        patch.elastic_forces_n(&materials, &at)
    };
    let (cells, points) =
        (forces(ball, &Patch::new(ball, &half(ball))).particles, forces(ball, &half_awake(ball, method)).particles);
    let worst = cells.iter().zip(points).map(|(a, b)| a.distance(b)).fold(0.0, f64::max);
    let active = (0..block.particle_count() as u32).filter(|&p| block.particle_m(p).x > 7.5e-3).collect();
    let nodes = forces(block, &PointPatch::new(block, &active, &method.points(block, &active))).nodes;
    let middle = DVec3::new(7.0, 7.0, 6.5) * 1e-3;
    let at_middle = block.coarse().positions_m().iter().position(|x| x.distance(middle) < 1e-9).unwrap();
    let area_m2 = 14e-3 * 13e-3;
    (worst / (unit_pa * ball.sites().spacing_m().powi(2)), nodes[at_middle].length() / (unit_pa * area_m2))
}

#[test]
fn uniform_stress_balances_inside_and_nearly_beneath_a_face() {
    let [_, material, _] = tissue();
    let block = block_in_cage([14, 14, 13]);
    let bounds = [0.13, 0.13, 0.08, 5e-4, 3e-4, 3e-4, 1e-13];
    for (method, most) in RAW.into_iter().chain(CORRECTED).zip(bounds) {
        let (inside, beneath) = out_of_balance(&block, method, &material);
        assert!(inside < 1e-13, "{method:?}: {inside:e}");
        assert!(beneath < most, "{method:?}: {beneath:e}");
    }
}

#[test]
fn uniform_stress_is_nearly_in_balance_at_a_cut_surface_and_at_the_rim() {
    let [_, material, _] = tissue();
    let (ball, block) = (ball_in_cage(), block_in_cage([14, 14, 13]));
    let at_surface = [0.75, 0.47, 0.56, 0.55, 0.56, 0.41, 0.26];
    let at_rim = [0.1, 5e-3, 2e-3, 1.2e-3, 2.8e-3, 1.2e-3, 1e-11];
    for (method, (cut, rim)) in RAW.into_iter().chain(CORRECTED).zip(at_surface.into_iter().zip(at_rim)) {
        let (on_particle, on_node) = beside_traction(&ball, &block, method, &material);
        assert!(on_particle < cut && on_node < rim, "{method:?}: {on_particle} {on_node}");
    }
}

/// Least ratio of a plane wave's energy to that in the solid, of all waves of one period, and the wave.
fn least_stiffness(partition: &Partition, method: Method) -> (f64, [i32; 3]) {
    const PERIOD: usize = 6;
    let all: BTreeSet<u32> = (0..partition.particle_count() as u32).collect();
    let rest: Vec<DVec3> = all.iter().map(|&p| partition.particle_m(p)).collect();
    let h = partition.sites().spacing_m();
    let mut rows = method.points(partition, &all).rows;
    rows.retain(|row| {
        let at = rest[row.origin as usize] / h;
        at.min_element() > 3.5 && at.max_element() < 9.5
    });
    let operator = Operator::new(&rows, 1.0, |particle| particle);
    let [material, ..] = tissue();
    let of_tet = vec![0; partition.residual_elements().len()];
    let materials = Materials { materials: &[material], of_tet: &of_tet };
    let volume_m3 = (PERIOD as f64 * h).powi(3);
    let waves = (0..216_i32).map(|n| [n % 6 - 2, n / 6 % 6 - 2, n / 36 - 2]).filter(|wave| *wave != [0; 3]);
    let ratio = |wave: [i32; 3]| {
        let k = DVec3::from(wave.map(f64::from)) * (2.0 * PI / (PERIOD as f64 * h));
        let energy = |a: DVec3| {
            let size = 1e-6 * h;
            let of_phase = |phase: f64| {
                let y: Vec<DVec3> = rest.iter().map(|x| *x + a * (size * (k.dot(*x) + phase).cos())).collect();
                operator.energy_j(&materials, &y) / (size * size)
            };
            of_phase(0.0) + of_phase(0.5 * PI)
        };
        // U = ½ V (µ |k|² |a|² + (λ + µ)(k·a)²) (sin² + cos²): transverse waves are the softest.
        let along = k.normalize();
        let across = along.any_orthonormal_pair();
        let exact = 0.5 * volume_m3 * material.lame.mu_pa * k.length_squared();
        energy(across.0).min(energy(across.1)).min(energy(along)) / exact
    };
    waves.map(|wave| (ratio(wave), wave)).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

#[test]
fn control_leaves_no_mode_without_energy() {
    let partition = block_in_cage([13, 13, 13]);
    let zero = [
        Method::RawSph(Kernel::Cone),
        Method::CorrectedSph { kernel: Kernel::Cone, control: 0.0 },
        Method::CorrectedSph { kernel: Kernel::WendlandC2, control: 0.0 },
        Method::MovingLeastSquares { control: 0.0 },
        Method::NodalSmoothing { gamma: 0.0 },
    ];
    for method in zero {
        let (least, wave) = least_stiffness(&partition, method);
        assert!(least < 1e-15, "{method:?}: {least} {wave:?}");
    }
    for method in CORRECTED {
        let (least, wave) = least_stiffness(&partition, method);
        assert!(least > 1e-3, "{method:?}: {least} {wave:?}");
    }
}

/// Square of the largest natural frequency (rad²/s²) of all particles awake, by power iteration.
fn largest_square(partition: &Partition, patch: &dyn FineLevel, material: &Material) -> f64 {
    let of_tet = vec![0; partition.residual_elements().len()];
    let materials = Materials { materials: &[*material], of_tet: &of_tet };
    let rest = patch.at_rest(partition);
    let still = vec![DVec3::ZERO; rest.nodes.len()];
    let masses: Vec<f64> = patch.active().iter().map(|&p| 1000.0 * (1.0 - KEPT) * particle_m3(partition, p)).collect();
    let mut random = Random(67);
    let mut a = Field { particles: masses.iter().map(|_| random.vector()).collect(), nodes: still.clone() };
    let mut square = 0.0;
    for _ in 0..300 {
        let product = patch.products_n(&materials, &rest, &a).particles;
        let mut next: Vec<DVec3> = product.iter().zip(&masses).map(|(f, m)| -*f / *m).collect();
        square = next.iter().map(|v| v.length_squared()).sum::<f64>().sqrt();
        for v in &mut next {
            *v /= square;
        }
        a.particles = next;
    }
    square
}

#[test]
fn the_largest_frequency_is_about_that_of_cells_or_less() {
    let partition = block_in_cage([10, 10, 6]);
    let all: BTreeSet<u32> = (0..partition.particle_count() as u32).collect();
    let material = Material { lame: Lame::from_young_poisson(10e3, 0.45).unwrap(), ..tissue()[1] };
    let of_cells = largest_square(&partition, &Patch::new(&partition, &all), &material).sqrt();
    let ratios = [0.36, 0.58, 0.72, 0.91, 1.03, 0.91, 0.96];
    for (method, expected) in RAW.into_iter().chain(CORRECTED).zip(ratios) {
        let patch = PointPatch::new(&partition, &all, &method.points(&partition, &all));
        let ratio = largest_square(&partition, &patch, &material).sqrt() / of_cells;
        assert!((ratio - expected).abs() < 0.01, "{method:?}: {ratio}");
    }
}
