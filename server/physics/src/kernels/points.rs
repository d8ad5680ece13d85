//! Integration points over any number of nodes ([`IntegrationPoints`] is the oracle) in blocks of `N` lanes, one point a
//! lane, and the loop over them.
//!
//! A block's points have nodes in groups: the first node, which needs no gradient since they sum to zero, and groups of
//! three others. A lane with fewer nodes than its block repeats its first node, with gradients of zero.
use crate::{
    lanes::{
        nodes::{Lanes, Node, Sum},
        real::{Scalar, Vector},
    },
    material::{
        ConstitutiveLaw, LawPass, Material,
        constants::Constants,
        lane_matrix::{M3, columns, plus, rows, scaled},
        law::any_outside,
        viscous::lane_viscous,
    },
};
use glam::DMat3;
use std::ops::Range;

/// Groups of nodes that are gathered, and scattered, together: a wide load waits for the narrow stores it overlaps until
/// they have left the store buffer.
const GROUPS: usize = 6;

/// Rest data of `N` points. Lanes of padding have no gradients and no volume, and the spare node throughout.
#[derive(Debug, Clone)]
pub(super) struct PointBlock<T, const N: usize> {
    /// Where its first node is among the tables' nodes; its groups' nodes follow.
    pub(super) first_node: usize,
    /// Where its first gradient is among the tables' gradients.
    pub(super) first_gradient: usize,
    /// Groups of three nodes beside the first.
    pub(super) groups: usize,
    /// `−V` (m³).
    pub(super) minus_volume: [T; N],
}

/// Consecutive blocks of one material.
#[derive(Debug, Clone)]
pub(super) struct PointRun<T> {
    pub(super) material: Material,
    pub(super) constants: Constants<T>,
    pub(super) blocks: Range<usize>,
}

/// All points of a body, over its nodes and one spare node behind them.
#[derive(Debug, Clone)]
pub(super) struct PointTables<T, const N: usize> {
    /// A node of every lane.
    pub(super) nodes: Vec<[u32; N]>,
    /// `b` (1/m) of every lane, an axis at a time.
    pub(super) gradients: Vec<[[T; N]; 3]>,
    pub(super) blocks: Vec<PointBlock<T, N>>,
    pub(super) runs: Vec<PointRun<T>>,
}

/// A block with its nodes and gradients.
struct Block<'a, T, const N: usize> {
    first: &'a [u32; N],
    /// Three to a group.
    others: &'a [[u32; N]],
    gradients: &'a [[[T; N]; 3]],
    minus_volume: &'a [T; N],
}

impl<T: Scalar, const N: usize> PointTables<T, N> {
    #[inline(always)]
    fn block(&self, number: usize) -> Block<'_, T, N> {
        let block = &self.blocks[number];
        let nodes = &self.nodes[block.first_node..block.first_node + 1 + 3 * block.groups];
        Block {
            first: &nodes[0],
            others: &nodes[1..],
            gradients: &self.gradients[block.first_gradient..block.first_gradient + 3 * block.groups],
            minus_volume: &block.minus_volume,
        }
    }
}

/// Forces of elastic and viscous stress on the nodes of a run; lists have an entry per node and a spare one.
pub(super) struct PointForces<'a, T, const N: usize> {
    pub(super) tables: &'a PointTables<T, N>,
    pub(super) run: &'a PointRun<T>,
    pub(super) displacements: &'a [Node],
    /// Empty if no pass reads them.
    pub(super) velocities: &'a [Node],
    /// Added to.
    pub(super) sums: &'a mut [Sum],
}

/// Products `−(α K + β C) a` on the nodes of a run; lists have an entry per node and a spare one.
pub(super) struct PointProducts<'a, T, const N: usize> {
    pub(super) tables: &'a PointTables<T, N>,
    pub(super) run: &'a PointRun<T>,
    pub(super) displacements: &'a [Node],
    /// `a`.
    pub(super) directions: &'a [Node],
    /// Factors α of elastic and β of viscous stiffness.
    pub(super) factors: [f64; 2],
    /// Added to.
    pub(super) sums: &'a mut [Sum],
}

