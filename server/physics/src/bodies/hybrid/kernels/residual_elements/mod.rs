//! The residual elements of a hybrid body's coarse tets (`hybrid::residual_element` is the oracle), in blocks of lanes:
//! one tet per lane.
//!
//! A lane's nodes are its tet's ten and those of neighbouring tets that its cells' particles follow. The parts' moments
//! are kept only where some lane of a block has one, part by part; so nodes that have moments of the same parts get the
//! same local numbers in their lanes ([`assign_local_nodes`]). The first node needs no moments, for they sum to zero.
//! Cells that wake are taken from a lane's moments and volumes in place.
mod forces;
mod local_nodes;

use super::prestrains::Found;
use crate::{
    bodies::hybrid::{composite::PARTS, prestrain::ResidualPrestrain, residual_element::ResidualElement},
    lanes::{
        Available, InstructionSet, LANES_F32, LANES_F64,
        grid::DisplacementGrid,
        nodes::{Lanes, Node, Sum, node},
        real::Scalar,
    },
    material::{Material, constants::Constants},
    settings::Precision,
};
use forces::ResidualForces;
use glam::{DMat3, DVec3};
use local_nodes::assign_local_nodes;
use std::ops::Range;

/// Tets in lanes. Lanes of padding have the spare node throughout, and zeros.
#[derive(Debug, Clone)]
struct ResidualBlock<T, const N: usize> {
    /// Node of every local number and lane; the first is followed by full groups of three.
    nodes: Vec<[u32; N]>,
    /// Range of entries in `local_nodes` and `moments` of every part.
    parts: [Range<usize>; PARTS],
    /// Local number of each entry's node, from 1.
    local_nodes: Vec<u16>,
    /// `T_gi` (m²).
    moments: Vec<[[T; N]; 3]>,
    /// `1/V_g` (1/m³), 0 of an empty part.
    inverse_volume: [[T; N]; PARTS],
    /// `V_g/V_e`.
    weight: [[T; N]; PARTS],
    /// `V_g` (m³).
    volume: [[T; N]; PARTS],
    /// Prestrain of the parts' shape and of the tet's volume (`hybrid::prestrain`), entries row by row.
    prestrains: [[[T; N]; 9]; PARTS + 1],
    /// Number of lanes with prestrain.
    prestrained: u32,
}

/// Blocks of one material.
#[derive(Debug, Clone)]
struct Run<T> {
    material: Material,
    of_shape: Constants<T>,
    of_volume: Constants<T>,
    blocks: Range<usize>,
}

#[derive(Debug, Clone)]
struct Tables<T, const N: usize> {
    blocks: Vec<ResidualBlock<T, N>>,
    runs: Vec<Run<T>>,
    /// Block and lane of every tet.
    lane_of: Vec<(u32, u32)>,
    is_prestrained: Vec<bool>,
    /// Local number, in its lane, of every node of each tet's residual element.
    local_nodes_of: Vec<Vec<u16>>,
    edges: Vec<Lanes<T, N>>,
    rates: Vec<Lanes<T, N>>,
    forces: Vec<Lanes<T, N>>,
}

#[derive(Debug, Clone)]
enum Layout {
    Single(Tables<f32, LANES_F32>),
    Double(Tables<f64, LANES_F64>),
}

/// Forces of the residual elements of coarse tets.
#[derive(Debug, Clone)]
pub struct ResidualKernel {
    layout: Layout,
    grid: DisplacementGrid,
    instruction_set: Available,
    displacements: Vec<Node>,
    /// Empty unless some material is viscous.
    velocities: Vec<Node>,
    sums: Vec<Sum>,
}

