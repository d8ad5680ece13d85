//! Particle methods for the fine level: what fills the rows of `points`. They are compared with the cells that ship.
//!
//! - `points.rs`: the one operator of all of them, and `patch.rs` what it does in a body
//! - `sph.rs`, `least_squares.rs`, `smoothing.rs`: their rows; `smoothing_kernels.rs`, `neighbours.rs`: what those are made of
//! - `checks.rs`: what they satisfy, and what not
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
//! surface: inside `Σ_q V_q b_qp = 0` by symmetry, but the uniform stress P of one strain (`checks.rs`) puts up to `0.12 P h²` on particles beneath a flat face (raw; of another strain it was 0.19),
//! `0.08 P h²` (corrected, cone), less than `0.0005 P h²` (the others), and on some at a surface that cuts cells half of `P h²` beside the traction that is theirs.
#[cfg(test)]
mod checks;
mod least_squares;
mod neighbours;
mod patch;
mod points;
mod smoothing;
mod smoothing_kernels;
mod sph;
#[cfg(test)]
mod tests;

pub use neighbours::{particle_m3, particles_near};
pub use patch::PointPatch;
pub use points::{Handed, Operator, Points, Role, Row, Term};
pub use smoothing_kernels::{Kernel, SMOOTHING};

use glam::DVec3;
use palpate_physics::bodies::hybrid::{partition::Partition, sites::CORNERS};
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
            let near = |&particle: &u32| particles_near(partition, partition.particle_m(particle), reach_m);
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
    Row { volume_m3: particle_m3(partition, particle), origin: particle, tet, role: Role::Whole, terms }
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
    let volume_m3 = partition.moments(cell).volume_m3 / 8.0;
    Row { volume_m3, origin, tet: partition.cells()[cell].tet, role: Role::Whole, terms }
}
