//! Where what carries a skin was some time ago: a bound of how far the skin has moved since then, with few of its vertices.
use glam::DVec3;

/// How much carries a skin; nothing a surface whose vertices are nodes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MostCarriers {
    /// Coarse nodes.
    pub(crate) nodes: usize,
    /// Clusters of its triangles, of which active particles carry some.
    pub(crate) clusters: usize,
}

/// A skin's carriers at some instant. Its clones keep the capacity.
#[derive(Debug, Clone, Default)]
pub(crate) struct CarriersThen {
    nodes_m: Box<[DVec3]>,
    is_active: Box<[bool]>,
}

impl CarriersThen {
    pub(crate) fn with_room(most: MostCarriers) -> Self {
        Self {
            nodes_m: vec![DVec3::ZERO; most.nodes].into_boxed_slice(),
            is_active: vec![false; most.clusters].into_boxed_slice(),
        }
    }

    /// Notes the displacements (m) of nodes, and of each cluster whether active particles carry vertices of it. Allocates nothing.
    pub(crate) fn remember(&mut self, nodes_m: &[DVec3], is_active: &[bool]) {
        self.nodes_m.copy_from_slice(nodes_m);
        self.is_active.copy_from_slice(is_active);
    }

    /// Returns the displacements (m) of the nodes.
    pub(crate) fn nodes_m(&self) -> &[DVec3] {
        &self.nodes_m
    }

    /// Returns whether active particles carried vertices of a cluster.
    pub(crate) fn is_active(&self, cluster: usize) -> bool {
        self.is_active[cluster]
    }
}
