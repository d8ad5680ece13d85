//! Particle methods for the fine level: what fills the rows of `points`.
//!
//! With `w_p = W(|X_p − X_q|)` and `ΔX = X_p − X_q`, at every particle q unless said otherwise:
//! - *Raw SPH*, the seed's (Mero & Susín 2006, eqs. 23-29): `b_qp = V_p ∇W = −V_p W' ΔX/|ΔX|`, the `V_p` of a uniform grid, h³. It gives the identity map the gradient
//!   `A_q = Σ ΔX ⊗ b_qp`, on a lattice far from the surface 0.80 (cone), at a flat surface (0.62, 0.62, 0.40). The paper's eqs. 1, 3 and 5 measure strain from gradients of displacement and want it
//!   zero at rest; its eq. 4, which it names for particles, has positions in their place, which raw sums would strain at rest. The former is taken:
//!   `F_q = I + Σ (u_p − u_q) ⊗ b_qp = I + ∇u A_qᵀ`, with `∇u` what a corrected method finds from the same neighbours. Force is the transpose of F: in small
//!   strain eq. 29 with its sign mended, `Σ_q V_p V_q σ_q ∇W`, and a term in `σ_p` that vanishes where neighbours are all around, and with which momentum is conserved.
//! - *Corrected total-Lagrangian SPH*: `b_qp = V_p L_q ∇W`, `L_q = (Σ V_p ∇W ⊗ ΔX)⁻¹`; affine motion is reproduced.
//! - *Moving least squares* (`least_squares`): `b_qp = ∇N_p(X_q)`. At particles, or, as element-free Galerkin methods do (Belytschko, Lu & Gu 1994), at Gauss points: the
//!   middles of a cell's octants.
//! - *Nodal smoothing* of tets nested in the cells (`smoothing`).
//!
//! Particles are where symmetric gradients are blind to fields that change sign from one to the next, so corrected SPH and moving least squares there come with
//! control, `k_qp = α V_q V_p w_p/|ΔX|²`. Gauss points see those fields.
//!
//! None but nodal smoothing is *integration-consistent* at the surface: `Σ_q V_q b_qp` is zero inside by symmetry, but at the surface not quite what traction gives, so
//! uniform stress is out of balance there, by a few per cent of what a particle carries.
use super::{
    kernels::{Kernel, SMOOTHING},
    least_squares,
    partition::Partition,
    points::{Handed, Points, Role, Row, Term},
    sites::CORNERS,
    smoothing,
};
use glam::DVec3;
use std::collections::BTreeSet;

/// α: the answers with a tenth are within 1 % of those without control.
pub const CONTROL: f64 = 0.1;

/// What fills the operator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Uncorrected sums.
    RawSph(Kernel),
    /// Sums corrected at every particle.
    CorrectedSph {
        /// W.
        kernel: Kernel,
        /// α.
        control: f64,
    },
    /// Gradients of moving least squares at particles.
    MovingLeastSquares {
        /// α.
        control: f64,
    },
    /// The same functions at Gauss points.
    ElementFreeGalerkin,
    /// Gradients of nested tets, averaged at particles.
    NodalSmoothing {
        /// γ.
        gamma: f64,
    },
}

impl Method {
    /// The points that see an active particle.
    pub fn points(self, partition: &Partition, active: &BTreeSet<u32>) -> Points {
        let support_m = Kernel::support_m(SMOOTHING * partition.sites().spacing_m());
        let around = |reach_m: f64| -> BTreeSet<u32> {
            let near = |&particle: &u32| partition.particles_near(partition.particle_m(particle), reach_m);
            active.iter().flat_map(near).collect()
        };
        let at_particles = |row: &dyn Fn(u32) -> Row| {
            let awake = around(support_m);
            let handed = awake.iter().flat_map(|&particle| partition.cells_at(particle));
            Points {
                rows: awake.iter().map(|&particle| row(particle)).collect(),
                handed: handed.map(|cell| Handed { cell, part: 0.125 }).collect(),
            }
        };
        match self {
            Self::RawSph(kernel) => at_particles(&|particle| raw(partition, kernel, particle)),
            Self::CorrectedSph { kernel, control } => {
                at_particles(&|particle| controlled(partition, kernel, control, corrected(partition, kernel, particle)))
            }
            Self::MovingLeastSquares { control } => at_particles(&|particle| {
                let terms = least_squares::terms(partition, partition.particle_m(particle), particle);
                controlled(partition, Kernel::WendlandC2, control, at_particle(partition, particle, terms))
            }),
            Self::ElementFreeGalerkin => {
                let cells: BTreeSet<usize> = around(support_m + 2.0 * partition.sites().spacing_m())
                    .iter()
                    .flat_map(|&p| partition.cells_at(p))
                    .collect();
                let octants = cells.iter().flat_map(|&cell| (0..8).map(move |corner| (cell, corner)));
                let rows = octants.map(|(cell, corner)| (cell, at_octant(partition, cell, corner)));
                let awake: Vec<_> =
                    rows.filter(|(_, row)| row.touches(|particle| active.contains(&particle))).collect();
                let handed = awake.iter().map(|&(cell, _)| Handed { cell, part: 0.125 }).collect();
                Points { rows: awake.into_iter().map(|(_, row)| row).collect(), handed }
            }
            Self::NodalSmoothing { gamma } => smoothing::points(partition, gamma, active),
        }
    }
}

