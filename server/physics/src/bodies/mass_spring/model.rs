//! A mass-spring surface that can be refined: all that its rest state fixes.
//!
//! *Masses.* A node of type 2 on the edge from `a` to `b` takes half of its mass from either end, and gives it back:
//! ```text
//! m_e = ¾ (m_a/k_a + m_b/k_b),   k the number of edges at a vertex
//! ```
//! so that a vertex refined all around keeps a quarter of its mass. The mass of a region stays what it was, which is what haptic-subdivision's eq. 3, `m′ = m N/N′` for all of its nodes, is made
//! for; but here it also stays where it was, and a node that starts with the mean velocity of its ends changes no momentum. In a large region both are `m/4`.
use super::{
    home::HomeLaw,
    loop_scheme::refined,
    region::Constants,
    topology::{Triangulation, TriangulationError},
};
use glam::DVec3;
use thiserror::Error;

/// What a mass-spring surface is made from.
#[derive(Debug, Clone, PartialEq)]
pub struct SpringSpec {
    /// The coarse surface, whose vertices Loop's scheme smooths.
    pub surface: Triangulation,
    /// `K_m`, `K_h` of the coarse surface.
    pub coarse: Constants,
    /// `K′_m`, `K′_h` where it is refined.
    pub fine: Constants,
    /// `g`.
    pub home_law: HomeLaw,
    /// Mass (kg) of each vertex.
    pub mass_kg: Vec<f64>,
    /// Vertices that do not move.
    pub held: Vec<u32>,
    /// Most coarse vertices awake at once, besides those of refined triangles.
    pub most_awake: usize,
    /// Most triangles refined at once.
    pub most_refined: usize,
}

