//! The pass over coarse tets: gather, stress, scatter.
use super::{ResidualBlock, Run};
use crate::{
    bodies::hybrid::{
        composite::PARTS,
        kernels::{
            cell_stress::{load_matrix, prestrained_stress, stress},
            prestrains::{add_lanes, scaled},
        },
    },
    lanes::{
        nodes::{Lanes, Node, Sum},
        real::{Scalar, Vector},
    },
    material::{
        ConstitutiveLaw, LawPass,
        lane_matrix::{M3, plus},
    },
};

/// The pass over the tets of one material.
pub(super) struct ResidualForces<'a, T, const N: usize> {
    pub(super) run: &'a Run<T>,
    pub(super) blocks: &'a [ResidualBlock<T, N>],
    pub(super) edges: &'a mut [Lanes<T, N>],
    pub(super) rates: &'a mut [Lanes<T, N>],
    pub(super) forces: &'a mut [Lanes<T, N>],
    pub(super) displacements: &'a [Node],
    pub(super) velocities: &'a [Node],
    pub(super) sums: &'a mut [Sum],
    /// The fraction of the prestrain that is left.
    pub(super) left: f64,
    /// `s ∂U/∂s` (J), added to.
    pub(super) prestrain_j: f64,
}

impl<T: Scalar, const N: usize> LawPass for ResidualForces<'_, T, N> {
    type Scalar = T;

    #[inline(always)]
    fn run<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64 {
        let mut power_w = 0.0;
        for block in self.blocks {
            gather::<V, N>(&block.nodes, self.displacements, self.edges);
            if VISCOUS {
                gather::<V, N>(&block.nodes, self.velocities, self.rates);
            }
            for forces in &mut self.forces[..block.nodes.len() / 3] {
                *forces = [[T::of(0.0); N]; 9];
            }
            let mut power = [T::of(0.0); N];
            for first in (0..N).step_by(V::WIDTH) {
                self.lanes::<V, L, VISCOUS>(block, first, &mut power);
            }
            power_w = power.iter().fold(power_w, |sum, &lane| sum + lane.into());
            scatter(&block.nodes, self.forces, self.sums);
        }
        power_w
    }
}

impl<T: Scalar, const N: usize> ResidualForces<'_, T, N> {
    #[inline(always)]
    fn lanes<V: Vector<Scalar = T>, L: ConstitutiveLaw, const VISCOUS: bool>(
        &mut self,
        block: &ResidualBlock<T, N>,
        first: usize,
        power: &mut [T; N],
    ) {
        let zero = [[V::of(0.0); 3]; 3];
        let (mut strains, mut mean) = ([zero; PARTS], zero);
        for part in 0..PARTS {
            strains[part] = gradient::<V, N>(block, part, self.edges, first);
            let weight = V::load(&block.weight[part][first..]);
            for row in 0..3 {
                for column in 0..3 {
                    mean[row][column] = mean[row][column] + strains[part][row][column] * weight;
                }
            }
        }
        let prestrained = block.prestrained > 0;
        let (of_shape, of_volume) = (&self.run.of_shape, &self.run.of_volume);
        let mut prestrain_j = V::of(0.0);
        let left = V::of(self.left);
        let pressure = if prestrained {
            let a = scaled(&load_matrix::<V, N>(&block.prestrains[PARTS], first), left);
            let (p, _, along) = prestrained_stress::<V, T, L, false>(of_volume, &a, &mean, &mean);
            let mut volume = V::of(0.0);
            for part in 0..PARTS {
                volume = volume + V::load(&block.volume[part][first..]);
            }
            prestrain_j = along * volume;
            p
        } else {
            stress::<V, T, L, false>(of_volume, &mean, &mean).0
        };
        for part in 0..PARTS {
            let h_dot = if VISCOUS { gradient::<V, N>(block, part, self.rates, first) } else { zero };
            let (p, density) = if prestrained {
                let a = scaled(&load_matrix::<V, N>(&block.prestrains[part], first), left);
                let (p, density, along) = prestrained_stress::<V, T, L, VISCOUS>(of_shape, &a, &strains[part], &h_dot);
                prestrain_j = prestrain_j + along * V::load(&block.volume[part][first..]);
                (p, density)
            } else {
                stress::<V, T, L, VISCOUS>(of_shape, &strains[part], &h_dot)
            };
            let p = plus(&p, &pressure);
            for entry in block.parts[part].clone() {
                let t = moment::<V, N>(&block.moments[entry], first);
                let local_node = block.local_nodes[entry] as usize - 1;
                let forces = &mut self.forces[local_node / 3];
                for row in 0..3 {
                    let along = p[row][0] * t[0] + p[row][1] * t[1] + p[row][2] * t[2];
                    let lanes = &mut forces[3 * (local_node % 3) + row][first..];
                    (V::load(lanes) - along).store(lanes);
                }
            }
            if VISCOUS {
                let sum = V::load(&power[first..]) + density * V::load(&block.volume[part][first..]);
                sum.store(&mut power[first..]);
            }
        }
        if prestrained {
            add_lanes(prestrain_j, &mut self.prestrain_j);
        }
    }
}

