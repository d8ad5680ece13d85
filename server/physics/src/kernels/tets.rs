//! Tets in blocks of `N` lanes (an array of structs of arrays), and the loop over them.
use super::{forces, products};
use crate::lanes::{
    blocks::{BATCH, BatchLanes, Blocks},
    nodes::{Lanes, Node, Sum},
    real::{Real, Scalar, Vector},
};
use crate::material::{ConstitutiveLaw, LawPass, Material, constants::Constants, lane_matrix::M3};
use std::ops::Range;

/// Rest data of `N` tets. Lanes of padding have no gradients and no volume, and four times the spare node.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(super) struct RestLanes<T, const N: usize> {
    /// `b_1`, `b_2`, `b_3` (1/m): entry `3(i − 1) + axis`.
    pub(super) gradients: [[T; N]; 9],
    /// `−V` (m³).
    pub(super) minus_volume: [T; N],
}

/// All tets of a body, over its nodes and one spare node behind them.
pub(super) type TetBlocks<T, const N: usize> = Blocks<RestLanes<T, N>, N>;

/// Consecutive blocks of one material.
#[derive(Debug, Clone)]
pub(super) struct Run<T> {
    pub(super) material: Material,
    pub(super) constants: Constants<T>,
    pub(super) blocks: Range<usize>,
}

/// Forces of elastic and viscous stress on the nodes of a run; lists have an entry per node and a spare one.
pub(super) struct Forces<'a, T, const N: usize> {
    pub(super) blocks: &'a TetBlocks<T, N>,
    pub(super) run: &'a Run<T>,
    pub(super) displacements: &'a [Node],
    /// Empty if no pass reads them.
    pub(super) velocities: &'a [Node],
    /// Added to.
    pub(super) sums: &'a mut [Sum],
}

/// Products `−(α K + β C) a` on the nodes of a run; lists have an entry per node and a spare one.
pub(super) struct Products<'a, T, const N: usize> {
    pub(super) blocks: &'a TetBlocks<T, N>,
    pub(super) run: &'a Run<T>,
    pub(super) displacements: &'a [Node],
    /// `a`.
    pub(super) directions: &'a [Node],
    /// Factors α of elastic and β of viscous stiffness.
    pub(super) factors: [f64; 2],
    /// Added to.
    pub(super) sums: &'a mut [Sum],
}

/// One block, gathered.
pub(super) struct Gathered<'a, T, const N: usize> {
    pub(super) rest: &'a RestLanes<T, N>,
    /// Differences `u_i − u_0` of displacements (m).
    pub(super) edges: &'a Lanes<T, N>,
    /// Differences of velocities (m/s) or of what is multiplied, if the pass reads them.
    pub(super) edge_rates: &'a Lanes<T, N>,
}

impl<T: Scalar, const N: usize> LawPass for Forces<'_, T, N> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let mut edges: BatchLanes<T, N> = [[[T::of(0.0); N]; 9]; BATCH];
        let mut edge_rates = edges;
        let mut forces = edges;
        let mut power_w = 0.0;
        for batch in self.blocks.batches(self.run.blocks.clone()) {
            batch.gather::<V>(self.displacements, &mut edges);
            if VISCOUS {
                batch.gather::<V>(self.velocities, &mut edge_rates);
            }
            for (index, block) in batch.blocks().iter().enumerate() {
                let input = Gathered { rest: &block.rest, edges: &edges[index], edge_rates: &edge_rates[index] };
                power_w += forces::compute::<V, T, L, VISCOUS, N>(&self.run.constants, &input, &mut forces[index]);
            }
            batch.scatter(&forces, self.sums);
        }
        power_w
    }
}

impl<T: Scalar, const N: usize> LawPass for Products<'_, T, N> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let mut edges: BatchLanes<T, N> = [[[T::of(0.0); N]; 9]; BATCH];
        let mut edge_rates = edges;
        let mut forces = edges;
        for batch in self.blocks.batches(self.run.blocks.clone()) {
            batch.gather::<V>(self.displacements, &mut edges);
            batch.gather::<V>(self.directions, &mut edge_rates);
            for (index, block) in batch.blocks().iter().enumerate() {
                let input = Gathered { rest: &block.rest, edges: &edges[index], edge_rates: &edge_rates[index] };
                let of_block = &mut forces[index];
                products::compute::<V, T, L, VISCOUS, N>(&self.run.constants, self.factors, &input, of_block);
            }
            batch.scatter(&forces, self.sums);
        }
        0.0
    }
}

/// Nine components of some lanes.
#[inline(always)]
pub(super) fn load<V: Vector, const N: usize>(lanes: &Lanes<V::Scalar, N>, first: usize) -> [V; 9] {
    let mut loaded = [V::of(0.0); 9];
    for component in 0..9 {
        loaded[component] = V::load(&lanes[component][first..]);
    }
    loaded
}

/// `∇a = Σ_{i=1..3} (a_i − a_0) b_iᵀ`.
#[inline(always)]
pub(super) fn gradient<V: Real>(b: &[V; 9], edges: &[V; 9]) -> M3<V> {
    let mut h = [[V::of(0.0); 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            h[row][column] = edges[row] * b[column] + edges[3 + row] * b[3 + column] + edges[6 + row] * b[6 + column];
        }
    }
    h
}

/// `f_i = −V P b_i`, `i = 1, 2, 3`.
#[inline(always)]
pub(super) fn corner_forces<V: Real>(b: &[V; 9], minus_volume: V, p: &M3<V>) -> [V; 9] {
    let mut f = *b;
    for corner in 0..3 {
        for row in 0..3 {
            f[3 * corner + row] = minus_volume
                * (p[row][0] * b[3 * corner] + p[row][1] * b[3 * corner + 1] + p[row][2] * b[3 * corner + 2]);
        }
    }
    f
}
