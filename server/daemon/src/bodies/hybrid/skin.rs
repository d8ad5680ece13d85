//! The skin of a hybrid body for viewers. The loop hands over coarse nodes and active particles only; where each of the skin's many vertices
//! is, is worked out here, beside the loop.
use crate::bodies::{
    Shape, ShapeReader,
    shape::{double, single},
};
use glam::DVec3;
use palpate_physics::{
    Model,
    bodies::hybrid::{HybridBody, composite::Anchor},
};
use std::collections::BTreeMap;

/// Displacements of the skin's vertices, frame by frame.
#[derive(Debug)]
pub(super) struct SkinReader {
    /// Particles that carry vertices, ascending.
    particles: Vec<Carrier>,
    vertices: Vec<Vertex>,
    /// Indices in `particles` and weights of what carries the vertices, one vertex after another.
    carriers: Vec<(u32, f64)>,
    /// Displacement (m) of every carrier.
    carried_m: Vec<DVec3>,
    /// Displacement (m) of every vertex from its f32 rest position.
    displacements_m: Vec<[f32; 3]>,
}

#[derive(Debug)]
struct Carrier {
    particle: u32,
    rest_m: DVec3,
    anchor: Anchor,
}

#[derive(Debug)]
struct Vertex {
    /// How many carriers it has.
    carriers: usize,
    /// Rest position less the one that viewers have (m).
    rounding_m: DVec3,
}

impl SkinReader {
    pub(super) fn new(model: &Model, hybrid: &HybridBody, rest_f32_m: &[[f32; 3]]) -> Self {
        let partition = hybrid.partition();
        let rest = model.surface_rest_positions_m();
        let of_vertices = || (0..rest.len() as u32).map(|vertex| hybrid.carriers_of_vertex(vertex));
        let mut number: BTreeMap<u32, u32> = of_vertices().flatten().map(|(particle, _)| (*particle, 0)).collect();
        number.values_mut().zip(0..).for_each(|(slot, index)| *slot = index);
        let carrier = |&particle: &u32| Carrier {
            particle,
            rest_m: partition.particle_m(particle),
            anchor: partition.anchor(particle),
        };
        let counts = of_vertices().map(<[(u32, f64)]>::len);
        let roundings_m = rest.iter().zip(rest_f32_m).map(|(rest, rest_f32)| *rest - double(*rest_f32));
        Self {
            vertices: counts.zip(roundings_m).map(|(carriers, rounding_m)| Vertex { carriers, rounding_m }).collect(),
            carriers: of_vertices().flatten().map(|(particle, weight)| (number[particle], *weight)).collect(),
            carried_m: vec![DVec3::ZERO; number.len()],
            displacements_m: vec![[0.0; 3]; rest.len()],
            particles: number.keys().map(carrier).collect(),
        }
    }
}

impl ShapeReader for SkinReader {
    fn read(&mut self, shape: &Shape) -> f64 {
        let Shape::Lattice(lattice) = shape else { return 0.0 };
        // Active particles follow the coarse nodes.
        let (nodes, active) = lattice.x.split_at(lattice.x.len() - lattice.active.len());
        for (carried_m, Carrier { particle, rest_m, anchor }) in self.carried_m.iter_mut().zip(&self.particles) {
            let x = match lattice.active.binary_search(particle) {
                Ok(number) => active[number],
                Err(_) => anchor.of(nodes),
            };
            *carried_m = x - *rest_m;
        }
        let mut largest_sq = 0.0_f64;
        let mut left = &self.carriers[..];
        for (displacement_m, vertex) in self.displacements_m.iter_mut().zip(&self.vertices) {
            let (carriers, others) = left.split_at(vertex.carriers);
            left = others;
            let carried = carriers.iter().map(|&(carrier, weight)| self.carried_m[carrier as usize] * weight);
            let moved = carried.sum::<DVec3>() + vertex.rounding_m;
            largest_sq = largest_sq.max(moved.length_squared());
            *displacement_m = single(moved);
        }
        largest_sq.sqrt()
    }

    fn displacements_m(&self) -> &[[f32; 3]] {
        &self.displacements_m
    }
}
