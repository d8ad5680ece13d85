//! The FEM core Ω_e: linear tets of St. Venant-Kirchhoff material with viscous stress, in the semi-implicit scheme.
//!
//! Eq. 22 (2005: 6) prints `F_i = (V/2) Σ_j x_j Σ_k Σ_l Γ_jl Γ_ik σ_kl = +(V/2) F σ b_i`. Its sign is that of ∂U/∂x,
//! while eq. 32 needs the force −∂U/∂x. With the ½ and either paper's strain the force is `−V F S b_i` with the factors
//! of the [`Convention`](crate::material::Convention), which is what [`RestTet::forces_n`] computes.
use super::{SeedError, SeedParameters};
use crate::{
    elements::{
        integration_points::IntegrationPoints, linear_tet::RestTet, mass, rest_stiffness::nodal_stiffness_n_per_m,
    },
    material::{Law, Material},
    mesh::{Surface, TetMesh},
};
use glam::{DMat3, DVec3};

/// The core, with everything that its rest state fixes.
#[derive(Debug, Clone)]
pub struct Core {
    mesh: TetMesh,
    rest_tets: Vec<RestTet>,
    material: Material,
    mass_kg: Vec<f64>,
    /// Inverse masses `1/m` (1/kg), zero for held nodes.
    inverse_mass_per_kg: Vec<f64>,
    /// Stiffness `D_i = −∂F_i/∂x_i` (N/m) of each node at rest.
    stiffness_n_per_m: Vec<DMat3>,
    /// Matrices `(m_i I + dt² D_i)⁻¹` (1/kg), zero for held nodes.
    implicit_per_kg: Vec<DMat3>,
    boundary: Surface,
    outer_triangles: Vec<[u32; 3]>,
}

impl Core {
    pub(super) fn new(mesh: &TetMesh, held_nodes: &[u32], parameters: &SeedParameters) -> Result<Self, SeedError> {
        let count = mesh.positions_m().len();
        if let Some(&index) = held_nodes.iter().find(|&&node| node as usize >= count) {
            return Err(SeedError::OutOfRange { what: "held_nodes", index, count });
        }
        let SeedParameters { lame, viscosity, convention, density_kg_per_m3, dt_s, .. } = *parameters;
        let material = Material::new(Law::StVenantKirchhoff, lame, viscosity, convention);
        let rest_tets: Vec<RestTet> = (0..mesh.tets().len()).map(|t| RestTet::new(&mesh.edge_matrix_m(t))).collect();
        let mass_kg = mass::lumped_kg(mesh, |_| density_kg_per_m3);
        let of_tet = vec![0; rest_tets.len()];
        let points = IntegrationPoints::of_linear_tets(mesh, &rest_tets, &of_tet, &[material]);
        let stiffness_n_per_m = nodal_stiffness_n_per_m(&points, count);
        let mut inverse_mass_per_kg: Vec<f64> = mass_kg.iter().map(|m| 1.0 / m).collect();
        let mut implicit_per_kg: Vec<DMat3> = mass_kg
            .iter()
            .zip(&stiffness_n_per_m)
            .map(|(m, d)| (DMat3::from_diagonal(DVec3::splat(*m)) + *d * (dt_s * dt_s)).inverse())
            .collect();
        for &node in held_nodes {
            inverse_mass_per_kg[node as usize] = 0.0;
            implicit_per_kg[node as usize] = DMat3::ZERO;
        }
        let boundary = Surface::of(mesh)?;
        let triangles: Vec<[u32; 3]> = (0..boundary.triangles.len()).map(|t| boundary.triangle_nodes(t)).collect();
        let outer_triangles = outer_part(mesh.positions_m(), &triangles);
        Ok(Self {
            mesh: mesh.clone(),
            rest_tets,
            material,
            mass_kg,
            inverse_mass_per_kg,
            stiffness_n_per_m,
            implicit_per_kg,
            boundary,
            outer_triangles,
        })
    }

    /// Returns the core's tets.
    pub fn mesh(&self) -> &TetMesh {
        &self.mesh
    }

    /// Returns the rest positions (m) of the nodes.
    pub fn rest_m(&self) -> &[DVec3] {
        self.mesh.positions_m()
    }

