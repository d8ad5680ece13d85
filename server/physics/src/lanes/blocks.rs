//! Elements of four nodes in blocks of `N` lanes, and the way from their nodes to lanes and back.
//!
//! A pass takes a few blocks at a time ([`Batch`]): it gathers differences of what the nodes have, computes all lanes a
//! vector at a time, and scatters forces lane by lane in a fixed order. These are three passes over the batch, because
//! a wide load waits for the narrow stores it overlaps until they have left the store buffer.
#![allow(unsafe_code)] // unchecked node indices in gather and scatter: 10 % of the kernel's time (docs/adr/force-kernel.md)
use super::{
    nodes::{Lanes, Node, Sum},
    real::{Scalar, Vector},
};
use std::ops::Range;

/// Blocks that are gathered, computed and scattered together.
pub(crate) const BATCH: usize = 4;

/// One element per lane: its nodes, and its rest data `D`, which has as many lanes.
#[derive(Debug, Clone)]
#[repr(C, align(64))]
pub(crate) struct Block<D, const N: usize> {
    /// Nodes of each lane.
    pub(crate) nodes: [[u32; 4]; N],
    /// Rest data of all lanes.
    pub(crate) rest: D,
}

/// Blocks whose node indices were checked. They cannot be changed any more.
#[derive(Debug, Clone)]
pub(crate) struct Blocks<D, const N: usize> {
    /// Every node index in them is below `entries`.
    blocks: Vec<Block<D, N>>,
    entries: usize,
}

impl<D, const N: usize> Blocks<D, N> {
    /// Blocks over lists of nodes that have `entries` entries.
    ///
    /// # Panics
    /// If an element refers to an entry that is not there.
    pub(crate) fn new(blocks: Vec<Block<D, N>>, entries: usize) -> Self {
        let in_range = |block: &Block<D, N>| block.nodes.iter().flatten().all(|&node| (node as usize) < entries);
        assert!(blocks.iter().all(in_range), "an element refers to a node that is not there");
        Self { blocks, entries }
    }

    /// Some of the blocks, a batch at a time.
    #[inline(always)]
    pub(crate) fn batches(&self, blocks: Range<usize>) -> impl Iterator<Item = Batch<'_, D, N>> {
        let entries = self.entries;
        self.blocks[blocks].chunks(BATCH).map(move |blocks| Batch { blocks, entries })
    }
}

/// Up to [`BATCH`] blocks. Only [`Blocks`] makes one, so that its node indices are below `entries`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Batch<'a, D, const N: usize> {
    blocks: &'a [Block<D, N>],
    entries: usize,
}

/// Lanes of every block of a batch.
pub(crate) type BatchLanes<T, const N: usize> = [Lanes<T, N>; BATCH];

impl<'a, D, const N: usize> Batch<'a, D, N> {
    /// The blocks.
    #[inline(always)]
    pub(crate) fn blocks(&self) -> &'a [Block<D, N>] {
        self.blocks
    }

    /// Differences `a_i − a_0` of all lanes, from `values` with as many entries as the blocks were checked for.
    #[inline(always)]
    pub(crate) fn gather<V: Vector>(&self, values: &[Node], edges: &mut BatchLanes<V::Scalar, N>) {
        assert!(values.len() == self.entries, "buffers of another kernel");
        for (block, edges) in self.blocks.iter().zip(edges) {
            for first in (0..N).step_by(4) {
                let mut corners = [[&values[0]; 4]; 4];
                for lane in 0..4 {
                    for corner in 0..4 {
                        let node = block.nodes[first + lane][corner] as usize;
                        debug_assert!(node < values.len());
                        // SAFETY: `Blocks::new` checked `node < entries`, and `values` has so many.
                        corners[lane][corner] = unsafe { values.get_unchecked(node) };
                    }
                }
                V::edges_to_lanes(&corners, edges, first);
            }
        }
    }

    /// Adds the corners' forces to `sums`, which has as many entries as the blocks were checked for, lane after lane:
    /// the same order, hence the same bits, always. `f_0 = −(f_1 + f_2 + f_3)` in f64.
    #[inline(always)]
    pub(crate) fn scatter<T: Scalar>(&self, forces: &BatchLanes<T, N>, sums: &mut [Sum]) {
        assert!(sums.len() == self.entries, "buffers of another kernel");
        for (block, forces) in self.blocks.iter().zip(forces) {
            for first in (0..N).step_by(4) {
                let rows = T::lanes_to_rows(forces, first);
                for lane in 0..4 {
                    let mut f = [[0.0; 4]; 4];
                    for axis in 0..4 {
                        for corner in 0..3 {
                            f[corner + 1][axis] = rows[lane][corner][axis].into();
                        }
                        f[0][axis] = -(f[1][axis] + f[2][axis] + f[3][axis]);
                    }
                    for corner in 0..4 {
                        let node = block.nodes[first + lane][corner] as usize;
                        debug_assert!(node < sums.len());
                        // SAFETY: `Blocks::new` checked `node < entries`, and `sums` has so many.
                        let sum = unsafe { sums.get_unchecked_mut(node) };
                        for axis in 0..4 {
                            sum.0[axis] += f[corner][axis];
                        }
                    }
                }
            }
        }
    }
}