/// Returns `1/V_g Σ_i (a_i − a_0) T_giᵀ`.
#[inline(always)]
fn gradient<V: Vector, const N: usize>(
    block: &ResidualBlock<V::Scalar, N>,
    part: usize,
    edges: &[Lanes<V::Scalar, N>],
    first: usize,
) -> M3<V> {
    let mut sum = [[V::of(0.0); 3]; 3];
    for entry in block.parts[part].clone() {
        let t = moment::<V, N>(&block.moments[entry], first);
        let local_node = block.local_nodes[entry] as usize - 1;
        for row in 0..3 {
            let a = V::load(&edges[local_node / 3][3 * (local_node % 3) + row][first..]);
            for column in 0..3 {
                sum[row][column] = sum[row][column] + a * t[column];
            }
        }
    }
    let inverse = V::load(&block.inverse_volume[part][first..]);
    for row in &mut sum {
        for entry in row {
            *entry = *entry * inverse;
        }
    }
    sum
}

/// Loads a moment. It is written out, since a closure would not be inlined into a function compiled for its vectors'
/// instruction set.
#[inline(always)]
fn moment<V: Vector, const N: usize>(moment: &[[V::Scalar; N]; 3], first: usize) -> [V; 3] {
    [V::load(&moment[0][first..]), V::load(&moment[1][first..]), V::load(&moment[2][first..])]
}

/// Writes `a_i − a_0` of all lanes.
#[inline(always)]
fn gather<V: Vector, const N: usize>(nodes: &[[u32; N]], values: &[Node], edges: &mut [Lanes<V::Scalar, N>]) {
    for (group, edges) in edges.iter_mut().enumerate().take(nodes.len() / 3) {
        for first in (0..N).step_by(4) {
            let mut corners = [[&values[0]; 4]; 4];
            for lane in 0..4 {
                corners[lane][0] = &values[nodes[0][first + lane] as usize];
                for edge in 1..4 {
                    corners[lane][edge] = &values[nodes[3 * group + edge][first + lane] as usize];
                }
            }
            V::edges_to_lanes(&corners, edges, first);
        }
    }
}

/// Adds the nodes' forces, lane after lane, so that the order, and hence the bits, are always the same. `f_0 = −Σ f_i`
/// is summed in f64.
#[inline(always)]
fn scatter<T: Scalar, const N: usize>(nodes: &[[u32; N]], forces: &[Lanes<T, N>], sums: &mut [Sum]) {
    for first in (0..N).step_by(4) {
        let mut total = [[0.0; 4]; 4];
        for (group, forces) in forces.iter().enumerate().take(nodes.len() / 3) {
            let rows = T::lanes_to_rows(forces, first);
            for lane in 0..4 {
                for edge in 0..3 {
                    let sum = &mut sums[nodes[3 * group + edge + 1][first + lane] as usize].0;
                    for axis in 0..4 {
                        let component: f64 = rows[lane][edge][axis].into();
                        total[lane][axis] += component;
                        sum[axis] += component;
                    }
                }
            }
        }
        for lane in 0..4 {
            let sum = &mut sums[nodes[0][first + lane] as usize].0;
            for axis in 0..4 {
                sum[axis] -= total[lane][axis];
            }
        }
    }
}
