//! Awake particles between which a method's points stand, in place of cells.
//!
//! A point answers for the share `1 − ε` of the parts of cells that are its own, as an awake cell does for all of itself (`palpate_physics::bodies::hybrid::patch`). These
//! parts go from the coarse tets by the cells' moments: what is left to them stays a mean over cells, however little it is.
use super::{
    super::level::{FineLevel, still},
    points::{Handed, Operator, Points},
};
use glam::{DMat3, DVec3};
use palpate_physics::bodies::hybrid::{
    composite::Anchor,
    partition::Partition,
    patch::{Field, KEPT, Materials},
    residual_element::ResidualElement,
};
use std::collections::{BTreeMap, BTreeSet};

/// A set of active particles with the points of a method.
#[derive(Debug, Clone)]
pub struct PointPatch {
    /// Active particles, ascending.
    active: Vec<u32>,
    /// What the other particles that points see follow; they are numbered after the active ones.
    border: Vec<Anchor>,
    operator: Operator,
    /// What is left to each coarse tet.
    residual_elements: Vec<ResidualElement>,
}

impl PointPatch {
    /// Wakes these particles.
    pub fn new(partition: &Partition, active: &BTreeSet<u32>, points: &Points) -> Self {
        let active: Vec<u32> = active.iter().copied().collect();
        let mut point_of: BTreeMap<u32, u32> = active.iter().copied().zip(0..).collect();
        let mut border = Vec::new();
        let operator = Operator::new(&points.rows, 1.0 - KEPT, |particle| {
            *point_of.entry(particle).or_insert_with(|| {
                border.push(partition.anchor(particle));
                (active.len() + border.len()) as u32 - 1
            })
        });
        let mut residual_elements = partition.residual_elements().to_vec();
        for &Handed { cell: number, part } in &points.handed {
            let (cell, moments) = (&partition.cells()[number], partition.moments(number));
            let anchors = partition.corners(number).map(|particle| partition.anchor(particle));
            residual_elements[cell.tet as usize].add(cell.part, part * (KEPT - 1.0), &moments, &anchors);
        }
        Self { active, border, operator, residual_elements }
    }

    /// Elastic energy (J).
    pub fn energy_j(&self, materials: &Materials<'_>, at: &Field) -> f64 {
        let of_share = |(tet, residual): (usize, &ResidualElement)| residual.energy_j(materials.of(tet), &at.nodes);
        let fine = self.operator.energy_j(materials, &self.points(at));
        fine + self.residual_elements.iter().enumerate().map(of_share).sum::<f64>()
    }

    /// Forces (N) of elastic and viscous stress at positions `at` and velocities `rate`, and the power (W) that viscous stress takes.
    pub fn forces_n(&self, materials: &Materials<'_>, at: &Field, rate: &Field) -> (Field, f64) {
        let (points, rates) = (self.points(at), self.points(rate));
        let mut nodes = vec![DVec3::ZERO; at.nodes.len()];
        let mut of_points = vec![DVec3::ZERO; points.len()];
        let mut power_w = self.operator.add_forces_n(materials, &points, &rates, &mut of_points);
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            power_w += residual.add_forces_n(materials.of(tet), &at.nodes, &rate.nodes, &mut nodes);
        }
        (self.handed_back(nodes, of_points), power_w)
    }

    /// Of active particles, then of the others that points see.
    fn points(&self, a: &Field) -> Vec<DVec3> {
        a.particles.iter().copied().chain(self.border.iter().map(|anchor| anchor.of(&a.nodes))).collect()
    }

    /// Forces on particles that follow go to the coarse nodes.
    fn handed_back(&self, mut nodes: Vec<DVec3>, mut of_points: Vec<DVec3>) -> Field {
        for (anchor, force) in self.border.iter().zip(&of_points[self.active.len()..]) {
            anchor.push(*force, &mut nodes);
        }
        of_points.truncate(self.active.len());
        Field { nodes, particles: of_points }
    }
}

impl FineLevel for PointPatch {
    fn active(&self) -> &[u32] {
        &self.active
    }

    fn point_count(&self, _partition: &Partition) -> usize {
        self.operator.row_count()
    }

    fn elastic_forces_n(&self, materials: &Materials<'_>, at: &Field) -> Field {
        self.forces_n(materials, at, &still(at)).0
    }

    fn products_n(&self, materials: &Materials<'_>, at: &Field, a: &Field) -> Field {
        let (points, changes) = (self.points(at), self.points(a));
        let mut nodes = vec![DVec3::ZERO; at.nodes.len()];
        let mut of_points = vec![DVec3::ZERO; points.len()];
        self.operator.add_products_n(materials, &points, &changes, &mut of_points);
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            residual.add_products_n(materials.of(tet), &at.nodes, &a.nodes, &mut nodes);
        }
        self.handed_back(nodes, of_points)
    }

    fn diagonal_n_per_m(&self, materials: &Materials<'_>, nodes: usize) -> Vec<DMat3> {
        let mut of_nodes = vec![DMat3::ZERO; nodes];
        let mut of_points = vec![DMat3::ZERO; self.active.len() + self.border.len()];
        self.operator.add_diagonal_n_per_m(materials, &mut of_points);
        for (anchor, block) in self.border.iter().zip(of_points.split_off(self.active.len())) {
            for (&node, weight) in anchor.nodes.iter().zip(anchor.weights) {
                of_nodes[node as usize] += block * (weight * weight);
            }
        }
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            residual.add_diagonal_n_per_m(materials.of(tet), &mut of_nodes);
        }
        let filled = |block: DMat3| if block == DMat3::ZERO { DMat3::IDENTITY } else { block };
        of_nodes.into_iter().chain(of_points).map(filled).collect()
    }
}
