//! Where each node of a surface is among those that are awake, at hand.
use super::topology::NONE;

/// The place of every node, [`NONE`] of most.
#[derive(Debug, Clone)]
pub struct Places {
    of: Vec<u32>,
    /// The nodes that have one, in their order.
    nodes: Vec<u32>,
}

impl Places {
    /// Of so many nodes, of which so many may have a place at once.
    pub fn with_room(nodes: usize, most: usize) -> Self {
        Self { of: vec![NONE; nodes], nodes: Vec::with_capacity(most) }
    }

    /// No node has a place.
    pub fn clear(&mut self) {
        for node in self.nodes.drain(..) {
            self.of[node as usize] = NONE;
        }
    }

    /// Gives a node the next place, unless it has one.
    pub fn push(&mut self, node: u32) {
        let place = &mut self.of[node as usize];
        if *place == NONE {
            *place = self.nodes.len() as u32;
            self.nodes.push(node);
        }
    }

    /// The place of a node.
    pub fn of(&self, node: u32) -> Option<u32> {
        let place = self.of[node as usize];
        (place != NONE).then_some(place)
    }

    /// Nodes by their places.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }
}
