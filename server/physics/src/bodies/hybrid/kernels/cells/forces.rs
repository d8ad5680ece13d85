//! The pass over cut cells: gather, stress, scatter.
use super::{CutBlock, PrestrainBlock};
use crate::{
    bodies::hybrid::{
        cell::MODE_WEIGHTS,
        hourglass_growth::{energy_factor, force_factor},
        kernels::{
            cell_stress::{load_matrix, stress},
            prestrains::{Split, add_lanes, prestrained_cell_stress, scaled},
        },
    },
    lanes::{
        nodes::{Lanes, Node, Sum},
        real::{Scalar, Vector},
    },
    material::{ConstitutiveLaw, LawPass},
};

/// Number of blocks that are gathered, computed and scattered together: a wide load waits for the narrow stores it
/// overlaps.
const BATCH: usize = 4;

/// Points 1 to 3, 4 to 6, and 7 of a block's cells, three components each; entries beyond them stay zero.
type Corners<T, const N: usize> = [Lanes<T, N>; 3];

/// The prestrains of a block, while its forces are computed.
struct PrestrainedBlock<'a, T, const N: usize> {
    block: &'a PrestrainBlock<T, N>,
    left: f64,
    /// `s ∂U/∂s` (J), added to.
    along_j: &'a mut f64,
}

/// The pass over the cells of one material.
pub(super) struct CutForces<'a, T, const N: usize> {
    pub(super) split: &'a Split<T>,
    pub(super) blocks: &'a [CutBlock<T, N>],
    /// Prestrains of the blocks, one for each.
    pub(super) prestrains: &'a [PrestrainBlock<T, N>],
    pub(super) displacements: &'a [Node],
    pub(super) velocities: &'a [Node],
    pub(super) sums: &'a mut [Sum],
    /// The fraction of the prestrain that is left.
    pub(super) left: f64,
    /// `s ∂U/∂s` (J), added to.
    pub(super) prestrain_j: f64,
}

impl<T: Scalar, const N: usize> LawPass for CutForces<'_, T, N> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let mut edges: [Corners<T, N>; BATCH] = [[[[T::of(0.0); N]; 9]; 3]; BATCH];
        let mut rates = edges;
        let mut forces = edges;
        let mut power_w = 0.0;
        for (number, batch) in self.blocks.chunks(BATCH).enumerate() {
            for (index, block) in batch.iter().enumerate() {
                gather::<V, N>(&block.points, self.displacements, &mut edges[index]);
                if VISCOUS {
                    gather::<V, N>(&block.points, self.velocities, &mut rates[index]);
                }
            }
            for (index, block) in batch.iter().enumerate() {
                let (edges, rates, forces) = (&edges[index], &rates[index], &mut forces[index]);
                let prestrain = Some(&self.prestrains[number * BATCH + index]).filter(|prestrain| prestrain.lanes != 0);
                let prestrain =
                    prestrain.map(|block| PrestrainedBlock { block, left: self.left, along_j: &mut self.prestrain_j });
                power_w += cut::<V, T, L, VISCOUS, N>(self.split, block, prestrain, edges, rates, forces);
            }
            for (block, forces) in batch.iter().zip(&forces) {
                scatter(&block.points, forces, self.sums);
            }
        }
        power_w
    }
}

/// Loads one axis of points 1 to 7.
#[inline(always)]
fn load<V: Vector, const N: usize>(corners: &Corners<V::Scalar, N>, axis: usize, first: usize) -> [V; 7] {
    let mut loaded = [V::of(0.0); 7];
    for p in 0..7 {
        loaded[p] = V::load(&corners[p / 3][3 * (p % 3) + axis][first..]);
    }
    loaded
}

#[inline(always)]
fn store<V: Vector, const N: usize>(values: &[V; 7], corners: &mut Corners<V::Scalar, N>, axis: usize, first: usize) {
    for p in 0..7 {
        values[p].store(&mut corners[p / 3][3 * (p % 3) + axis][first..]);
    }
}

/// Returns `Σ_p a_p b_pᵀ` of some lanes. It is not a closure, since one that is not inlined has no vectors of its
/// caller's instruction set.
#[inline(always)]
fn gradient<V: Vector, const N: usize>(
    block: &CutBlock<V::Scalar, N>,
    corners: &Corners<V::Scalar, N>,
    first: usize,
) -> [[V; 3]; 3] {
    let mut h = [[V::of(0.0); 3]; 3];
    for axis in 0..3 {
        let a = load::<V, N>(corners, axis, first);
        for p in 0..7 {
            for column in 0..3 {
                h[axis][column] = h[axis][column] + a[p] * V::load(&block.gradients[3 * p + column][first..]);
            }
        }
    }
    h
}