    /// Returns the lumped masses (kg) of the nodes.
    pub fn mass_kg(&self) -> &[f64] {
        &self.mass_kg
    }

    /// Returns the inverse masses `1/m` (1/kg) of the nodes, which are zero for held ones.
    pub fn inverse_mass_per_kg(&self) -> &[f64] {
        &self.inverse_mass_per_kg
    }

    /// Returns the rest data of the tets, in their order.
    pub fn rest_tets(&self) -> &[RestTet] {
        &self.rest_tets
    }

    /// Returns the material.
    pub fn material(&self) -> &Material {
        &self.material
    }

    /// Returns the boundary, including the walls of cavities.
    pub fn boundary(&self) -> &Surface {
        &self.boundary
    }

    /// Returns the triangles of the outer part of the boundary as nodes, counter-clockwise seen from outside.
    pub fn outer_triangles(&self) -> &[[u32; 3]] {
        &self.outer_triangles
    }

    /// Computes the internal forces (N) by eq. 22, with the sign of eq. 32.
    pub fn forces_n(&self, x: &[DVec3], v: &[DVec3], forces_n: &mut [DVec3]) {
        forces_n.fill(DVec3::ZERO);
        for (nodes, rest) in self.mesh.tets().iter().zip(&self.rest_tets) {
            let corners = |a: &[DVec3]| nodes.map(|node| a[node as usize]);
            for (node, force) in nodes.iter().zip(rest.forces_n(&self.material, &corners(x), &corners(v))) {
                forces_n[*node as usize] += force;
            }
        }
    }

    /// Takes one step of eq. 34, `v ← (M + dt²D)⁻¹(M v + dt F)`, `x ← x + dt v`. `integrate::seed_semi_implicit` tells
    /// its defects.
    pub fn advance(&self, dt_s: f64, forces_n: &[DVec3], x: &mut [DVec3], v: &mut [DVec3]) {
        for (node, force) in forces_n.iter().enumerate() {
            let drag = self.stiffness_n_per_m[node] * v[node] * dt_s;
            v[node] += self.implicit_per_kg[node] * ((*force - drag) * dt_s);
            x[node] += v[node] * dt_s;
        }
    }

    /// Returns the force (N) which, acting during a step of eq. 34, moves a node by `by_m` (m) more:
    /// `(M + dt²D) by/dt²`.
    pub fn force_for_n(&self, node: usize, by_m: DVec3, dt_s: f64) -> DVec3 {
        by_m * (self.mass_kg[node] / (dt_s * dt_s)) + self.stiffness_n_per_m[node] * by_m
    }
}

