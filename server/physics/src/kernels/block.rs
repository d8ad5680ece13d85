//! Tets in blocks of `N` lanes (an array of structs of arrays), and the loop over them.
//!
//! A few blocks at a time: gather the corners' displacements (and velocities) as differences to corner 0, compute all
//! lanes a vector at a time, scatter the corner forces lane by lane in a fixed order. Three separate passes, because a wide
//! load waits for the narrow stores it overlaps until they have left the store buffer.
#![allow(unsafe_code)] // unchecked node indices in gather and scatter: 10 % of the kernel's time (docs/adr)
use super::{
    laws::{Constants, LaneLaw, M3, columns, plus, rows, viscous},
    products,
    tangents::LaneTangent,
};
use crate::lanes::nodes::{Lanes, Node, Sum};
use crate::lanes::{
    dispatch::Pass,
    real::{Real, Scalar, Vector},
};
use crate::material::Material;
use glam::DMat3;

/// Rest data of `N` tets. Lanes of padding have four times the spare node, no gradients and no volume.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Block<T, const N: usize> {
    /// Corners of each lane.
    pub(crate) nodes: [[u32; 4]; N],
    /// `b_1`, `b_2`, `b_3` (1/m): entry `3(i − 1) + axis`.
    pub(crate) gradients: [[T; N]; 9],
    /// `−V` (m³).
    pub(crate) minus_volume: [T; N],
}

/// All blocks of a body, with node indices that were checked.
#[derive(Debug, Clone)]
pub(crate) struct Blocks<T, const N: usize> {
    blocks: Vec<Block<T, N>>,
    nodes: usize,
}

impl<T: Scalar, const N: usize> Blocks<T, N> {
    /// Blocks over `nodes` nodes, and the spare one of that index.
    pub(crate) fn new(blocks: Vec<Block<T, N>>, nodes: usize) -> Self {
        let in_range = |block: &Block<T, N>| block.nodes.iter().flatten().all(|&node| node as usize <= nodes);
        assert!(blocks.iter().all(in_range), "a tet refers to a node that is not there");
        Self { blocks, nodes }
    }

    /// The blocks of a run.
    pub(crate) fn of(&self, run: &Run<T>) -> &[Block<T, N>] {
        &self.blocks[run.blocks.clone()]
    }
}

/// Consecutive blocks of one material.
#[derive(Debug, Clone)]
pub(crate) struct Run<T> {
    pub(crate) material: Material,
    pub(crate) constants: Constants<T>,
    pub(crate) blocks: std::ops::Range<usize>,
}

/// What the loop over blocks works on. Made by [`Job::new`] alone, so that its node indices are in range.
pub(crate) struct Job<'a, T, const N: usize> {
    blocks: &'a [Block<T, N>],
    constants: Constants<T>,
    displacements: &'a [Node],
    velocities: &'a [Node],
    sums: &'a mut [Sum],
    /// Factors of elastic and viscous stiffness; products only.
    factors: [f64; 2],
}

impl<'a, T: Scalar, const N: usize> Job<'a, T, N> {
    /// `displacements` and `sums` have an entry per node and a spare one; so have `velocities`, unless no pass reads them.
    pub(crate) fn new(
        blocks: &'a Blocks<T, N>,
        run: &Run<T>,
        displacements: &'a [Node],
        velocities: &'a [Node],
        sums: &'a mut [Sum],
    ) -> Self {
        let entries = blocks.nodes + 1;
        assert!(displacements.len() == entries && sums.len() == entries, "buffers of another kernel");
        Self { blocks: blocks.of(run), constants: run.constants, displacements, velocities, sums, factors: [1.0; 2] }
    }

    /// The same for products with `directions`.
    pub(crate) fn for_products(
        blocks: &'a Blocks<T, N>,
        run: &Run<T>,
        displacements: &'a [Node],
        directions: &'a [Node],
        sums: &'a mut [Sum],
        factors: [f64; 2],
    ) -> Self {
        Self { factors, ..Self::new(blocks, run, displacements, directions, sums) }
    }
}

/// Blocks that are gathered, computed and scattered together.
const BATCH: usize = 4;

/// Forces of elastic and viscous stress.
pub(crate) struct Forces<'a, 'b, T, const N: usize>(pub(crate) &'b mut Job<'a, T, N>);

