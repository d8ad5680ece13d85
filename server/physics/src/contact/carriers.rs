//! Where what carries a skin was some time ago: a bound of how far the skin has moved since then, without its vertices.
use glam::DVec3;

/// How many nodes and particles carry a skin; none of a surface whose vertices are nodes.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct MostCarriers {
    /// Coarse nodes.
    pub(crate) nodes: usize,
    /// Most particles that are active at once.
    pub(crate) active: usize,
    /// Nodes that clusters of walls follow, each counted with each of its clusters.
    pub(crate) of_clusters: usize,
}

/// Where what carries clusters of walls was, for each of them when it was listed. Its clones keep the capacity.
#[derive(Debug, Clone, Default)]
pub(crate) struct ClustersThen {
    /// Displacements (m) of the nodes that clusters follow, one cluster after the other.
    pub(crate) nodes_m: Box<[DVec3]>,
    /// Whether something else carried a cluster, too.
    pub(crate) is_unknown: Box<[bool]>,
}

impl ClustersThen {
    pub(crate) fn with_room(most: MostCarriers, clusters: usize) -> Self {
        Self {
            nodes_m: vec![DVec3::ZERO; most.of_clusters].into_boxed_slice(),
            is_unknown: vec![true; clusters].into_boxed_slice(),
        }
    }
}

/// Displacements (m) of a skin's carriers at some instant. Its clones keep the capacity.
#[derive(Debug, Clone, Default)]
pub(crate) struct CarriersThen {
    nodes_m: Box<[DVec3]>,
    /// Active particles, ascending.
    particles_m: Box<[(u32, DVec3)]>,
    count: usize,
}

impl CarriersThen {
    pub(crate) fn with_room(most: MostCarriers) -> Self {
        Self {
            nodes_m: vec![DVec3::ZERO; most.nodes].into_boxed_slice(),
            particles_m: vec![(0, DVec3::ZERO); most.active].into_boxed_slice(),
            count: 0,
        }
    }

    /// Notes the displacements (m) of nodes and active particles, which are ascending. Allocates nothing.
    pub(crate) fn remember(&mut self, nodes_m: &[DVec3], particles_m: impl Iterator<Item = (u32, DVec3)>) {
        self.nodes_m.copy_from_slice(nodes_m);
        self.count = 0;
        for (slot, particle) in self.particles_m.iter_mut().zip(particles_m) {
            *slot = particle;
            self.count += 1;
        }
    }

    /// Returns the displacements (m) of the nodes.
    pub(crate) fn nodes_m(&self) -> &[DVec3] {
        &self.nodes_m
    }

    /// Returns the particles that were active, ascending, with their displacements (m).
    pub(crate) fn particles_m(&self) -> &[(u32, DVec3)] {
        &self.particles_m[..self.count]
    }
}