fn at_particle(partition: &Partition, particle: u32, terms: Vec<Term>) -> Row {
    let tet = partition.anchor(particle).tet;
    Row { volume_m3: partition.particle_m3(particle), origin: particle, tet, role: Role::Whole, terms }
}

/// `b_qp = −V_p W' ΔX/|ΔX|`.
fn raw(partition: &Partition, kernel: Kernel, particle: u32) -> Row {
    let spacing_m = partition.sites().spacing_m();
    let (smoothing_m, volume_m3) = (SMOOTHING * spacing_m, spacing_m.powi(3));
    let at = partition.particle_m(particle);
    let near = partition.particles_near(at, Kernel::support_m(smoothing_m));
    let term = |neighbour: u32| {
        let span_m = partition.particle_m(neighbour) - at;
        let distance_m = span_m.length();
        let gradient_per_m = span_m * (-volume_m3 * kernel.slope_per_m4(distance_m, smoothing_m) / distance_m);
        Term { particle: neighbour, gradient_per_m, span_m, control_m: 0.0 }
    };
    at_particle(partition, particle, near.into_iter().filter(|&p| p != particle).map(term).collect())
}

fn corrected(partition: &Partition, kernel: Kernel, particle: u32) -> Row {
    let mut row = raw(partition, kernel, particle);
    // L_q = (Σ b ⊗ ΔX)⁻¹: the corners of one cell are among the neighbours, so it is there.
    let correction = row.of_identity().transpose().inverse();
    for term in &mut row.terms {
        term.gradient_per_m = correction * term.gradient_per_m;
    }
    row
}

/// With `k_qp = α V_q V_p w_p/|ΔX|²`.
fn controlled(partition: &Partition, kernel: Kernel, control: f64, mut row: Row) -> Row {
    let spacing_m = partition.sites().spacing_m();
    for term in &mut row.terms {
        let weight = spacing_m.powi(3) * kernel.value_per_m3(term.span_m.length(), SMOOTHING * spacing_m);
        term.control_m = control * row.volume_m3 * weight / term.span_m.length_squared();
    }
    row
}

