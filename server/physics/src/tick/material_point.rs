//! A point of a body's material.
use glam::DVec3;

/// A point of a body's material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaterialPoint {
    /// Where it is at rest (m).
    pub rest_m: DVec3,
    /// Nodes that it lies between, or vertices of a surface of springs; unused ones have weight 0. Of a hybrid body they mean nothing:
    /// its particles are found by the rest position.
    pub nodes: [u32; 4],
    /// Barycentric weights, sum 1.
    pub weights: [f64; 4],
}

impl MaterialPoint {
    /// Interpolates a field of the nodes.
    pub(crate) fn of(&self, field: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.weights).map(|(&node, weight)| field[node as usize] * weight).sum()
    }
}