impl ResidualKernel {
    /// Lays out the residual elements of tets; `of_tet` indexes `materials`.
    pub fn build(
        residual_elements: &[ResidualElement],
        nodes: usize,
        of_tet: &[u16],
        materials: &[Material],
        precision: Precision,
    ) -> Self {
        let layout = match precision {
            Precision::Single => Layout::Single(Tables::build(residual_elements, nodes, of_tet, materials)),
            Precision::Double => Layout::Double(Tables::build(residual_elements, nodes, of_tet, materials)),
        };
        let is_viscous = materials.iter().any(|m| !m.viscosity.is_zero());
        // There is one spare node more, for the lanes of padding.
        let count = nodes + 1;
        let volumes_m3 = residual_elements.iter().map(|residual| residual.volume_m3.iter().sum());
        Self {
            layout,
            grid: DisplacementGrid::of_tets(precision, volumes_m3.fold(0.0, f64::max)),
            instruction_set: Available::best(),
            displacements: vec![Node::default(); count],
            velocities: vec![Node::default(); if is_viscous { count } else { 0 }],
            sums: vec![Sum::default(); count],
        }
    }

    /// Returns the same kernel, held to an instruction set or to the best available below it (for tests and
    /// benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Sets the residual element of a tet; its nodes are those that it had. Allocates nothing.
    pub fn put(&mut self, tet: usize, residual: &ResidualElement) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.put(tet, residual),
            Layout::Double(blocks) => blocks.put(tet, residual),
        }
    }

    /// Sets the prestrain of a tet, `None` for one without. Allocates nothing.
    pub fn put_prestrain(&mut self, tet: usize, prestrain: Option<&ResidualPrestrain>) {
        match &mut self.layout {
            Layout::Single(blocks) => blocks.put_prestrain(tet, prestrain),
            Layout::Double(blocks) => blocks.put_prestrain(tet, prestrain),
        }
    }

    /// Adds forces (N) of elastic and viscous stress to `forces_n` at `displacements_m` and velocities `v` of the
    /// coarse nodes, with the fraction `left` of the prestrain.
    pub fn add_forces_n(&mut self, displacements_m: &[DVec3], v: &[DVec3], left: f64, forces_n: &mut [DVec3]) -> Found {
        let Self { layout, grid, instruction_set, displacements, velocities, sums } = self;
        for (to, from) in displacements.iter_mut().zip(displacements_m) {
            *to = node(grid.rounded(*from));
        }
        for (to, from) in velocities.iter_mut().zip(v.iter().take(displacements_m.len())) {
            *to = node(*from);
        }
        sums.fill(Sum::default());
        let found = match layout {
            Layout::Single(blocks) => blocks.sum_up(*instruction_set, left, displacements, velocities, sums),
            Layout::Double(blocks) => blocks.sum_up(*instruction_set, left, displacements, velocities, sums),
        };
        for (force, Sum([x, y, z, _])) in forces_n.iter_mut().zip(&sums[..displacements_m.len()]) {
            *force += DVec3::new(*x, *y, *z);
        }
        found
    }
}

impl<T: Scalar, const N: usize> Tables<T, N> {
    fn build(residual_elements: &[ResidualElement], nodes: usize, of_tet: &[u16], materials: &[Material]) -> Self {
        let is_viscous = materials.iter().any(|m| !m.viscosity.is_zero());
        // Tets with as many nodes share a block; one that holds nothing of the body needs no lane.
        let mut order: Vec<usize> =
            (0..residual_elements.len()).filter(|&tet| !residual_elements[tet].nodes.is_empty()).collect();
        order.sort_by_key(|&tet| (of_tet[tet], residual_elements[tet].nodes.len(), tet));
        let mut built = Self {
            blocks: Vec::new(),
            runs: Vec::new(),
            lane_of: vec![(u32::MAX, 0); residual_elements.len()],
            is_prestrained: vec![false; residual_elements.len()],
            local_nodes_of: vec![Vec::new(); residual_elements.len()],
            edges: Vec::new(),
            rates: Vec::new(),
            forces: Vec::new(),
        };
        for same in order.chunk_by(|&a, &b| of_tet[a] == of_tet[b]) {
            let first = built.blocks.len();
            for lanes in same.chunks(N) {
                built.push_block(lanes, residual_elements, nodes as u32);
            }
            let material = &materials[of_tet[same[0]] as usize];
            let (of_shape, of_volume) = material.shape_and_volume();
            built.runs.push(Run {
                material: *material,
                of_shape: Constants::of(&of_shape),
                of_volume: Constants::of(&of_volume),
                blocks: first..built.blocks.len(),
            });
        }
        for &tet in &order {
            built.put(tet, &residual_elements[tet]);
        }
        let groups = built.blocks.iter().map(|block| block.nodes.len() / 3).max().unwrap_or(0);
        let zeros = [[T::of(0.0); N]; 9];
        built.edges = vec![zeros; groups];
        built.rates = vec![zeros; if is_viscous { groups } else { 0 }];
        built.forces = vec![zeros; groups];
        built
    }