/// Products `−(α K + β C) a`, with the factors of the job and its velocities as `a`.
pub(crate) struct Products<'a, 'b, T, const N: usize>(pub(crate) &'b mut Job<'a, T, N>);

impl<T: Scalar, const N: usize> Pass<T> for Forces<'_, '_, T, N> {
    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(&mut self) -> f64 {
        add::<V, T, L, VISCOUS, false, N>(self.0)
    }
}

impl<T: Scalar, const N: usize> Pass<T> for Products<'_, '_, T, N> {
    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(&mut self) -> f64 {
        add::<V, T, L, VISCOUS, true, N>(self.0)
    }
}

#[inline(always)]
fn add<V: Vector<Scalar = T>, T: Scalar, L: LaneTangent, const VISCOUS: bool, const PRODUCTS: bool, const N: usize>(
    job: &mut Job<'_, T, N>,
) -> f64 {
    let reads_velocities = VISCOUS || PRODUCTS;
    assert!(!reads_velocities || job.velocities.len() == job.displacements.len(), "buffers of another kernel");
    let mut edges: [Lanes<T, N>; BATCH] = [[[T::of(0.0); N]; 9]; BATCH];
    let mut edge_rates = edges;
    let mut forces = edges;
    let mut power_w = 0.0;
    for batch in job.blocks.chunks(BATCH) {
        for (index, block) in batch.iter().enumerate() {
            gather::<V, N>(&block.nodes, job.displacements, &mut edges[index]);
            if reads_velocities {
                gather::<V, N>(&block.nodes, job.velocities, &mut edge_rates[index]);
            }
        }
        for (index, block) in batch.iter().enumerate() {
            let input = Input { block, edges: &edges[index], edge_rates: &edge_rates[index] };
            if PRODUCTS {
                products::compute::<V, T, L, VISCOUS, N>(&job.constants, job.factors, &input, &mut forces[index]);
            } else {
                power_w += compute::<V, T, L, VISCOUS, N>(&job.constants, &input, &mut forces[index]);
            }
        }
        for (index, block) in batch.iter().enumerate() {
            scatter(&block.nodes, &forces[index], job.sums);
        }
    }
    power_w
}

/// One block, gathered.
pub(crate) struct Input<'a, T, const N: usize> {
    pub(crate) block: &'a Block<T, N>,
    pub(crate) edges: &'a Lanes<T, N>,
    pub(crate) edge_rates: &'a Lanes<T, N>,
}

/// Forces of one block; returns the viscous power (W).
#[inline(always)]
fn compute<V: Vector<Scalar = T>, T: Scalar, L: LaneLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    input: &Input<'_, T, N>,
    forces: &mut Lanes<T, N>,
) -> f64 {
    let c: Constants<V> = constants.converted();
    let mut inside = [T::of(0.0); N];
    let mut power = [T::of(0.0); N];
    for first in (0..N).step_by(V::WIDTH) {
        let b: [V; 9] = load(&input.block.gradients, first);
        let minus_volume = V::load(&input.block.minus_volume[first..]);
        let h = gradient(&b, &load(input.edges, first));
        let (mut p, domain) = L::piola(&c, &h);
        if VISCOUS {
            let (viscous_p, density) = viscous(&c, &h, &gradient(&b, &load(input.edge_rates, first)));
            p = plus(&p, &viscous_p);
            (V::of(0.0) - density * minus_volume).store(&mut power[first..]);
        }
        if L::DOMAIN.is_some() {
            domain.store(&mut inside[first..]);
        }
        let f = corner_forces(&b, minus_volume, &p);
        for component in 0..9 {
            f[component].store(&mut forces[component][first..]);
        }
    }
    if any_outside(&inside, L::DOMAIN) {
        redo_outside::<T, L, VISCOUS, N>(constants, input, &inside, forces);
    }
    if VISCOUS { power.iter().fold(0.0, |sum, &p| sum + p.into()) } else { 0.0 }
}

/// Whether any lane is outside a law's domain, if it has one. NaN is outside.
#[inline(always)]
pub(crate) fn any_outside<T: Scalar, const N: usize>(inside: &[T; N], domain: Option<f64>) -> bool {
    let Some(limit) = domain.map(T::of) else { return false };
    // Counted without an early exit: a vector loop.
    inside.iter().map(|&domain| u32::from(domain >= limit)).sum::<u32>() < N as u32
}