#[inline(always)]
fn cut<V: Vector<Scalar = T>, T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool, const N: usize>(
    split: &Split<T>,
    block: &CutBlock<T, N>,
    mut prestrain: Option<PrestrainedBlock<'_, T, N>>,
    edges: &Corners<T, N>,
    rates: &Corners<T, N>,
    forces: &mut Corners<T, N>,
) -> f64 {
    let mut power = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let h = gradient::<V, N>(block, edges, first);
        let h_dot = if VISCOUS { gradient::<V, N>(block, rates, first) } else { h };
        let whole = V::load(&block.minus_kappa[first..]);
        let mut gone = V::of(0.0);
        let mut prestrain_j = V::of(0.0);
        let (p, density) = if let Some(PrestrainedBlock { block: prestrain, left, .. }) = &prestrain {
            let left = V::of(*left);
            gone = V::load(&prestrain.entries[18][first..]) * left;
            let of_shape = scaled(&load_matrix::<V, N>(&prestrain.entries[..9], first), left);
            let of_volume = scaled(&load_matrix::<V, N>(&prestrain.entries[9..18], first), left);
            let (p, density, along) =
                prestrained_cell_stress::<V, T, L, VISCOUS>(split, &[of_shape, of_volume], &h, &h_dot);
            prestrain_j = V::of(0.0) - along * V::load(&block.minus_volume[first..]);
            (p, density)
        } else {
            stress::<V, T, L, VISCOUS>(&split.whole, &h, &h_dot)
        };
        let mut modes = [[V::of(0.0); 4]; 3];
        let mut squares = V::of(0.0);
        for axis in 0..3 {
            let a = load::<V, N>(edges, axis, first);
            for mode in 0..4 {
                let mut q = V::of(0.0);
                for point in 0..7 {
                    q = q + a[point] * V::load(&block.modes[7 * mode + point][first..]);
                }
                modes[axis][mode] = q;
                squares = squares + q * q * V::of(MODE_WEIGHTS[mode]);
            }
        }
        let grown = squares * V::load(&block.growth[first..]);
        // s ∂U/∂s = V P̃ : F A − ½ κ a Q ε
        prestrain_j = prestrain_j + squares * energy_factor(grown) * whole * gone * V::of(0.5);
        let minus_kappa = whole * (V::of(1.0) - gone) * force_factor(grown);
        let minus_volume = V::load(&block.minus_volume[first..]);
        if VISCOUS {
            (V::of(0.0) - density * minus_volume).store(&mut power[first..]);
        }
        for axis in 0..3 {
            let mut f = [V::of(0.0); 7];
            for point in 0..7 {
                let mut along = V::of(0.0);
                for column in 0..3 {
                    along = along + p[axis][column] * V::load(&block.gradients[3 * point + column][first..]);
                }
                f[point] = along * minus_volume;
            }
            for mode in 0..4 {
                let q = modes[axis][mode] * minus_kappa * V::of(MODE_WEIGHTS[mode]);
                for point in 0..7 {
                    f[point] = f[point] + q * V::load(&block.modes[7 * mode + point][first..]);
                }
            }
            store(&f, forces, axis, first);
        }
        if let Some(prestrain) = &mut prestrain {
            add_lanes(prestrain_j, prestrain.along_j);
        }
    }
    power.iter().fold(0.0, |sum, &p| sum + p.into())
}

/// Writes `a_p − a_0` of all lanes.
#[inline(always)]
fn gather<V: Vector, const N: usize>(points: &[[u32; 8]; N], values: &[Node], edges: &mut Corners<V::Scalar, N>) {
    for first in (0..N).step_by(4) {
        for group in 0..3 {
            let mut corners = [[&values[0]; 4]; 4];
            for cell in 0..4 {
                corners[cell][0] = &values[points[first + cell][0] as usize];
                for edge in 1..4 {
                    if 3 * group + edge < 8 {
                        corners[cell][edge] = &values[points[first + cell][3 * group + edge] as usize];
                    }
                }
            }
            V::edges_to_lanes(&corners, &mut edges[group], first);
        }
    }
}

/// Adds the points' forces, lane after lane, so that the order, and hence the bits, are always the same.
#[inline(always)]
fn scatter<T: Scalar, const N: usize>(points: &[[u32; 8]; N], forces: &Corners<T, N>, sums: &mut [Sum]) {
    for first in (0..N).step_by(4) {
        let mut total = [[0.0; 4]; 4];
        for group in 0..3 {
            let rows = T::lanes_to_rows(&forces[group], first);
            for cell in 0..4 {
                for corner in 0..3 {
                    if 3 * group + corner < 7 {
                        let sum = &mut sums[points[first + cell][3 * group + corner + 1] as usize].0;
                        for axis in 0..4 {
                            let component: f64 = rows[cell][corner][axis].into();
                            total[cell][axis] += component;
                            sum[axis] += component;
                        }
                    }
                }
            }
        }
        for cell in 0..4 {
            let sum = &mut sums[points[first + cell][0] as usize].0;
            for axis in 0..4 {
                sum[axis] -= total[cell][axis];
            }
        }
    }
}
