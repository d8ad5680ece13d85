//! Forces of mesh springs, node by node: each spring is stored at both of its ends, so that forces are gathered and
//! never scattered. The oracle is [`super::Net`].
//!
//! ```text
//! f_i = Σ_j k_ij (1 − r_ij/|l_ij|) l_ij,   l_ij = x_j − x_i
//! ```
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
use crate::lanes::{
    dispatch::{Available, InstructionSet, Pass, run},
    real::Vector,
};
use glam::DVec3;

/// Number of nodes in a block, which makes one or more whole vectors on every instruction set.
const LANES: usize = 8;
/// Springs shorter than this (m) have no direction and no force.
const NO_LENGTH_M: f64 = 1e-12;

/// The springs of nodes that move, in blocks of eight nodes. A block has as many slots as its node with the most
/// springs.
#[derive(Debug, Clone)]
pub struct SpringRows {
    /// First slot of each block, then the end of the last block's slots.
    first_slot: Vec<u32>,
    slots: Vec<Slot>,
    nodes: usize,
    instruction_set: Available,
}

/// One spring of each of the eight nodes of a block.
#[derive(Debug, Clone, Copy)]
struct Slot {
    neighbours: [u32; LANES],
    rest_length_m: [f64; LANES],
    stiffness_n_per_m: [f64; LANES],
}

/// A spring as one of its ends sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HalfSpring {
    /// The other end.
    pub neighbour: u32,
    /// Rest length `r` (m).
    pub rest_length_m: f64,
    /// Stiffness `k` (N/m).
    pub stiffness_n_per_m: f64,
}

impl SpringRows {
    /// Returns rows without nodes that have room for so many nodes with so many springs each.
    pub fn with_room(nodes: usize, springs_a_node: usize) -> Self {
        let blocks = nodes.div_ceil(LANES);
        let mut first_slot = Vec::with_capacity(blocks + 1);
        first_slot.push(0);
        Self {
            first_slot,
            slots: Vec::with_capacity(blocks * springs_a_node),
            nodes: 0,
            instruction_set: Available::best(),
        }
    }

    /// Returns the same rows limited to an instruction set, or to the best available one below it (for tests and
    /// benchmarks).
    #[must_use]
    pub fn with_instruction_set(self, instruction_set: InstructionSet) -> Self {
        Self { instruction_set: Available::at_most(instruction_set), ..self }
    }

    /// Removes all nodes. Nothing is allocated.
    pub fn clear(&mut self) {
        self.nodes = 0;
        self.slots.clear();
        self.first_slot.truncate(1);
    }

    /// Appends the next node with its springs, whose neighbours are numbered as the positions of
    /// [`Self::add_forces_n`]. Nothing is allocated while there is room.
    pub fn push(&mut self, springs: impl Iterator<Item = HalfSpring>) {
        let (lane, own) = (self.nodes % LANES, self.nodes as u32);
        let first = if lane == 0 {
            self.slots.len()
        } else {
            self.first_slot.pop();
            self.first_slot.last().map_or(0, |&first| first as usize)
        };
        for (number, spring) in springs.enumerate() {
            if first + number == self.slots.len() {
                // A node with fewer springs gets one from itself to itself, without length and force.
                let block = own - lane as u32;
                self.slots.push(Slot {
                    neighbours: std::array::from_fn(|lane| block + lane as u32),
                    rest_length_m: [0.0; LANES],
                    stiffness_n_per_m: [0.0; LANES],
                });
            }
            let slot = &mut self.slots[first + number];
            slot.neighbours[lane] = spring.neighbour;
            slot.rest_length_m[lane] = spring.rest_length_m;
            slot.stiffness_n_per_m[lane] = spring.stiffness_n_per_m;
        }
        self.first_slot.push(self.slots.len() as u32);
        self.nodes += 1;
    }

    /// Returns the number of nodes.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Adds the springs' forces (N) on the nodes. `x_m` (m) has the positions of the nodes, then of the other
    /// neighbours. A lane of the last block without a node, which has no force, reads the last entry where `x_m` ends
    /// before it.
    pub fn add_forces_n(&self, x_m: &[DVec3], forces_n: &mut [DVec3]) {
        run(self.instruction_set, Pull { rows: self, x_m, forces_n });
    }
}

struct Pull<'a> {
    rows: &'a SpringRows,
    x_m: &'a [DVec3],
    forces_n: &'a mut [DVec3],
}