    fn push_block(&mut self, tets_of_lanes: &[usize], residual_elements: &[ResidualElement], spare: u32) {
        let zero = T::of(0.0);
        let mut nodes: Vec<[u32; N]> = Vec::new();
        let mut parts_of_local_node: Vec<u8> = Vec::new();
        for (lane, &tet) in tets_of_lanes.iter().enumerate() {
            self.lane_of[tet] = (self.blocks.len() as u32, lane as u32);
            self.local_nodes_of[tet] = assign_local_nodes(&residual_elements[tet], &mut parts_of_local_node);
            nodes.resize(parts_of_local_node.len(), [spare; N]);
            for (&local_node, &node) in self.local_nodes_of[tet].iter().zip(&residual_elements[tet].nodes) {
                nodes[local_node as usize][lane] = node;
            }
        }
        // The first node is gathered with groups of three others.
        nodes.resize(1 + (nodes.len() - 1).next_multiple_of(3), [spare; N]);
        for local_nodes in 1..nodes.len() {
            for lane in 0..tets_of_lanes.len() {
                // A local number that a lane does not use gets its first node: it has no difference and no force.
                if nodes[local_nodes][lane] == spare {
                    nodes[local_nodes][lane] = nodes[0][lane];
                }
            }
        }
        let mut local_nodes = Vec::new();
        let parts = std::array::from_fn(|part| {
            let first = local_nodes.len();
            let has_moment = |local_node: &usize| parts_of_local_node[*local_node] & (1 << part) != 0;
            local_nodes.extend((1..parts_of_local_node.len()).filter(has_moment).map(|local_node| local_node as u16));
            first..local_nodes.len()
        });
        self.blocks.push(ResidualBlock {
            moments: vec![[[zero; N]; 3]; local_nodes.len()],
            nodes,
            parts,
            local_nodes,
            inverse_volume: [[zero; N]; PARTS],
            weight: [[zero; N]; PARTS],
            volume: [[zero; N]; PARTS],
            prestrains: [[[zero; N]; 9]; PARTS + 1],
            prestrained: 0,
        });
    }

    fn put(&mut self, tet: usize, residual: &ResidualElement) {
        let (block, lane) = self.lane_of[tet];
        let Some(block) = self.blocks.get_mut(block as usize) else { return };
        let lane = lane as usize;
        let total_m3 = residual.total_m3();
        for part in 0..PARTS {
            let volume_m3 = residual.volume_m3[part];
            let inverse = if volume_m3 > 0.0 { 1.0 / volume_m3 } else { 0.0 };
            block.inverse_volume[part][lane] = T::of(inverse);
            block.weight[part][lane] = T::of(volume_m3 / total_m3);
            block.volume[part][lane] = T::of(volume_m3);
        }
        for (&local_node, moments) in self.local_nodes_of[tet].iter().zip(&residual.moments_m2) {
            for (part, moment) in moments.iter().enumerate() {
                let of_part = block.parts[part].clone();
                if let Ok(entry) = block.local_nodes[of_part.clone()].binary_search(&local_node) {
                    for axis in 0..3 {
                        block.moments[of_part.start + entry][axis][lane] = T::of(moment[axis]);
                    }
                } else {
                    debug_assert!(local_node == 0 || *moment == DVec3::ZERO, "a moment that the tet had not");
                }
            }
        }
    }

