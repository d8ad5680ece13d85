//! Where a body is at a tick: what the loop hands over of it, and what makes vertices of that beside the loop.
use super::{hybrid::LatticeShape, mass_spring::SpringShape, tet::NodeShape};
use glam::DVec3;
use palpate_physics::{Model, State};
use std::fmt::Debug;

/// What the loop hands over. One is as large as it will ever be from the start ([`super::ServedBody::largest_shape`]).
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Of a surface whose vertices are nodes.
    Nodes(NodeShape),
    /// Of a skin that follows coarse nodes and active particles.
    Lattice(LatticeShape),
    /// Of a mass-spring surface.
    Springs(SpringShape),
}

impl Shape {
    /// Copies a state's shape. Does not allocate.
    pub fn fill(&mut self, model: &Model, state: &State) {
        match self {
            Self::Nodes(shape) => shape.fill(model, state),
            Self::Lattice(shape) => shape.fill(state),
            Self::Springs(shape) => shape.fill(state),
        }
    }

    /// Positions (m) of the awake particles.
    pub fn particles_m(&self) -> &[DVec3] {
        match self {
            Self::Nodes(shape) => &shape.particles_m,
            Self::Lattice(shape) => shape.particles_m(),
            Self::Springs(_) => &[],
        }
    }
}

/// Makes vertices of shapes, frame by frame.
pub trait ShapeReader: Debug + Send {
    /// Works out a frame. Returns the largest displacement (m). A shape of another kind of body changes nothing.
    fn read(&mut self, shape: &Shape) -> f64;

    /// Displacement (m) of every vertex from the rest position that viewers have, after [`Self::read`].
    fn displacements_m(&self) -> &[[f32; 3]];
}

/// A vector as viewers get it.
pub(super) fn single(v: DVec3) -> [f32; 3] {
    v.to_array().map(|component| component as f32)
}

/// What viewers have of a position, in double precision.
pub(super) fn double(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}
