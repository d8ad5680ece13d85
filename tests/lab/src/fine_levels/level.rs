//! What is awake of a hybrid body, whatever stands between its particles.
use glam::{DMat3, DVec3};
use palpate_physics::bodies::hybrid::{
    partition::Partition,
    patch::{Field, Materials, Patch},
};
use std::collections::BTreeSet;

/// Awake particles with all that is strained between them, and what is left to the coarse tets: what an equilibrium is sought of.
pub(super) trait FineLevel {
    /// Active particles, ascending.
    fn active(&self) -> &[u32];

    /// How many cells or points touch an active particle.
    fn point_count(&self, partition: &Partition) -> usize;

    /// The coarse nodes at rest, and the particles where they follow them to.
    fn at_rest(&self, partition: &Partition) -> Field {
        let nodes = partition.coarse().positions_m().to_vec();
        Field {
            particles: self.active().iter().map(|&particle| partition.anchor(particle).of(&nodes)).collect(),
            nodes,
        }
    }

    /// Forces (N) of elastic stress at positions `at`.
    fn elastic_forces_n(&self, materials: &Materials<'_>, at: &Field) -> Field;

    /// `−K a` (N): the change of the elastic forces along `a` at positions `at`.
    fn products_n(&self, materials: &Materials<'_>, at: &Field, a: &Field) -> Field;

    /// Diagonal blocks (N/m) of the stiffness at rest, of so many coarse nodes and then of the active particles; the identity where there is none.
    fn diagonal_n_per_m(&self, materials: &Materials<'_>, nodes: usize) -> Vec<DMat3>;
}

/// Nothing moves.
pub(super) fn still(like: &Field) -> Field {
    let zero = |list: &[DVec3]| vec![DVec3::ZERO; list.len()];
    Field { nodes: zero(&like.nodes), particles: zero(&like.particles) }
}

/// What ships: cells between eight particles.
impl FineLevel for Patch {
    fn active(&self) -> &[u32] {
        self.active()
    }

    fn point_count(&self, partition: &Partition) -> usize {
        self.active().iter().flat_map(|&particle| partition.cells_at(particle)).collect::<BTreeSet<_>>().len()
    }

    fn elastic_forces_n(&self, materials: &Materials<'_>, at: &Field) -> Field {
        self.forces_n(materials, at, &still(at)).0
    }

    fn products_n(&self, materials: &Materials<'_>, at: &Field, a: &Field) -> Field {
        self.products_n(materials, at, a)
    }

    fn diagonal_n_per_m(&self, materials: &Materials<'_>, nodes: usize) -> Vec<DMat3> {
        self.diagonal_n_per_m(materials, nodes)
    }
}