/// A Gauss point: the middle of the octant of a cell at one of its corners.
fn at_octant(partition: &Partition, cell: usize, corner: usize) -> Row {
    let origin = partition.corners(cell)[corner];
    let inward = DVec3::ONE - CORNERS[corner] * 2.0;
    let at = partition.particle_m(origin) + inward * (0.25 * partition.sites().spacing_m());
    let terms = least_squares::terms(partition, at, origin);
    let volume_m3 = partition.moments(cell).0 / 8.0;
    Row { volume_m3, origin, tet: partition.cells()[cell].tet, role: Role::Whole, terms }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        fem::element::outer,
        hybrid::{
            patch::{Field, Materials, Patch},
            points::Operator,
            testing::{Random, ball_in_cage, block_in_cage, moved, plus, random_like, tissue},
        },
        material::Material,
    };
    use glam::{DMat3, DQuat};
    use std::f64::consts::PI;

    const RAW: [Method; 2] = [Method::RawSph(Kernel::Cone), Method::RawSph(Kernel::WendlandC2)];
    /// All that reproduce affine motion.
    const CORRECTED: [Method; 5] = [
        Method::CorrectedSph { kernel: Kernel::Cone, control: CONTROL },
        Method::CorrectedSph { kernel: Kernel::WendlandC2, control: CONTROL },
        Method::MovingLeastSquares { control: CONTROL },
        Method::ElementFreeGalerkin,
        Method::NodalSmoothing { gamma: 0.5 },
    ];

    /// Half of a ball.
    fn half(partition: &Partition) -> BTreeSet<u32> {
        (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).x > 0.2e-3).collect()
    }

    fn awake(partition: &Partition, method: Method) -> Patch {
        let active = half(partition);
        Patch::with_points(partition, &active, &method.points(partition, &active))
    }

    /// A matrix not far from the identity.
    fn stretch(random: &mut Random) -> DMat3 {
        DMat3::IDENTITY + DMat3::from_cols(random.vector(), random.vector(), random.vector()) * 0.1
    }

    fn force_sums(at: &Field, forces: &Field) -> (DVec3, DVec3, f64) {
        let pairs = || at.nodes.iter().zip(&forces.nodes).chain(at.particles.iter().zip(&forces.particles));
        let torque: DVec3 = pairs().map(|(x, f)| x.cross(*f)).sum();
        (pairs().map(|(_, f)| *f).sum(), torque, pairs().map(|(_, f)| f.length()).sum())
    }

    #[test]
    fn forces_are_the_energys_gradient_and_products_theirs() {
        let partition = ball_in_cage();
        let of_tet = vec![0; partition.shares().len()];
        let mut random = Random(41);
        for method in RAW.into_iter().chain(CORRECTED) {
            let patch = awake(&partition, method);
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
        let of_tet = vec![0; partition.shares().len()];
        let [material, ..] = tissue();
        let materials = Materials { materials: &[material], of_tet: &of_tet };
        for method in RAW.into_iter().chain(CORRECTED) {
            let patch = awake(&partition, method);
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
        let of_tet = vec![0; partition.shares().len()];
        let turn = DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 2.1);
        let scale = 10e3 * partition.sites().spacing_m().powi(2);
        let mut random = Random(43);
        for method in RAW.into_iter().chain(CORRECTED) {
            let patch = awake(&partition, method);
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
                assert!(
                    gradient.abs_diff_eq(f, 1e-11),
                    "{method:?}: {gradient} at {}",
                    partition.particle_m(row.origin)
                );
            }
        }
    }

    /// So the energy of uniform strain is exactly that of the whole body, whichever particles are awake.
    #[test]
    fn volume_is_counted_once() {
        let partition = ball_in_cage();
        let of_tet = vec![0; partition.shares().len()];
        let f = stretch(&mut Random(53));
        for method in CORRECTED {
            let patch = awake(&partition, method);
            let at = moved(&patch.at_rest(&partition), |p| f * p);
            for material in tissue() {
                let materials = Materials { materials: &[material], of_tet: &of_tet };
                let expected = partition.volume_m3() * material.energy_density(&f);
                let energy = patch.energy_j(&materials, &at);
                assert!((energy / expected - 1.0).abs() < 1e-11, "{method:?}: {energy} {expected}");
            }
        }
    }

    /// In a layer four particles thick.
    #[test]
    fn raw_sums_give_the_identity_map_another_gradient() {
        let partition = block_in_cage([12, 12, 3]);
        let all: BTreeSet<u32> = (0..partition.particle_count() as u32).collect();
        let seen = |kernel: Kernel, z: f64| {
            let middle = DVec3::new(6e-3, 6e-3, z);
            let points = Method::RawSph(kernel).points(&partition, &all);
            let row = points.rows.iter().find(|row| partition.particle_m(row.origin).distance(middle) < 1e-9).unwrap();
            row.of_identity()
        };
        let at_surface = seen(Kernel::Cone, 0.0);
        assert!(at_surface.abs_diff_eq(DMat3::from_diagonal(DVec3::new(0.62, 0.62, 0.40)), 0.005), "{at_surface}");
        // A surface cuts off half of what makes the gradient along its normal.
        let inside = block_in_cage([6, 6, 6]);
        let row = raw(&inside, Kernel::Cone, inside.particles_near(DVec3::splat(3e-3), 1e-9)[0]).of_identity();
        assert!(
            (row.z_axis.z - 0.80).abs() < 0.005 && (at_surface.z_axis.z / row.z_axis.z - 0.5).abs() < 1e-9,
            "{row}"
        );
        let at_surface = seen(Kernel::WendlandC2, 0.0);
        assert!(at_surface.abs_diff_eq(DMat3::from_diagonal(DVec3::new(0.85, 0.85, 0.50)), 0.005), "{at_surface}");
    }

    /// Forces of uniform stress over `P h²`: the largest in the middle of a block, and the largest on a particle beneath a face but not in it. Both ought to be zero.
    fn out_of_balance(partition: &Partition, method: Method, material: &Material) -> (f64, f64) {
        let active: BTreeSet<u32> = (0..partition.particle_count() as u32).collect();
        let patch = Patch::with_points(partition, &active, &method.points(partition, &active));
        let of_tet = vec![0; partition.shares().len()];
        let materials = Materials { materials: &[*material], of_tet: &of_tet };
        let f = stretch(&mut Random(59));
        let at = moved(&patch.at_rest(partition), |p| f * p);
        let (forces, _) = patch.forces_n(&materials, &at, &moved(&at, |_| DVec3::ZERO));
        let stress = material.piola(&f);
        let unit = 1e-6 * stress.x_axis.length().max(stress.y_axis.length()).max(stress.z_axis.length());
        let force = |z_mm: f64| {
            let particle = partition.particles_near(DVec3::new(7.0, 7.0, z_mm) * 1e-3, 1e-6)[0];
            forces.particles[particle as usize].length() / unit
        };
        (force(6.0).max(force(7.0)), [1.0, 2.0, 3.0, 4.0].map(force).into_iter().fold(0.0, f64::max))
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

    /// Least ratio of a plane wave's energy to that in the solid, over one period of the lattice, waves a and directions.
    fn least_stiffness(partition: &Partition, method: Method) -> (f64, [usize; 3]) {
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
        let of_tet = vec![0; partition.shares().len()];
        let materials = Materials { materials: &[material], of_tet: &of_tet };
        let volume_m3 = (PERIOD as f64 * h).powi(3);
        let waves = (1..64_usize).map(|n| [n % 4, n / 4 % 4, n / 16]);
        let ratio = |wave: [usize; 3]| {
            let k = DVec3::from(wave.map(|n| n as f64)) * (2.0 * PI / (PERIOD as f64 * h));
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
}