impl<T: Scalar, const N: usize> LawPass for PointForces<'_, T, N> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let c: Constants<V> = self.run.constants.converted();
        let mut power_w = 0.0;
        let mut buffers = Buffers::new();
        let (mut h, mut h_dot, mut stress) = ([[T::of(0.0); N]; 9], [[T::of(0.0); N]; 9], [[T::of(0.0); N]; 9]);
        for number in self.run.blocks.clone() {
            let block = self.tables.block(number);
            gradient::<V, N>(&block, self.displacements, &mut buffers, &mut h);
            if VISCOUS {
                gradient::<V, N>(&block, self.velocities, &mut buffers, &mut h_dot);
            }
            let (mut inside, mut power) = ([T::of(0.0); N], [T::of(0.0); N]);
            for first in (0..N).step_by(V::WIDTH) {
                let h = load::<V, N>(&h, first);
                let elastic = L::lane_piola(&c, &h);
                let mut p = elastic.p;
                if VISCOUS {
                    let viscous = lane_viscous(&c, &h, &load::<V, N>(&h_dot, first));
                    p = plus(&p, &viscous.p);
                    let minus_volume = V::load(&block.minus_volume[first..]);
                    (V::of(0.0) - viscous.power_density * minus_volume).store(&mut power[first..]);
                }
                if L::DOMAIN.is_some() {
                    elastic.domain.store(&mut inside[first..]);
                }
                store::<V, N>(&p, &mut stress, first);
            }
            if any_outside::<L, T, N>(&inside) {
                let constants = &self.run.constants;
                redo_outside::<T, L, N>(&inside, &mut stress, &mut |lane| {
                    let h = of_lane(&h, lane);
                    let mut p: M3<f64> = rows(&L::piola(constants.lame(), &(columns(&h) + DMat3::IDENTITY)));
                    if VISCOUS {
                        p = plus(&p, &lane_viscous(&constants.converted(), &h, &of_lane(&h_dot, lane)).p);
                    }
                    p
                });
            }
            if VISCOUS {
                power_w = power.iter().fold(power_w, |sum, &p| sum + p.into());
            }
            scatter::<V, N>(&block, &stress, &mut buffers, self.sums);
        }
        power_w
    }
}

impl<T: Scalar, const N: usize> LawPass for PointProducts<'_, T, N> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let c: Constants<V> = self.run.constants.converted();
        let [elastic, viscosity] = self.factors;
        let mut buffers = Buffers::new();
        let (mut h, mut df, mut stress) = ([[T::of(0.0); N]; 9], [[T::of(0.0); N]; 9], [[T::of(0.0); N]; 9]);
        for number in self.run.blocks.clone() {
            let block = self.tables.block(number);
            gradient::<V, N>(&block, self.displacements, &mut buffers, &mut h);
            gradient::<V, N>(&block, self.directions, &mut buffers, &mut df);
            let mut inside = [T::of(0.0); N];
            for first in (0..N).step_by(V::WIDTH) {
                let (h, df) = (load::<V, N>(&h, first), load::<V, N>(&df, first));
                let dp = L::lane_piola_differential(&c, &h, &df);
                let mut p = scaled(&dp.p, V::of(elastic));
                if VISCOUS {
                    p = plus(&p, &scaled(&lane_viscous(&c, &h, &df).p, V::of(viscosity)));
                }
                if L::DOMAIN.is_some() {
                    dp.domain.store(&mut inside[first..]);
                }
                store::<V, N>(&p, &mut stress, first);
            }
            if any_outside::<L, T, N>(&inside) {
                let constants = &self.run.constants;
                redo_outside::<T, L, N>(&inside, &mut stress, &mut |lane| {
                    let (h, df) = (of_lane(&h, lane), of_lane(&df, lane));
                    let f = columns(&h) + DMat3::IDENTITY;
                    let dp = L::piola_differential(constants.lame(), &f, &columns(&df));
                    let mut p = scaled(&rows(&dp), elastic);
                    if VISCOUS {
                        p = plus(&p, &scaled(&lane_viscous(&constants.converted(), &h, &df).p, viscosity));
                    }
                    p
                });
            }
            scatter::<V, N>(&block, &stress, &mut buffers, self.sums);
        }
        0.0
    }
}

/// Lanes of some groups of nodes, and the sums of forces of a block's lanes on their first nodes (N).
struct Buffers<T, const N: usize> {
    groups: [Lanes<T, N>; GROUPS],
    totals: [[f64; 4]; N],
}

impl<T: Scalar, const N: usize> Buffers<T, N> {
    #[inline(always)]
    fn new() -> Self {
        Self { groups: [[[T::of(0.0); N]; 9]; GROUPS], totals: [[0.0; 4]; N] }
    }
}

/// `Σ_i (a_i − a_0) b_iᵀ` of all lanes, row by row.
#[inline(always)]
fn gradient<V: Vector, const N: usize>(
    block: &Block<'_, V::Scalar, N>,
    values: &[Node],
    buffers: &mut Buffers<V::Scalar, N>,
    sum: &mut Lanes<V::Scalar, N>,
) {
    let groups = block.others.len() / 3;
    let mut from = 0;
    while from < groups {
        let count = GROUPS.min(groups - from);
        for group in 0..count {
            gather::<V, N>(block, from + group, values, &mut buffers.groups[group]);
        }
        for first in (0..N).step_by(V::WIDTH) {
            let mut h = if from == 0 { [[V::of(0.0); 3]; 3] } else { load::<V, N>(sum, first) };
            for group in 0..count {
                for edge in 0..3 {
                    let b = vector::<V, N>(&block.gradients[3 * (from + group) + edge], first);
                    for row in 0..3 {
                        let a = V::load(&buffers.groups[group][3 * edge + row][first..]);
                        for column in 0..3 {
                            h[row][column] = h[row][column] + a * b[column];
                        }
                    }
                }
            }
            store::<V, N>(&h, sum, first);
        }
        from += count;
    }
}

