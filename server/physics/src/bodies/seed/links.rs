//! The damped spring links of the outer surface (2006, section 6.1).
//!
//! "Each external vertex is linked to an internal tetrahedron face using its projection in the mass center direction. This defines a
//! dumped spring-like connection which is used to move the external surface far from the activated zone."
//! ```text
//! f = −k (x − a) − c (ẋ − ȧ)        a = Σ_i ζ_i x_i + o        o = X − Σ_i ζ_i X_i
//! ```
//! The vertex gets f, the face's nodes −ζ_i f. The offset o is fixed in the world, which is how the text reads and what is wrong with it:
//! translations are free of force, but a body that is turned by R pulls its surface back by `k (R − I) o`, a torque. Kept as it is.
//!
//! Not printed, and chosen: the mass of a vertex (its share by area of the layer's, which has nobody else while its particles sleep), k
//! (that of the column of layer below it, `(λ + 2µ) A/|o|`) and c (`2ξ√(km)`).
use super::radial::{Attachment, at};
use glam::DVec3;

/// Links of all vertices.
#[derive(Debug, Clone, PartialEq)]
pub struct Links {
    /// Nodes of each vertex's face.
    pub nodes: Vec<[u32; 3]>,
    /// Their weights.
    pub weights: Vec<[f64; 3]>,
    /// Offset o (m).
    pub offset_m: Vec<DVec3>,
    /// k (N/m).
    pub stiffness_n_per_m: Vec<f64>,
    /// c (N s/m).
    pub damping_n_s_per_m: Vec<f64>,
    /// Mass of each vertex (kg).
    pub mass_kg: Vec<f64>,
}

/// What links are made of.
pub(super) struct LinkMaterial {
    /// `λ + 2µ` (Pa) of the column, times the chosen ratio.
    pub(super) modulus_pa: f64,
    /// ξ.
    pub(super) damping_ratio: f64,
    /// Mass (kg) of the layer.
    pub(super) layer_mass_kg: f64,
}

impl Links {
    pub(super) fn new(
        (skin_m, triangles): (&[DVec3], &[[u32; 3]]),
        attachments: &[Attachment],
        (core_m, core_triangles): (&[DVec3], &[[u32; 3]]),
        material: &LinkMaterial,
    ) -> Self {
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

    /// `Σ_i ζ_i a_i` over the corners of a vertex's face.
    pub fn attachment_m(&self, vertex: usize, of_nodes: &[DVec3]) -> DVec3 {
        at(self.weights[vertex], self.nodes[vertex].map(|n| of_nodes[n as usize]))
    }

    /// Force (N) on a vertex; its face's nodes get `−ζ_i` of it.
    pub fn force_n(&self, vertex: usize, (x, v): (DVec3, DVec3), (core_x, core_v): (&[DVec3], &[DVec3])) -> DVec3 {
        let stretch = x - self.attachment_m(vertex, core_x) - self.offset_m[vertex];
        let rate = v - self.attachment_m(vertex, core_v);
        stretch * -self.stiffness_n_per_m[vertex] - rate * self.damping_n_s_per_m[vertex]
    }
}