/// Why no body can be made of it.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SpringError {
    /// A number outside its range.
    #[error("{name} = {value}: {rule}")]
    Setting {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// Not one mass for each vertex.
    #[error("{found} masses for {vertices} vertices")]
    Masses {
        /// Masses given.
        found: usize,
        /// Vertices.
        vertices: usize,
    },
    /// A vertex that is not there.
    #[error("vertex {vertex} is held, but there are only {vertices}")]
    OutOfRange {
        /// The vertex.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Smoothed, it is no surface.
    #[error("smoothed by Loop's scheme the surface is none: {0}")]
    Smoothed(#[from] TriangulationError),
}

/// A mass-spring surface. Constant after load.
///
/// Nodes are numbered as vertices of the surface refined everywhere: those of type 1 by their coarse vertex, those of type 2 by the number of coarse vertices plus that of their edge.
#[derive(Debug, Clone)]
pub struct SpringModel {
    spec: SpringSpec,
    /// Homes (m) of all nodes.
    rest_m: Vec<DVec3>,
    /// Triangles of the surface refined everywhere.
    fine_triangles: Vec<[u32; 3]>,
    /// `m_e` (kg) of every edge.
    edge_kg: Vec<f64>,
    is_held: Vec<bool>,
    frequency_rad_per_s: f64,
}

impl SpringModel {
    /// Checks the specification and works out homes, masses and the largest frequency there may be.
    ///
    /// # Errors
    /// [`SpringError`].
    pub fn build(spec: SpringSpec) -> Result<Self, SpringError> {
        check(&spec)?;
        let (rest_m, fine_triangles) = refined(&spec.surface);
        let coarse_homes = rest_m[..spec.surface.positions_m().len()].to_vec();
        spec.surface.moved(coarse_homes)?;
        Triangulation::new(rest_m.clone(), fine_triangles.clone())?;
        let share_kg = |vertex: u32| 0.75 * spec.mass_kg[vertex as usize] / spec.surface.edges_at(vertex).len() as f64;
        let edge_kg = spec.surface.edges().iter().map(|edge| edge.nodes.map(share_kg).iter().sum()).collect();
        let mut is_held = vec![false; spec.mass_kg.len()];
        spec.held.iter().for_each(|&vertex| is_held[vertex as usize] = true);
        let mut model = Self { rest_m, fine_triangles, edge_kg, is_held, frequency_rad_per_s: 0.0, spec };
        model.frequency_rad_per_s = model.frequency_bound_sq(&[]).sqrt();
        Ok(model)
    }

    /// What it was made from.
    pub fn spec(&self) -> &SpringSpec {
        &self.spec
    }

    /// The coarse surface.
    pub fn surface(&self) -> &Triangulation {
        &self.spec.surface
    }

    /// Homes (m) of all nodes.
    pub fn rest_m(&self) -> &[DVec3] {
        &self.rest_m
    }

    /// Triangles of the surface refined everywhere.
    pub fn fine_triangles(&self) -> &[[u32; 3]] {
        &self.fine_triangles
    }

    /// Number of coarse vertices: that of the first node of type 2.
    pub fn vertices(&self) -> u32 {
        self.spec.surface.positions_m().len() as u32
    }

    /// Mass (kg) of a node of type 2.
    pub fn edge_kg(&self, edge: u32) -> f64 {
        self.edge_kg[edge as usize]
    }

    /// What of it (kg) one of the edge's ends gives.
    pub fn given_kg(&self, vertex: u32) -> f64 {
        0.75 * self.spec.mass_kg[vertex as usize] / self.spec.surface.edges_at(vertex).len() as f64
    }

    /// Most nodes awake at once.
    pub fn most_nodes(&self) -> usize {
        // Of a refined triangle its corners and the middles of its edges.
        self.rest_m.len().min(self.spec.most_awake + 6 * self.spec.most_refined)
    }

    /// Whether a coarse vertex does not move.
    pub fn is_held(&self, vertex: u32) -> bool {
        self.is_held[vertex as usize]
    }

    /// No natural frequency (rad/s) is larger, at whatever levels and while no home spring is pulled by more than the longest edge's length, and however far springs are stretched.
    pub fn frequency_rad_per_s(&self) -> f64 {
        self.frequency_rad_per_s
    }

    /// The same, squared, with contact that is at most a spring (N/m) in all directions on each node of the surface refined everywhere.
    pub fn touched_frequency_sq(&self, contact_n_per_m: &[f64]) -> f64 {
        self.frequency_bound_sq(contact_n_per_m)
    }

    /// `ω² ≤ max_i (K_h + 2 Σ_j k_ij)/m_i` (Gershgorin; a spring's stiffness across it is less than along it). A vertex's springs are at most those of both levels beside each other, its mass at
    /// least what it keeps when refined all around.
    ///
    /// `contact_n_per_m` is what contact may do, at most, on each node of the surface refined everywhere, as a spring in all directions; empty: nothing. Where an edge's middle has the level `s`, it acts
    /// on the node by `s` and on either end by `½ (1 − s)`.
    fn frequency_bound_sq(&self, contact_n_per_m: &[f64]) -> f64 {
        let touch_n_per_m = |node: u32, with_edges: bool| {
            let of = |node: u32| contact_n_per_m.get(node as usize).copied().unwrap_or(0.0);
            let edges = if with_edges { self.surface().edges_at(node) } else { &[] };
            of(node) + edges.iter().map(|edge| 0.5 * of(self.vertices() + edge)).sum::<f64>()
        };
        let Constants { mesh_n_per_m, home_n_per_m } = self.spec.fine;
        let most = |coarse: f64, fine: f64| coarse.max(fine);
        let edges = 0..self.surface().edges().len() as u32;
        let longest_m = edges.map(|edge| self.surface().length_m(edge)).fold(0.0, f64::max);
        let steepest = self.spec.home_law.steepest_within(longest_m);
        let of_vertex = |vertex: u32| {
            let edges = self.surface().edges_at(vertex).len() as f64;
            let triangles = self.surface().triangles_at(vertex).len() as f64;
            // Along an edge (1 − s) K_m + s K′_m; crack springs to the middles of edges across. A tie's row is ¼ k twice and ½ k.
            let springs = edges * most(self.spec.coarse.mesh_n_per_m, mesh_n_per_m) + triangles * mesh_n_per_m;
            let home = steepest * most(self.spec.coarse.home_n_per_m, home_n_per_m);
            let of_contact = touch_n_per_m(vertex, true);
            (home + 2.0 * springs + edges * home_n_per_m + of_contact) / (0.25 * self.spec.mass_kg[vertex as usize])
        };
        // Two halves, four springs inside or two to corners across; s K′_h home and (1 − s) 2 K′_h in the tie's row.
        let of_edge = |(edge, kg): (u32, &f64)| {
            ((1.0 + steepest) * home_n_per_m + 12.0 * mesh_n_per_m + touch_n_per_m(self.vertices() + edge, false)) / kg
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
    positive("home_n_per_m", spec.coarse.home_n_per_m)?;
    positive("refined mesh_n_per_m", spec.fine.mesh_n_per_m)?;
    positive("refined home_n_per_m", spec.fine.home_n_per_m)?;
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
        assert!(refused(|s| s.coarse.home_n_per_m = 0.0).starts_with("home_n_per_m = 0"));
        assert!(refused(|s| s.fine.mesh_n_per_m = f64::NAN).starts_with("refined mesh_n_per_m = NaN"));
        assert!(refused(|s| s.mass_kg[3] = -1.0).starts_with("mass_kg = -1"));
        assert_eq!(refused(|s| s.mass_kg.truncate(5)), "5 masses for 19 vertices");
        assert_eq!(refused(|s| s.held.push(40)), "vertex 40 is held, but there are only 19");
    }
}