/// Returns the triangles of that closed surface of a boundary which encloses the largest volume; the others are walls
/// of cavities.
pub(super) fn outer_part(positions_m: &[DVec3], boundary: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut part: Vec<u32> = (0..positions_m.len() as u32).collect();
    loop {
        let mut changed = false;
        for triangle in boundary {
            let lowest = triangle.map(|n| part[n as usize]).into_iter().min().unwrap_or(0);
            for &node in triangle {
                changed |= part[node as usize] != lowest;
                part[node as usize] = lowest;
            }
        }
        if !changed {
            break;
        }
    }
    let mut enclosed_m3 = vec![0.0; positions_m.len()];
    for triangle in boundary {
        let [a, b, c] = triangle.map(|n| positions_m[n as usize]);
        enclosed_m3[part[triangle[0] as usize] as usize] += a.dot(b.cross(c)) / 6.0;
    }
    let most = (0..enclosed_m3.len()).max_by(|&a, &b| enclosed_m3[a].total_cmp(&enclosed_m3[b])).unwrap_or(0);
    boundary.iter().filter(|triangle| part[triangle[0] as usize] as usize == most).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::seed::{PaperModel, testing::shell},
        material::{Convention, Viscosity},
        testing::Random,
    };

    fn core(convention: Convention, viscous: bool) -> Core {
        let mesh = shell(DVec3::splat(0.012), DVec3::splat(0.02), 1);
        let mut parameters = SeedParameters { convention, ..SeedParameters::paper_2006(PaperModel::Ellipsoids) };
        if !viscous {
            parameters.viscosity = Viscosity::default();
        }
        Core::new(&mesh, &[], &parameters).unwrap()
    }

    #[test]
    fn the_printed_elastic_factors_are_one_half_in_2006_and_one_in_2005() {
        let bodies = [Convention::Consistent, Convention::Paper2006, Convention::Paper2005].map(|c| core(c, false));
        let mut random = Random(11);
        let x: Vec<DVec3> = bodies[0].rest_m().iter().map(|&p| p + random.vector() * 1e-3).collect();
        let v = vec![DVec3::ZERO; x.len()];
        let [consistent, of_2006, of_2005] = bodies.map(|body| {
            let mut force = v.clone();
            body.forces_n(&x, &v, &mut force);
            force
        });
        assert!(consistent.iter().any(|f| f.length() > 1e-6));
        for node in 0..x.len() {
            assert!((of_2006[node] * 2.0 - consistent[node]).length() < 1e-12 * consistent[node].length().max(1e-6));
            assert_eq!(of_2005[node], consistent[node]);
        }
    }

    #[test]
    fn viscous_stress_is_the_same_in_both_papers() {
        let [of_2006, of_2005] = [Convention::Paper2006, Convention::Paper2005].map(|c| core(c, true));
        let mut random = Random(12);
        let v: Vec<DVec3> = of_2006.rest_m().iter().map(|_| random.vector()).collect();
        let force = |body: &Core| {
            let mut force = vec![DVec3::ZERO; v.len()];
            body.forces_n(body.rest_m(), &v, &mut force);
            force
        };
        let (a, b) = (force(&of_2006), force(&of_2005));
        assert!(a.iter().any(|f| f.length() > 1e-8));
        assert!(a.iter().zip(&b).all(|(a, b)| a.distance(*b) < 1e-12 * a.length()));
    }

    #[test]
    fn the_force_is_minus_the_energys_gradient() {
        let body = core(Convention::Consistent, false);
        let mut random = Random(13);
        let mut x: Vec<DVec3> = body.rest_m().iter().map(|&p| p + random.vector() * 1e-3).collect();
        let v = vec![DVec3::ZERO; x.len()];
        let mut force = v.clone();
        body.forces_n(&x, &v, &mut force);
        let energy = |x: &[DVec3]| -> f64 {
            let of =
                |(nodes, rest): (&[u32; 4], &RestTet)| rest.energy_j(&body.material, &nodes.map(|n| x[n as usize]));
            body.mesh.tets().iter().zip(&body.rest_tets).map(of).sum()
        };
        for node in [0, 30, 60] {
            for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
                let mut moved = |by: f64| {
                    x[node] += axis * by;
                    let energy = energy(&x);
                    x[node] -= axis * by;
                    energy
                };
                let slope = (moved(1e-7) - moved(-1e-7)) / 2e-7;
                assert!((force[node].dot(axis) + slope).abs() < 1e-6 * force[node].length(), "node {node}");
            }
        }
    }

    #[test]
    fn the_outer_surface_is_the_one_that_encloses_the_cavity() {
        let body = core(Convention::Paper2006, true);
        assert_eq!(body.outer_triangles().len(), 80);
        assert!(
            body.outer_triangles().iter().flatten().all(|&n| (body.rest_m()[n as usize].length() - 0.02).abs() < 1e-12)
        );
    }

    #[test]
    fn the_semi_implicit_step_is_eq_34() {
        let body = core(Convention::Paper2006, false);
        let dt = 7e-3;
        let mut random = Random(14);
        let force: Vec<DVec3> = body.rest_m().iter().map(|_| random.vector() * 1e-3).collect();
        let start: Vec<DVec3> = body.rest_m().iter().map(|_| random.vector() * 1e-2).collect();
        let (mut x, mut v) = (body.rest_m().to_vec(), start.clone());
        body.advance(dt, &force, &mut x, &mut v);
        for node in 0..x.len() {
            // (I + dt²/m D) v' = v + dt F/m
            let m = body.mass_kg[node];
            let left = v[node] + body.stiffness_n_per_m[node] * v[node] * (dt * dt / m);
            let right = start[node] + force[node] * (dt / m);
            assert!(left.distance(right) < 1e-14 && x[node].distance(body.rest_m()[node] + v[node] * dt) < 1e-16);
        }
    }
}
