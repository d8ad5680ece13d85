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
    points::{Role, Row, Term},
    sites::CORNERS,
    smoothing,
};
use crate::fem::element::outer;
use glam::{DMat3, DVec3};
use std::collections::BTreeSet;

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

/// A part of a cell's volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handed {
    /// Index of the cell.
    pub cell: usize,
    /// The part.
    pub part: f64,
}

impl Method {
    /// The rows that see an active particle, and the volume that they answer for when it is handed over to the last.
    pub fn rows(self, partition: &Partition, active: &BTreeSet<u32>) -> (Vec<Row>, Vec<Handed>) {
        let support_m = Kernel::support_m(SMOOTHING * partition.sites().spacing_m());
        let around = |reach_m: f64| -> BTreeSet<u32> {
            let near = |&particle: &u32| partition.particles_near(partition.particle_m(particle), reach_m);
            active.iter().flat_map(near).collect()
        };
        let at_particles = |row: &dyn Fn(u32) -> Row| {
            let awake = around(support_m);
            let handed = awake.iter().flat_map(|&particle| partition.cells_at(particle));
            (
                awake.iter().map(|&particle| row(particle)).collect(),
                handed.map(|cell| Handed { cell, part: 0.125 }).collect(),
            )
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
                (awake.into_iter().map(|(_, row)| row).collect(), handed)
            }
            Self::NodalSmoothing { gamma } => smoothing::rows(partition, gamma, active),
        }
    }
}

fn at_particle(partition: &Partition, particle: u32, terms: Vec<Term>) -> Row {
    let tet = partition.anchor(particle).tet;
    Row { volume_m3: partition.particle_m3(particle), origin: particle, tet, role: Role::Whole, terms }
}

/// `b_qp = −V_p W' ΔX/|ΔX|` with the volumes `V_p` (m³).
fn sums(partition: &Partition, kernel: Kernel, particle: u32, volume_m3: impl Fn(u32) -> f64) -> Row {
    let smoothing_m = SMOOTHING * partition.sites().spacing_m();
    let at = partition.particle_m(particle);
    let near = partition.particles_near(at, Kernel::support_m(smoothing_m));
    let term = |neighbour: u32| {
        let span_m = partition.particle_m(neighbour) - at;
        let distance_m = span_m.length();
        let slope = kernel.slope_per_m4(distance_m, smoothing_m);
        let gradient_per_m = span_m * (-volume_m3(neighbour) * slope / distance_m);
        Term { particle: neighbour, gradient_per_m, span_m, control_m: 0.0 }
    };
    at_particle(partition, particle, near.into_iter().filter(|&p| p != particle).map(term).collect())
}

fn raw(partition: &Partition, kernel: Kernel, particle: u32) -> Row {
    let of_grid_m3 = partition.sites().spacing_m().powi(3);
    sums(partition, kernel, particle, |_| of_grid_m3)
}

fn corrected(partition: &Partition, kernel: Kernel, particle: u32) -> Row {
    let mut row = sums(partition, kernel, particle, |neighbour| partition.particle_m3(neighbour));
    // L_q = (Σ b ⊗ ΔX)⁻¹: the corners of one cell are among the neighbours, so it is there.
    let moment = row.terms.iter().fold(DMat3::ZERO, |sum, term| sum + outer(term.gradient_per_m, term.span_m));
    let correction = moment.inverse();
    for term in &mut row.terms {
        term.gradient_per_m = correction * term.gradient_per_m;
    }
    row
}

/// With `k_qp = α V_q V_p w_p/|ΔX|²`.
fn controlled(partition: &Partition, kernel: Kernel, control: f64, mut row: Row) -> Row {
    let smoothing_m = SMOOTHING * partition.sites().spacing_m();
    for term in &mut row.terms {
        let weight = partition.particle_m3(term.particle) * kernel.value_per_m3(term.span_m.length(), smoothing_m);
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
