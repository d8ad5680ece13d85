//! A mass-spring surface that can be refined, with everything that its rest state fixes.
//!
//! *Masses.* A node of type 2 on the edge from `a` to `b` takes its mass from the two ends when it enters, and gives it
//! back when it leaves:
//! ```text
//! m_e = ¾ (m_a/k_a + m_b/k_b),   k the number of edges at a vertex
//! ```
//! A vertex that is refined all around keeps a quarter of its mass. The mass of a region stays what it was, which is
//! the purpose of haptic-subdivision's eq. 3, `m′ = m N/N′` for all of its nodes; but here the mass also stays where it
//! was, and a node that starts with the mean velocity of its ends changes no momentum. In a large region both rules
//! give `m/4`.
use super::{
    anchor::AnchorLaw,
    loop_scheme::refined,
    region::Constants,
    triangulation::{Triangulation, TriangulationError},
};
use glam::DVec3;
use thiserror::Error;

/// What a mass-spring surface is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct SpringSpec {
    /// The coarse surface, whose vertices Loop's scheme smooths.
    pub surface: Triangulation,
    /// Spring constants `K_m`, `K_h` of the coarse surface.
    pub coarse: Constants,
    /// Spring constants `K′_m`, `K′_h` where the surface is refined.
    pub fine: Constants,
    /// Law `g` of the anchor springs.
    pub anchor_law: AnchorLaw,
    /// Mass (kg) of each vertex.
    pub mass_kg: Vec<f64>,
    /// Vertices that do not move.
    pub held: Vec<u32>,
    /// Largest number of coarse vertices that are awake at once, besides those of refined triangles.
    pub most_awake: usize,
    /// Largest number of triangles that are refined at once.
    pub most_refined: usize,
}

