//! Bodies of tetrahedra, and every other whose surface's vertices are nodes.
use super::{
    ServedBody, Shape, ShapeReader, locking,
    shape::{double, single},
};
use glam::DVec3;
use palpate_physics::{Model, State, bodies::tet::TetBody};
use std::sync::Arc;

impl ServedBody for TetBody {
    fn largest_shape(&self, model: &Model) -> Shape {
        Shape::Nodes(NodeShape::largest(model))
    }

    fn shape_reader(&self, _model: &Arc<Model>, rest_f32_m: &[[f32; 3]]) -> Box<dyn ShapeReader> {
        Box::new(NodeReader::new(rest_f32_m))
    }

    fn description(&self, model: &Model) -> Vec<String> {
        locking::told(model).into_iter().collect()
    }

    fn warnings(&self, model: &Model) -> Vec<String> {
        locking::warning(model).into_iter().collect()
    }
}

/// Where a surface is whose vertices are nodes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NodeShape {
    /// Positions (m) of the vertices.
    pub vertices_m: Vec<DVec3>,
    /// Positions (m) of the awake particles, where there are any.
    pub particles_m: Vec<DVec3>,
}

impl NodeShape {
    /// The largest that a model ever has.
    pub(super) fn largest(model: &Model) -> Self {
        Self {
            vertices_m: vec![DVec3::ZERO; model.surface().nodes.len()],
            particles_m: vec![DVec3::ZERO; model.body().most_awake_particles()],
        }
    }

    pub(super) fn fill(&mut self, model: &Model, state: &State) {
        self.vertices_m.clear();
        self.vertices_m.extend(model.surface().nodes.iter().map(|&node| state.mechanical.x[node as usize]));
        self.particles_m.clear();
        self.particles_m.extend_from_slice(state.awake_particles_m());
    }
}

/// Displacements of vertices that are nodes.
#[derive(Debug)]
pub(super) struct NodeReader {
    rest_f32_m: Vec<[f32; 3]>,
    displacements_m: Vec<[f32; 3]>,
}

impl NodeReader {
    pub(super) fn new(rest_f32_m: &[[f32; 3]]) -> Self {
        Self { rest_f32_m: rest_f32_m.to_vec(), displacements_m: vec![[0.0; 3]; rest_f32_m.len()] }
    }
}

impl ShapeReader for NodeReader {
    fn read(&mut self, shape: &Shape) -> f64 {
        let Shape::Nodes(NodeShape { vertices_m, .. }) = shape else { return 0.0 };
        let mut largest_sq = 0.0_f64;
        for ((displacement, x), rest) in self.displacements_m.iter_mut().zip(vertices_m).zip(&self.rest_f32_m) {
            let moved = *x - double(*rest);
            largest_sq = largest_sq.max(moved.length_squared());
            *displacement = single(moved);
        }
        largest_sq.sqrt()
    }

    fn displacements_m(&self) -> &[[f32; 3]] {
        &self.displacements_m
    }
}
