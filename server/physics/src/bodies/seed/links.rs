//! The damped spring links of the outer surface (2006, section 6.1).
//!
//! "Each external vertex is linked to an internal tetrahedron face using its projection in the mass center direction.
//! This defines a dumped spring-like connection which is used to move the external surface far from the activated
//! zone."
//! ```text
//! f = −k (x − a) − c (ẋ − ȧ)        a = Σ_i ζ_i x_i + o        o = X − Σ_i ζ_i X_i
//! ```
//! Here a is the vertex' attachment point on the face. The vertex gets the force f, and the face's nodes get −ζ_i f.
//! The offset o is fixed in the world, as the text says, and this is what is wrong with it: translations are free of
//! force, but a body that is turned by R pulls its surface back by `k (R − I) o`, a torque. It is kept as printed.
//!
//! Three things are not printed and are chosen here: the mass of a vertex (its tributary mass of the layer, which
//! nothing else carries while particles sleep), the stiffness k (that of the column of layer below the vertex,
//! `(λ + 2µ) A/|o|`) and the damping c (`2ξ√(km)`).
use super::{
    radial::{Attachment, at},
    state::Motion,
};
use glam::DVec3;

/// The links of all vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Links {
    /// Nodes of each vertex's face.
    pub nodes: Vec<[u32; 3]>,
    /// Weights ζ of these nodes.
    pub weights: Vec<[f64; 3]>,
    /// Offsets o (m).
    pub offset_m: Vec<DVec3>,
    /// Stiffness k (N/m) of each link.
    pub stiffness_n_per_m: Vec<f64>,
    /// Damping c (N s/m) of each link.
    pub damping_n_s_per_m: Vec<f64>,
    /// Mass (kg) of each vertex.
    pub mass_kg: Vec<f64>,
}

/// What links are made of.
pub(super) struct LinkMaterial {
    /// Modulus `λ + 2µ` (Pa) of the column, times the chosen ratio.
    pub(super) modulus_pa: f64,
    /// Damping ratio ξ.
    pub(super) damping_ratio: f64,
    /// Mass (kg) of the layer.
    pub(super) layer_mass_kg: f64,
}

/// A triangle surface at rest.
#[derive(Clone, Copy)]
pub(super) struct TriangleMesh<'a> {
    /// Positions (m) of the vertices.
    pub(super) positions_m: &'a [DVec3],
    /// Corners of the triangles.
    pub(super) triangles: &'a [[u32; 3]],
}

impl Links {
    pub(super) fn new(
        skin: TriangleMesh<'_>,
        attachments: &[Attachment],
        core: TriangleMesh<'_>,
        material: &LinkMaterial,
    ) -> Self {
        let TriangleMesh { positions_m: skin_m, triangles } = skin;
        let TriangleMesh { positions_m: core_m, triangles: core_triangles } = core;
        let mut area_m2 = vec![0.0; skin_m.len()];
        for triangle in triangles {
            let [a, b, c] = triangle.map(|n| skin_m[n as usize]);
            for &vertex in triangle {
                area_m2[vertex as usize] += (b - a).cross(c - a).length() / 6.0;
            }
        }
        let total_m2: f64 = area_m2.iter().sum();
        let mut links = Self {
            nodes: Vec::new(),
            weights: Vec::new(),
            offset_m: Vec::new(),
            stiffness_n_per_m: Vec::new(),
            damping_n_s_per_m: Vec::new(),
            mass_kg: Vec::new(),
        };
        for ((attachment, &position), area) in attachments.iter().zip(skin_m).zip(area_m2) {
            let nodes = core_triangles[attachment.triangle as usize];
            let offset = position - at(attachment.weights, nodes.map(|n| core_m[n as usize]));
            let (mass, stiffness) =
                (material.layer_mass_kg * area / total_m2, material.modulus_pa * area / offset.length());
            links.nodes.push(nodes);
            links.weights.push(attachment.weights);
            links.offset_m.push(offset);
            links.mass_kg.push(mass);
            links.stiffness_n_per_m.push(stiffness);
            links.damping_n_s_per_m.push(2.0 * material.damping_ratio * (stiffness * mass).sqrt());
        }
        links
    }

    /// Returns `Σ_i ζ_i a_i` over the corners of a vertex' face: the attachment point (m) of the nodes' positions, or
    /// its velocity (m/s) of the nodes' velocities.
    pub fn at_attachment(&self, vertex: usize, of_nodes: &[DVec3]) -> DVec3 {
        at(self.weights[vertex], self.nodes[vertex].map(|n| of_nodes[n as usize]))
    }

    /// Returns the force (N) on a vertex at `x` (m) with the velocity `v` (m/s); each node of its face gets `−ζ_i`
    /// times this force.
    pub fn force_n(&self, vertex: usize, x: DVec3, v: DVec3, core: &Motion) -> DVec3 {
        let stretch = x - self.at_attachment(vertex, &core.x) - self.offset_m[vertex];
        let rate = v - self.at_attachment(vertex, &core.v);
        stretch * -self.stiffness_n_per_m[vertex] - rate * self.damping_n_s_per_m[vertex]
    }
}