/// Why no model can be built from a specification.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SpringError {
    /// A number is outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name of the number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// There is not one mass for each vertex.
    #[error("{found} masses for {vertices} vertices")]
    Masses {
        /// Number of masses given.
        found: usize,
        /// Number of vertices.
        vertices: usize,
    },
    /// A held vertex does not exist.
    #[error("vertex {vertex} is held, but there are only {vertices}")]
    OutOfRange {
        /// The vertex.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// The surface is no valid surface once Loop's scheme has smoothed it.
    #[error("smoothed by Loop's scheme the surface is none: {0}")]
    Smoothed(#[from] TriangulationError),
}

/// A mass-spring surface. It does not change after it is loaded.
///
/// Nodes are numbered as the vertices of the surface refined everywhere: a node of type 1 has the number of its coarse
/// vertex, a node of type 2 the number of coarse vertices plus that of its edge.
#[derive(Debug, Clone)]
pub struct SpringModel {
    spec: SpringSpec,
    /// Rest positions (m) of all nodes.
    rest_m: Vec<DVec3>,
    /// Triangles of the surface refined everywhere.
    fine_triangles: Vec<[u32; 3]>,
    /// Mass `m_e` (kg) of the node of every edge.
    edge_kg: Vec<f64>,
    is_held: Vec<bool>,
    frequency_rad_per_s: f64,
}

impl SpringModel {
    /// Checks the specification, and computes rest positions, masses and the bound of the natural frequencies.
    ///
    /// # Errors
    /// [`SpringError`].
    pub fn build(spec: SpringSpec) -> Result<Self, SpringError> {
        check(&spec)?;
        let (rest_m, fine_triangles) = refined(&spec.surface);
        let coarse_rest_m = rest_m[..spec.surface.positions_m().len()].to_vec();
        spec.surface.moved(coarse_rest_m)?;
        Triangulation::new(rest_m.clone(), fine_triangles.clone())?;
        let given_kg = |vertex: u32| 0.75 * spec.mass_kg[vertex as usize] / spec.surface.edges_at(vertex).len() as f64;
        let edge_kg = spec.surface.edges().iter().map(|edge| edge.nodes.map(given_kg).iter().sum()).collect();
        let mut is_held = vec![false; spec.mass_kg.len()];
        spec.held.iter().for_each(|&vertex| is_held[vertex as usize] = true);
        let mut model = Self { rest_m, fine_triangles, edge_kg, is_held, frequency_rad_per_s: 0.0, spec };
        model.frequency_rad_per_s = model.frequency_bound_sq(&[]).sqrt();
        Ok(model)
    }

    /// Returns what the model was made from.
    pub fn spec(&self) -> &SpringSpec {
        &self.spec
    }

    /// Returns the coarse surface.
    pub fn surface(&self) -> &Triangulation {
        &self.spec.surface
    }

    /// Returns the rest positions (m) of all nodes.
    pub fn rest_m(&self) -> &[DVec3] {
        &self.rest_m
    }

    /// Returns the triangles of the surface refined everywhere.
    pub fn fine_triangles(&self) -> &[[u32; 3]] {
        &self.fine_triangles
    }

    /// Returns how many coarse vertices there are, which is also the number of the first node of type 2.
    pub fn vertices(&self) -> u32 {
        self.spec.surface.positions_m().len() as u32
    }

    /// Returns the mass (kg) of the node of type 2 on an edge.
    pub fn edge_kg(&self, edge: u32) -> f64 {
        self.edge_kg[edge as usize]
    }

    /// Returns the mass (kg) that a vertex gives to the node of each of its edges.
    pub fn given_kg(&self, vertex: u32) -> f64 {
        0.75 * self.spec.mass_kg[vertex as usize] / self.spec.surface.edges_at(vertex).len() as f64
    }

    /// Returns the largest number of nodes that are awake at once.
    pub fn most_nodes(&self) -> usize {
        // A refined triangle has its three corners and the middles of its three edges.
        self.rest_m.len().min(self.spec.most_awake + 6 * self.spec.most_refined)
    }

    /// Returns whether a coarse vertex is held.
    pub fn is_held(&self, vertex: u32) -> bool {
        self.is_held[vertex as usize]
    }

    /// Returns an upper bound (rad/s) of the natural frequencies, at any levels and however far mesh springs are
    /// stretched, while no anchor spring is longer than the longest edge.
    pub fn frequency_rad_per_s(&self) -> f64 {
        self.frequency_rad_per_s
    }

    /// Returns the square of that bound with contact, which is at most a spring (N/m) in all directions on each node of
    /// the surface refined everywhere.
    pub fn touched_frequency_sq(&self, contact_n_per_m: &[f64]) -> f64 {
        self.frequency_bound_sq(contact_n_per_m)
    }

    /// Returns the bound `ω² ≤ max_i (K_h + 2 Σ_j k_ij)/m_i` (Gershgorin; a spring is less stiff across than along its
    /// direction). A vertex has at most the springs of both levels beside each other, and at least the mass that it
    /// keeps when it is refined all around.
    ///
    /// `contact_n_per_m` is the largest stiffness of contact, as a spring in all directions, at each node of the
    /// surface refined everywhere; an empty list stands for no contact. Where an edge's middle has the level `s`,
    /// contact acts on its node by the weight `s` and on either end by `½ (1 − s)`.
    fn frequency_bound_sq(&self, contact_n_per_m: &[f64]) -> f64 {
        let touch_n_per_m = |node: u32, with_edges: bool| {
            let of = |node: u32| contact_n_per_m.get(node as usize).copied().unwrap_or(0.0);
            let edges = if with_edges { self.surface().edges_at(node) } else { &[] };
            of(node) + edges.iter().map(|edge| 0.5 * of(self.vertices() + edge)).sum::<f64>()
        };
        let Constants { mesh_n_per_m, anchor_n_per_m } = self.spec.fine;
        let most = |coarse: f64, fine: f64| coarse.max(fine);
        let edges = 0..self.surface().edges().len() as u32;
        let longest_m = edges.map(|edge| self.surface().length_m(edge)).fold(0.0, f64::max);
        let steepest = self.spec.anchor_law.steepest_within(longest_m);
        let of_vertex = |vertex: u32| {
            let edges = self.surface().edges_at(vertex).len() as f64;
            let triangles = self.surface().triangles_at(vertex).len() as f64;
            // Along an edge lies (1 − s) K_m + s K′_m; crack springs go to the middles of the edges across. A tie's row
            // is ¼ k twice and ½ k.
            let springs = edges * most(self.spec.coarse.mesh_n_per_m, mesh_n_per_m) + triangles * mesh_n_per_m;
            let anchor = steepest * most(self.spec.coarse.anchor_n_per_m, anchor_n_per_m);
            let of_contact = touch_n_per_m(vertex, true);
            (anchor + 2.0 * springs + edges * anchor_n_per_m + of_contact) / (0.25 * self.spec.mass_kg[vertex as usize])
        };
        // The node has two half edges, and four springs inside or two to the corners across; the anchor spring has s
        // K′_h, the tie's row (1 − s) 2 K′_h.
        let of_edge = |(edge, kg): (u32, &f64)| {
            ((1.0 + steepest) * anchor_n_per_m + 12.0 * mesh_n_per_m + touch_n_per_m(self.vertices() + edge, false))
                / kg
        };
        let of_vertices = (0..self.vertices()).map(of_vertex);
        of_vertices.chain((0..).zip(&self.edge_kg).map(of_edge)).fold(0.0, f64::max)
    }
}

fn check(spec: &SpringSpec) -> Result<(), SpringError> {
    let vertices = spec.surface.positions_m().len();
    if spec.mass_kg.len() != vertices {
        return Err(SpringError::Masses { found: spec.mass_kg.len(), vertices });
    }
    let positive = |name, value: f64| {
        let ok = value > 0.0 && value.is_finite();
        let error = SpringError::Setting { name, value, rule: "must be finite and larger than 0" };
        if ok { Ok(()) } else { Err(error) }
    };
    positive("mesh_n_per_m", spec.coarse.mesh_n_per_m)?;
    positive("anchor_n_per_m", spec.coarse.anchor_n_per_m)?;
    positive("refined mesh_n_per_m", spec.fine.mesh_n_per_m)?;
    positive("refined anchor_n_per_m", spec.fine.anchor_n_per_m)?;
    spec.mass_kg.iter().try_for_each(|&mass_kg| positive("mass_kg", mass_kg))?;
    match spec.held.iter().find(|&&vertex| vertex as usize >= vertices) {
        Some(&vertex) => Err(SpringError::OutOfRange { vertex, vertices }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::testing::{hexagon, sphere, spring_spec};

    #[test]
    fn refined_all_around_a_vertex_keeps_a_quarter_of_its_mass() {
        for surface in [hexagon(3, 0.03), sphere(1, 0.05)] {
            let model = SpringModel::build(spring_spec(surface)).unwrap();
            let surface = model.surface();
            for vertex in 0..model.vertices() {
                let given: f64 = surface.edges_at(vertex).iter().map(|_| model.given_kg(vertex)).sum();
                assert!((given / model.spec().mass_kg[vertex as usize] - 0.75).abs() < 1e-14);
            }
            for (number, edge) in (0..).zip(surface.edges()) {
                let given: f64 = edge.nodes.iter().map(|&vertex| model.given_kg(vertex)).sum();
                assert!((given / model.edge_kg(number) - 1.0).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn bad_numbers_are_named() {
        let spec = || spring_spec(hexagon(2, 0.03));
        let refused = |change: fn(&mut SpringSpec)| {
            let mut bad = spec();
            change(&mut bad);
            SpringModel::build(bad).unwrap_err().to_string()
        };
        assert!(SpringModel::build(spec()).is_ok());
        assert!(refused(|s| s.coarse.anchor_n_per_m = 0.0).starts_with("anchor_n_per_m = 0"));
        assert!(refused(|s| s.fine.mesh_n_per_m = f64::NAN).starts_with("refined mesh_n_per_m = NaN"));
        assert!(refused(|s| s.mass_kg[3] = -1.0).starts_with("mass_kg = -1"));
        assert_eq!(refused(|s| s.mass_kg.truncate(5)), "5 masses for 19 vertices");
        assert_eq!(refused(|s| s.held.push(40)), "vertex 40 is held, but there are only 19");
    }
}
