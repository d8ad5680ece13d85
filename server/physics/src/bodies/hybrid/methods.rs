//! Particle methods for the fine level: what fills the rows of `points`.
//!
//! With `w_p = W(|X_p − X_q|)`, `ΔX = X_p − X_q` and the volume of a uniform grid, `V_p = h³`, at every particle q unless said otherwise:
//! - *Raw SPH*, the seed's (Mero & Susín 2006, eqs. 23-29): `b_qp = V_p ∇W = −V_p W' ΔX/|ΔX|`. It gives the identity map the gradient `A_q = Σ ΔX ⊗ b_qp`: with the cone 0.80
//!   inside, (0.62, 0.62, 0.40) in a flat surface. The paper's eqs. 1, 3 and 5 measure strain from gradients of displacement and want none at rest; its eq. 4, to
//!   which its section on particles points, has positions in their place, and raw sums would strain the body at rest. The former is taken: `F_q = I + Σ (u_p − u_q) ⊗ b_qp =
//!   I + ∇u A_q`, `∇u` being what a corrected method finds from the same neighbours. The force is the transpose of F: in small strain eq. 29 with its sign mended,
//!   `Σ_q V_p V_q σ_q ∇W`, and a term of `σ_p` that vanishes where neighbours are all around, and with which momentum is conserved.
//! - *Corrected total-Lagrangian SPH*: `b_qp = V_p L_q ∇W`, `L_q = (Σ V_p ∇W ⊗ ΔX)⁻¹`; affine motion is reproduced. `V_p = h³` here, too: L makes any weights right for affine
//!   motion, but with less at the surface sums are lopsided one particle beneath it.
//! - *Moving least squares* (`least_squares`): `b_qp = ∇N_p(X_q)`. At particles, or, as element-free Galerkin methods do (Belytschko, Lu & Gu 1994), at Gauss points: the
//!   middles of the octants of cells.
//! - *Nodal smoothing* of tets nested in the cells (`smoothing`).
//!
//! At particles symmetric gradients are blind to fields that change sign from one to the next, so corrected SPH and moving least squares there come with
//! control, `k_qp = α V_q V_p w_p/|ΔX|²`. Gauss points see those fields.
//!
//! Points answer for volume `V_q = Σ_c V_c/8` over the cells around them, an octant's point for one of the eight. None but nodal smoothing is *integration-consistent* at the
//! surface: inside `Σ_q V_q b_qp = 0` by symmetry, but uniform stress P puts up to `0.12 P h²` on particles beneath a flat face (raw), `0.08 P h²` (corrected, cone), less than `0.0005 P h²` (the others),
//! and on some at a surface that cuts cells half of `P h²` beside the traction that is theirs.
use super::{
    least_squares,
    partition::Partition,
    points::{Handed, Points, Role, Row, Term},
    sites::CORNERS,
    smoothing,
    smoothing_kernels::{Kernel, SMOOTHING},
    sph,
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
    /// The points that see an active particle. The lattice's cells are all of one size.
    pub fn points(self, partition: &Partition, active: &BTreeSet<u32>) -> Points {
        debug_assert!(!partition.has_doubled(), "methods know one size of cells");
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
            Self::RawSph(kernel) => {
                at_particles(&|particle| at_particle(partition, particle, sph::raw(partition, kernel, particle)))
            }
            Self::CorrectedSph { kernel, control } => at_particles(&|particle| {
                let terms = sph::corrected(partition, kernel, particle);
                sph::controlled(partition, kernel, control, at_particle(partition, particle, terms))
            }),
            Self::MovingLeastSquares { control } => at_particles(&|particle| {
                let terms = least_squares::terms(partition, partition.particle_m(particle), particle);
                sph::controlled(partition, Kernel::WendlandC2, control, at_particle(partition, particle, terms))
            }),
            Self::ElementFreeGalerkin => {
                // The middle of an octant is less than half a spacing away from its corner.
                let corners = around(support_m + 0.5 * partition.sites().spacing_m());
                let cells = corners.iter().flat_map(|&particle| partition.cells_at(particle)).collect();
                in_octants(partition, &cells, active)
            }
            Self::NodalSmoothing { gamma } => smoothing::points(partition, gamma, active),
        }
    }
}

fn at_particle(partition: &Partition, particle: u32, terms: Vec<Term>) -> Row {
    let tet = partition.anchor(particle).tet;
    Row { volume_m3: partition.particle_m3(particle), origin: particle, tet, role: Role::Whole, terms }
}

/// The octants of these cells that see an active particle.
fn in_octants(partition: &Partition, cells: &BTreeSet<usize>, active: &BTreeSet<u32>) -> Points {
    let mut points = Points::default();
    for (cell, corner) in cells.iter().flat_map(|&cell| (0..8).map(move |corner| (cell, corner))) {
        let row = at_octant(partition, cell, corner);
        if row.touches(|particle| active.contains(&particle)) {
            points.rows.push(row);
            points.handed.push(Handed { cell, part: 0.125 });
        }
    }
    points
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
        bodies::hybrid::{
            patch::{Field, Materials},
            testing::{
                CORRECTED, RAW, Random, ball_in_cage, half, half_awake, moved, plus, random_like, stretch, tissue,
            },
        },
        linalg::tensor::outer,
    };
    use glam::{DMat3, DQuat};

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
        let of_tet = vec![0; partition.shares().len()];
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
        let of_tet = vec![0; partition.shares().len()];
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
                assert!(
                    gradient.abs_diff_eq(f, 1e-11),
                    "{method:?}: {gradient} at {}",
                    partition.particle_m(row.origin)
                );
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
        let of_tet = vec![0; partition.shares().len()];
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
}
