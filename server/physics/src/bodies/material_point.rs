//! A point of a body's material, and where it goes.
use super::{Body, BodyState, hybrid::trilinear_point::TrilinearPoint};
use crate::tick::MechanicalState;
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
    fn of(&self, field: &[DVec3]) -> DVec3 {
        self.nodes.iter().zip(self.weights).map(|(&node, weight)| field[node as usize] * weight).sum()
    }
}

impl Body {
    /// How far (m) a point has gone from rest; of a hybrid body, as the particles around it have.
    pub(crate) fn displacement_m(&self, own: &BodyState, state: &MechanicalState, point: &MaterialPoint) -> DVec3 {
        match (self, own) {
            (Self::Hybrid(body), BodyState::Hybrid(own)) => {
                let partition = body.partition();
                let (of_nodes, of_particles) = state.x.split_at(body.node_count());
                let moved = |particle: u32| {
                    let x = match own.ids().binary_search(&particle) {
                        Ok(number) => of_particles[number],
                        Err(_) => partition.anchor(particle).of(of_nodes),
                    };
                    x - partition.particle_m(particle)
                };
                let place = TrilinearPoint::new(partition, point.rest_m);
                place.particles.into_iter().zip(place.weights).map(|(particle, w)| moved(particle) * w).sum()
            }
            (Self::MassSpring(body), BodyState::MassSpring(own)) => {
                let moved =
                    |vertex: u32| body.vertex_m(&own.motion, vertex, &state.x) - body.model().rest_m()[vertex as usize];
                let weighty = point.nodes.iter().zip(point.weights).filter(|(_, w)| *w != 0.0);
                weighty.map(|(&vertex, w)| moved(vertex) * w).sum()
            }
            _ => point.of(&state.x) - point.of(self.rest_positions_m()),
        }
    }
}