/// Writes `a_i − a_0` of a group's three nodes in all lanes.
#[inline(always)]
fn gather<V: Vector, const N: usize>(
    block: &Block<'_, V::Scalar, N>,
    group: usize,
    values: &[Node],
    edges: &mut Lanes<V::Scalar, N>,
) {
    for first in (0..N).step_by(4) {
        let mut corners = [[&values[0]; 4]; 4];
        for lane in 0..4 {
            corners[lane][0] = &values[block.first[first + lane] as usize];
            for edge in 0..3 {
                corners[lane][edge + 1] = &values[block.others[3 * group + edge][first + lane] as usize];
            }
        }
        V::edges_to_lanes(&corners, edges, first);
    }
}

/// Adds `f_i = −V P b_i`, lane after lane, so that the order, and hence the bits, are always the same. `f_0 = −Σ f_i` is
/// summed in f64.
#[inline(always)]
fn scatter<V: Vector, const N: usize>(
    block: &Block<'_, V::Scalar, N>,
    stress: &Lanes<V::Scalar, N>,
    buffers: &mut Buffers<V::Scalar, N>,
    sums: &mut [Sum],
) {
    let groups = block.others.len() / 3;
    buffers.totals = [[0.0; 4]; N];
    let mut from = 0;
    while from < groups {
        let count = GROUPS.min(groups - from);
        for first in (0..N).step_by(V::WIDTH) {
            let p = scaled(&load::<V, N>(stress, first), V::load(&block.minus_volume[first..]));
            for group in 0..count {
                for edge in 0..3 {
                    let b = vector::<V, N>(&block.gradients[3 * (from + group) + edge], first);
                    for row in 0..3 {
                        let force = p[row][0] * b[0] + p[row][1] * b[1] + p[row][2] * b[2];
                        force.store(&mut buffers.groups[group][3 * edge + row][first..]);
                    }
                }
            }
        }
        for group in 0..count {
            for first in (0..N).step_by(4) {
                let rows = V::Scalar::lanes_to_rows(&buffers.groups[group], first);
                for lane in 0..4 {
                    for edge in 0..3 {
                        let node = block.others[3 * (from + group) + edge][first + lane] as usize;
                        let (sum, total) = (&mut sums[node].0, &mut buffers.totals[first + lane]);
                        for axis in 0..4 {
                            let component: f64 = rows[lane][edge][axis].into();
                            total[axis] += component;
                            sum[axis] += component;
                        }
                    }
                }
            }
        }
        from += count;
    }
    for lane in 0..N {
        let sum = &mut sums[block.first[lane] as usize].0;
        for axis in 0..4 {
            sum[axis] -= buffers.totals[lane][axis];
        }
    }
}

/// Three components of some lanes. It is written out, since a closure would not be inlined into a function compiled for
/// its vectors' instruction set.
#[inline(always)]
fn vector<V: Vector, const N: usize>(lanes: &[[V::Scalar; N]; 3], first: usize) -> [V; 3] {
    [V::load(&lanes[0][first..]), V::load(&lanes[1][first..]), V::load(&lanes[2][first..])]
}

/// Computes the stress of lanes outside the law's domain once more, in f64.
#[cold]
#[inline(never)]
fn redo_outside<T: Scalar, L: ConstitutiveLaw, const N: usize>(
    inside: &[T; N],
    stress: &mut Lanes<T, N>,
    in_f64: &mut dyn FnMut(usize) -> M3<f64>,
) {
    let limit = T::of(L::DOMAIN.unwrap_or(0.0));
    for lane in 0..N {
        if inside[lane] >= limit {
            continue;
        }
        let p = in_f64(lane);
        for row in 0..3 {
            for column in 0..3 {
                stress[3 * row + column][lane] = T::of(p[row][column]);
            }
        }
    }
}

/// A matrix of some lanes.
#[inline(always)]
fn load<V: Vector, const N: usize>(lanes: &Lanes<V::Scalar, N>, first: usize) -> M3<V> {
    let mut loaded = [[V::of(0.0); 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            loaded[row][column] = V::load(&lanes[3 * row + column][first..]);
        }
    }
    loaded
}

#[inline(always)]
fn store<V: Vector, const N: usize>(matrix: &M3<V>, lanes: &mut Lanes<V::Scalar, N>, first: usize) {
    for row in 0..3 {
        for column in 0..3 {
            matrix[row][column].store(&mut lanes[3 * row + column][first..]);
        }
    }
}

/// A lane's matrix in f64.
fn of_lane<T: Scalar, const N: usize>(lanes: &Lanes<T, N>, lane: usize) -> M3<f64> {
    let entry = |number: usize| -> f64 { lanes[number][lane].into() };
    [0, 3, 6].map(|row| [entry(row), entry(row + 1), entry(row + 2)])
}
