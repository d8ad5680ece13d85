//! The place of each node of a surface in the lists of awake nodes, found without a search.
use super::triangulation::NONE;

/// A numbering of some nodes of a surface by places, in both directions.
#[derive(Debug, Clone)]
pub struct Places {
    /// Place of every node; [`NONE`] of a node that has no place.
    of: Vec<u32>,
    /// Nodes by place.
    nodes: Vec<u32>,
}

impl Places {
    /// Returns a numbering of a surface with `nodes` nodes, at most `most` of which have a place at once.
    pub fn with_room(nodes: usize, most: usize) -> Self {
        Self { of: vec![NONE; nodes], nodes: Vec::with_capacity(most) }
    }

    /// Takes the places of all nodes.
    pub fn clear(&mut self) {
        for node in self.nodes.drain(..) {
            self.of[node as usize] = NONE;
        }
    }

    /// Gives a node the next place, unless it has a place already.
    pub fn push(&mut self, node: u32) {
        let place = &mut self.of[node as usize];
        if *place == NONE {
            *place = self.nodes.len() as u32;
            self.nodes.push(node);
        }
    }

    /// Returns the place of a node, if it has one.
    pub fn of(&self, node: u32) -> Option<u32> {
        let place = self.of[node as usize];
        (place != NONE).then_some(place)
    }

    /// Returns the nodes by place.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }
}
