//! A reference body in time: lumped mass, leapfrog.
//!
//! Mass is integrated with the nodes as quadrature points (Gauss and Lobatto: 1/3, 4/3, 1/3 along each parameter), which makes it
//! diagonal, positive, and of the elements' own order: `m_a = Σ_e ρ w_a det J_e(a)`. A step of dt is
//! `x += ½dt v`, `v ← [(1 − ½α dt) v + dt f(x)/m]/(1 + ½α dt)`, `x += ½dt v`, of second order, with mass damping α.
use super::{bodies::Body, grid::HexGrid, shape, solid::Solid};
use glam::{BVec3, DMat3, DVec3};
use miette::{Result, ensure};
use palpate_physics::linalg::tensor::outer;

const LOBATTO: [f64; 3] = [1.0 / 3.0, 4.0 / 3.0, 1.0 / 3.0];
/// Of the largest stable step, for bodies that stiffen as they deform.
const SAFETY: f64 = 0.7;
const POWER_ITERATIONS: usize = 100;

/// Step and damping.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clock {
    /// Step (s).
    pub dt_s: f64,
    /// Mass damping α (1/s).
    pub damping_per_s: f64,
}

/// A body under way.
#[derive(Debug, Clone)]
pub struct Dynamics<'a> {
    solid: &'a Solid,
    /// Positions (m).
    pub x: Vec<DVec3>,
    /// Velocities (m/s).
    pub v: Vec<DVec3>,
    free: Vec<BVec3>,
    masses_kg: Vec<f64>,
    element_masses_kg: Vec<[f64; 27]>,
}

impl<'a> Dynamics<'a> {
    /// At rest.
    ///
    /// # Errors
    /// A node without mass: where a grid's map collapses.
    pub fn new(solid: &'a Solid, body: &Body, density_kg_per_m3: f64) -> Result<Self> {
        let (masses_kg, element_masses_kg) = masses_kg(&solid.grid, density_kg_per_m3)?;
        let rest = solid.grid.positions_m.clone();
        Ok(Self {
            solid,
            v: vec![DVec3::ZERO; rest.len()],
            x: rest,
            free: body.free_axes(),
            masses_kg,
            element_masses_kg,
        })
    }

    /// A step (s) that is stable at rest with a margin: no frequency of the body is above the largest of its elements.
    pub fn stable_step_s(&self) -> f64 {
        let stiffness = self.solid.stiffness(&self.solid.grid.positions_m);
        let largest = |(k, m): (&Vec<f64>, &[f64; 27])| largest_eigenvalue(k, m);
        let omega_squared = stiffness.iter().zip(&self.element_masses_kg).map(largest).fold(0.0, f64::max);
        SAFETY * 2.0 / omega_squared.sqrt()
    }

    /// One step under forces (N) on nodes.
    pub fn step(&mut self, forces_n: &[DVec3], clock: &Clock) {
        let (half, drag) = (0.5 * clock.dt_s, 0.5 * clock.damping_per_s * clock.dt_s);
        self.x.iter_mut().zip(&self.v).for_each(|(x, v)| *x += *v * half);
        let elastic = self.solid.forces_n(&self.x);
        for node in 0..self.x.len() {
            let acceleration = (elastic[node] + forces_n[node]) / self.masses_kg[node];
            let v = (self.v[node] * (1.0 - drag) + acceleration * clock.dt_s) / (1.0 + drag);
            self.v[node] = DVec3::select(self.free[node], v, DVec3::ZERO);
            self.x[node] += self.v[node] * half;
        }
    }

    /// Kinetic and elastic energy (J).
    pub fn energy_j(&self) -> f64 {
        let kinetic = self.masses_kg.iter().zip(&self.v).map(|(m, v)| 0.5 * m * v.length_squared()).sum::<f64>();
        kinetic + self.solid.energy_j(&self.x)
    }
}

/// Masses (kg) of the nodes, and each element's part of them.
///
/// # Errors
/// A node without mass: where a grid's map collapses.
pub(super) fn masses_kg(grid: &HexGrid, density_kg_per_m3: f64) -> Result<(Vec<f64>, Vec<[f64; 27]>)> {
    let of_element = |nodes: &[u32; 27]| {
        shares_m3(&nodes.map(|n| grid.positions_m[n as usize])).map(|volume_m3| volume_m3 * density_kg_per_m3)
    };
    let of_elements: Vec<[f64; 27]> = grid.elements.iter().map(of_element).collect();
    let mut of_nodes = vec![0.0; grid.positions_m.len()];
    for (nodes, masses) in grid.elements.iter().zip(&of_elements) {
        nodes.iter().zip(masses).for_each(|(&n, m)| of_nodes[n as usize] += m);
    }
    let least = of_elements.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    ensure!(least > 0.0, "a node of a reference grid has no mass: its map collapses there");
    Ok((of_nodes, of_elements))
}

/// Rest volume (m³) of an element's nodes.
fn shares_m3(corners_m: &[DVec3; 27]) -> [f64; 27] {
    std::array::from_fn(|a| {
        let at = [a % 3, a / 3 % 3, a / 9];
        let slopes = shape::solid_slopes(at.map(|i| i as f64 - 1.0)).map(DVec3::from);
        let jacobian = corners_m.iter().zip(slopes).fold(DMat3::ZERO, |sum, (x, s)| sum + outer(*x, s));
        jacobian.determinant() * at.map(|i| LOBATTO[i]).iter().product::<f64>()
    })
}

/// Of `M⁻¹K`, by the power method from a vector that no mode is orthogonal to by symmetry.
fn largest_eigenvalue(stiffness: &[f64], masses_kg: &[f64; 27]) -> f64 {
    let mut u: Vec<f64> = (0..81).map(|i| ((i * i) as f64 * 0.7).sin()).collect();
    let mut value = 0.0;
    for _ in 0..POWER_ITERATIONS {
        let product = |row: usize| stiffness[row * 81..(row + 1) * 81].iter().zip(&u).map(|(k, u)| k * u).sum::<f64>();
        let next: Vec<f64> = (0..81).map(|row| product(row) / masses_kg[row / 3]).collect();
        // Rayleigh's quotient, uᵀKu/uᵀMu.
        let weighted = |a: &[f64], b: &[f64]| (0..81).map(|i| masses_kg[i / 3] * a[i] * b[i]).sum::<f64>();
        value = weighted(&u, &next) / weighted(&u, &u);
        let norm = next.iter().map(|v| v * v).sum::<f64>().sqrt();
        u = next.iter().map(|v| v / norm).collect();
    }
    value
}