/// Lanes outside the law's domain, once more, in f64.
#[cold]
#[inline(never)]
fn redo_outside<T: Scalar, L: LaneLaw, const VISCOUS: bool, const N: usize>(
    constants: &Constants<T>,
    input: &Input<'_, T, N>,
    inside: &[T; N],
    forces: &mut Lanes<T, N>,
) {
    let limit = T::of(L::DOMAIN.unwrap_or(0.0));
    for lane in 0..N {
        if inside[lane] >= limit {
            continue;
        }
        let b: [f64; 9] = input.block.gradients.map(|component| component[lane].into());
        let h = gradient(&b, &input.edges.map(|component| component[lane].into()));
        let c: Constants<f64> = constants.converted();
        let mut p: M3<f64> = rows(&L::piola_outside(&c, &(columns(&h) + DMat3::IDENTITY)));
        if VISCOUS {
            let h_dot = gradient(&b, &input.edge_rates.map(|component| component[lane].into()));
            p = plus(&p, &viscous(&c, &h, &h_dot).0);
        }
        let f = corner_forces(&b, input.block.minus_volume[lane].into(), &p);
        for component in 0..9 {
            forces[component][lane] = T::of(f[component]);
        }
    }
}

#[inline(always)]
pub(crate) fn load<V: Vector, const N: usize>(lanes: &Lanes<V::Scalar, N>, first: usize) -> [V; 9] {
    let mut loaded = [V::of(0.0); 9];
    for component in 0..9 {
        loaded[component] = V::load(&lanes[component][first..]);
    }
    loaded
}

/// `Σ_{i=1..3} (a_i − a_0) b_iᵀ`.
#[inline(always)]
pub(crate) fn gradient<V: Real>(b: &[V; 9], edges: &[V; 9]) -> M3<V> {
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
pub(crate) fn corner_forces<V: Real>(b: &[V; 9], minus_volume: V, p: &M3<V>) -> [V; 9] {
    let mut f = *b;
    for corner in 0..3 {
        for row in 0..3 {
            f[3 * corner + row] = minus_volume
                * (p[row][0] * b[3 * corner] + p[row][1] * b[3 * corner + 1] + p[row][2] * b[3 * corner + 2]);
        }
    }
    f
}

/// `a_i − a_0` of all lanes.
#[inline(always)]
fn gather<V: Vector, const N: usize>(nodes: &[[u32; 4]; N], values: &[Node], edges: &mut Lanes<V::Scalar, N>) {
    for first in (0..N).step_by(4) {
        let mut corners = [[&values[0]; 4]; 4];
        for tet in 0..4 {
            for corner in 0..4 {
                let node = nodes[first + tet][corner] as usize;
                debug_assert!(node < values.len());
                // SAFETY: `Blocks::new` checked `node <= Blocks::nodes`, `Job::new` and `add` that `values` has one entry more than that.
                corners[tet][corner] = unsafe { values.get_unchecked(node) };
            }
        }
        V::edges_to_lanes(&corners, edges, first);
    }
}

/// Adds the corners' forces, lane after lane: the same order, hence the same bits, always. `f_0 = −(f_1 + f_2 + f_3)` in f64.
#[inline(always)]
fn scatter<T: Scalar, const N: usize>(nodes: &[[u32; 4]; N], forces: &Lanes<T, N>, sums: &mut [Sum]) {
    for first in (0..N).step_by(4) {
        let rows = T::lanes_to_rows(forces, first);
        for tet in 0..4 {
            let mut f = [[0.0; 4]; 4];
            for axis in 0..4 {
                for corner in 0..3 {
                    f[corner + 1][axis] = rows[tet][corner][axis].into();
                }
                f[0][axis] = -(f[1][axis] + f[2][axis] + f[3][axis]);
            }
            for corner in 0..4 {
                let node = nodes[first + tet][corner] as usize;
                debug_assert!(node < sums.len());
                // SAFETY: `Blocks::new` checked `node <= Blocks::nodes`, `Job::new` that `sums` has one entry more than that.
                let sum = unsafe { sums.get_unchecked_mut(node) };
                for axis in 0..4 {
                    sum.0[axis] += f[corner][axis];
                }
            }
        }
    }
}