    fn put_prestrain(&mut self, tet: usize, prestrain: Option<&ResidualPrestrain>) {
        let (block, lane) = self.lane_of[tet];
        let Some(block) = self.blocks.get_mut(block as usize) else { return };
        let lane = lane as usize;
        let was = self.is_prestrained[tet];
        block.prestrained =
            block.prestrained + u32::from(prestrain.is_some() && !was) - u32::from(prestrain.is_none() && was);
        self.is_prestrained[tet] = prestrain.is_some();
        for (number, lanes) in block.prestrains.iter_mut().enumerate() {
            let a = prestrain
                .map_or(DMat3::ZERO, |prestrain| prestrain.parts.get(number).copied().unwrap_or(prestrain.whole));
            for row in 0..3 {
                for column in 0..3 {
                    lanes[3 * row + column][lane] = T::of(a.col(column)[row]);
                }
            }
        }
    }

    fn sum_up(
        &mut self,
        set: Available,
        left: f64,
        displacements: &[Node],
        velocities: &[Node],
        sums: &mut [Sum],
    ) -> Found {
        let Self { blocks, runs, edges, rates, forces, .. } = self;
        let mut found = Found::default();
        for run in runs.iter() {
            let blocks = &blocks[run.blocks.clone()];
            let mut pass = ResidualForces {
                run,
                blocks,
                edges,
                rates,
                forces,
                displacements,
                velocities,
                sums,
                left,
                prestrain_j: 0.0,
            };
            let viscous_w = run.material.run(set, false, &mut pass);
            found += Found { viscous_w, prestrain_j: pass.prestrain_j };
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{Random, embedded_ball, tissue};

    /// The kernel finds the forces of the plain code, whatever the law and the precision, and the same bits with every
    /// instruction set, also after parts of some residual elements were taken.
    #[test]
    fn residual_elements_and_oracle_agree() {
        let partition = embedded_ball();
        let nodes = partition.coarse().positions_m().len();
        let of_tet: Vec<u16> = (0..partition.residual_elements().len()).map(|tet| (tet / 5 % 2) as u16).collect();
        let mut random = Random(71);
        let [stvk, neo, corotated] = tissue();
        for materials in [[neo, stvk], [corotated, neo]] {
            let mut residual_elements = partition.residual_elements().to_vec();
            for size in [1e-5, 1e-3, 6e-3] {
                let u: Vec<DVec3> = (0..nodes).map(|_| random.vector() * size).collect();
                let v: Vec<DVec3> = (0..nodes).map(|_| random.vector() * 0.1).collect();
                let x: Vec<DVec3> =
                    u.iter().zip(partition.coarse().positions_m()).map(|(u, rest)| *u + *rest).collect();
                let mut expected = vec![DVec3::ZERO; nodes];
                let power = |(residual, &m): (&ResidualElement, &u16)| {
                    residual.add_forces_n(&materials[m as usize], &x, &v, &mut expected)
                };
                let expected_w: f64 = residual_elements.iter().zip(&of_tet).map(power).sum();
                let largest = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
                for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 3e-5)] {
                    let run = |set| {
                        let mut kernel =
                            ResidualKernel::build(partition.residual_elements(), nodes, &of_tet, &materials, precision);
                        kernel = kernel.with_instruction_set(set);
                        residual_elements.iter().enumerate().for_each(|(tet, residual)| kernel.put(tet, residual));
                        let mut forces = vec![DVec3::ZERO; nodes];
                        let power_w = kernel.add_forces_n(&u, &v, 0.0, &mut forces).viscous_w;
                        (forces, power_w)
                    };
                    let baseline = run(InstructionSet::Baseline);
                    let worst = baseline.0.iter().zip(&expected).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                    assert!(worst < bound * largest, "{precision:?} {size}: {worst:e} of {largest:e}");
                    assert!((baseline.1 / expected_w - 1.0).abs() < 10.0 * bound, "{} {expected_w}", baseline.1);
                    for set in InstructionSet::available() {
                        assert!(run(set) == baseline, "{set:?}");
                    }
                }
                // Most of the volume is taken from some parts, and nearly all from others.
                for (number, residual) in residual_elements.iter_mut().enumerate().filter(|(number, _)| number % 3 > 0)
                {
                    let left = if number % 3 == 1 { 0.3 } else { 0.02 };
                    residual.volume_m3[number % PARTS] *= left;
                    residual.moments_m2.iter_mut().for_each(|moments| moments[number % PARTS] *= left);
                }
            }
        }
    }
}