impl Pass for Pull<'_> {
    type Scalar = f64;
    type Found = ();

    #[inline(always)]
    fn run<V: Vector<Scalar = f64>>(self) {
        let Self { rows, x_m, forces_n } = self;
        let Some(last) = x_m.len().checked_sub(1) else { return };
        for (block, ends) in rows.first_slot.windows(2).enumerate() {
            let own = block * LANES;
            if own >= rows.nodes {
                break;
            }
            let here = gathered(x_m, std::array::from_fn(|lane| (own + lane).min(last) as u32), last);
            let mut sums = [[0.0; LANES]; 3];
            for slot in &rows.slots[ends[0] as usize..ends[1] as usize] {
                let there = gathered(x_m, slot.neighbours, last);
                for first in (0..LANES).step_by(V::WIDTH) {
                    let l: [V; 3] =
                        std::array::from_fn(|axis| V::load(&there[axis][first..]) - V::load(&here[axis][first..]));
                    let length = (l[0] * l[0] + l[1] * l[1] + l[2] * l[2]).sqrt().max(V::of(NO_LENGTH_M));
                    let stiffness = V::load(&slot.stiffness_n_per_m[first..]);
                    let pull = stiffness - stiffness * V::load(&slot.rest_length_m[first..]) / length;
                    for (sum, l) in sums.iter_mut().zip(l) {
                        (V::load(&sum[first..]) + l * pull).store(&mut sum[first..]);
                    }
                }
            }
            for (lane, force) in forces_n[own..rows.nodes.min(own + LANES)].iter_mut().enumerate() {
                *force += DVec3::new(sums[0][lane], sums[1][lane], sums[2][lane]);
            }
        }
    }
}

#[inline(always)]
fn gathered(x_m: &[DVec3], nodes: [u32; LANES], last: usize) -> [[f64; LANES]; 3] {
    let mut parts = [[0.0; LANES]; 3];
    for (lane, node) in nodes.into_iter().enumerate() {
        let x = x_m[(node as usize).min(last)];
        (parts[0][lane], parts[1][lane], parts[2][lane]) = (x.x, x.y, x.z);
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::{
        Net,
        testing::{hexagon, sphere},
    };

    /// Returns the rows of a net, in the order of its nodes.
    fn rows_of(net: &Net) -> SpringRows {
        let mut rows = SpringRows::with_room(net.rest_m.len(), 8);
        for node in 0..net.rest_m.len() as u32 {
            let at = net.springs.iter().filter(|spring| spring.nodes.contains(&node));
            rows.push(at.map(|spring| HalfSpring {
                neighbour: spring.nodes[usize::from(spring.nodes[0] == node)],
                rest_length_m: spring.rest_length_m,
                stiffness_n_per_m: spring.stiffness_n_per_m,
            }));
        }
        rows
    }

    #[test]
    fn forces_are_the_oracles_on_every_instruction_set_with_the_same_bits() {
        for surface in [hexagon(1, 0.03), hexagon(5, 0.03), sphere(2, 0.05)] {
            let mut net = Net::uniform(&surface, 60.0, 0.0);
            for (number, spring) in net.springs.iter_mut().enumerate() {
                spring.stiffness_n_per_m *= 1.0 + 0.5 * (number as f64).sin();
            }
            let shake = |node: usize| {
                DVec3::new((3.0 * node as f64).sin(), (5.0 * node as f64).cos(), (7.0 * node as f64).sin())
            };
            let x: Vec<DVec3> = net.rest_m.iter().enumerate().map(|(node, rest)| *rest + shake(node) * 6e-3).collect();
            let expected = net.forces_n(&x);
            let scale = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
            let rows = rows_of(&net);
            let mut first: Option<Vec<DVec3>> = None;
            for set in InstructionSet::available() {
                let mut forces = vec![DVec3::ZERO; x.len()];
                rows.clone().with_instruction_set(set).add_forces_n(&x, &mut forces);
                for (force, expected) in forces.iter().zip(&expected) {
                    assert!(force.distance(*expected) < 1e-14 * scale, "{set:?}: {force} {expected}");
                }
                assert_eq!(first.get_or_insert_with(|| forces.clone()), &forces, "{set:?}");
            }
        }
    }

    #[test]
    fn nodes_that_coincide_pull_nobody_and_rows_can_be_filled_again() {
        let mut net = Net::uniform(&hexagon(1, 0.03), 60.0, 0.0);
        let rows = rows_of(&net);
        let x = vec![DVec3::ONE; 7];
        let mut forces = vec![DVec3::ZERO; 7];
        rows.add_forces_n(&x, &mut forces);
        assert!(forces.iter().all(|force| *force == DVec3::ZERO));
        net.springs.truncate(3);
        let mut again = rows.clone();
        again.clear();
        assert_eq!(again.nodes(), 0);
        again.add_forces_n(&net.rest_m, &mut forces);
        for _ in 0..7 {
            again.push(std::iter::once(HalfSpring { neighbour: 0, rest_length_m: 0.01, stiffness_n_per_m: 10.0 }));
        }
        again.add_forces_n(&net.rest_m, &mut forces);
        assert!((forces[1].length() - 0.2).abs() < 1e-12 && forces[0] == DVec3::ZERO, "{forces:?}");
    }
}
