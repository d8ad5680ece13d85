//! A hyperelastic body on triquadratic hexahedra.
//!
//! `U = Σ_q w_q Ψ(F_q)`, `F_q = Σ_a x_a ∇N_a(q)ᵀ`; nodal force `f_a = −Σ_q w_q P(F_q) ∇N_a`, stiffness
//! `K_ab = Σ_q w_q ∇N_a · ∂P/∂F · ∇N_b`, with 27 Gauss points an element.
//!
//! Near incompressibility volume would lock, in quadratic elements too: in each element its change is projected on linear functions
//! (`volume.rs`).
use super::{
    grid::{Face, HexGrid},
    shape::{self, GAUSS},
    volume::{self, POINTS, Volume},
};
use glam::{DMat3, DVec3};
use miette::{Result, ensure};
use palpate_physics::{
    linalg::tensor::{cofactor, cofactor_differential, outer},
    material::Material,
};

/// What the rest state fixes at one quadrature point.
#[derive(Debug, Clone)]
struct Point {
    /// `∇N_a` (1/m).
    gradients_per_m: [DVec3; 27],
    /// `w_q` (m³).
    weight_m3: f64,
    /// Where it is (m).
    at_m: DVec3,
}

/// A body at rest.
#[derive(Debug, Clone)]
pub struct Solid {
    /// Its grid.
    pub grid: HexGrid,
    material: Material,
    points: Vec<Vec<Point>>,
    /// Of every element and point, the linear functions of `volume.rs`.
    modes: Vec<[[f64; volume::MODES]; POINTS]>,
}

impl Solid {
    /// # Errors
    /// An element that is turned inside out somewhere.
    pub fn new(grid: HexGrid, material: Material) -> Result<Self> {
        let points: Vec<Vec<Point>> = grid.elements.iter().map(|nodes| quadrature(&grid, nodes)).collect();
        let bad = points.iter().flatten().filter(|point| point.weight_m3.is_nan() || point.weight_m3 <= 0.0).count();
        ensure!(bad == 0, "{bad} quadrature points of the reference grid have no positive volume");
        let modes = points.iter().map(|points| {
            let at = |k: usize| points[k].at_m;
            volume::modes(&std::array::from_fn(at), &std::array::from_fn(|k| points[k].weight_m3))
        });
        Ok(Self { modes: modes.collect(), grid, material, points })
    }

    /// Elastic energy (J) at positions `x` (m).
    pub fn energy_j(&self, x: &[DVec3]) -> f64 {
        let element = |e: usize| {
            let (f, volume) = self.strained(e, x);
            let density = |(f, point): (&DMat3, &Point)| point.weight_m3 * self.material.energy_density(f);
            f.iter().zip(&self.points[e]).map(density).sum::<f64>() + volume.energy_j
        };
        (0..self.points.len()).map(element).sum()
    }

    /// Elastic forces (N), one per node.
    pub fn forces_n(&self, x: &[DVec3]) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; x.len()];
        for (e, (nodes, points)) in self.grid.elements.iter().zip(&self.points).enumerate() {
            let (f, volume) = self.strained(e, x);
            for (point, (f, extra_pa)) in points.iter().zip(f.iter().zip(volume.extra_pa)) {
                let p = (self.material.piola(f) + cofactor(f) * extra_pa) * -point.weight_m3;
                for (&node, gradient) in nodes.iter().zip(&point.gradients_per_m) {
                    forces[node as usize] += p * *gradient;
                }
            }
        }
        forces
    }

    /// Stiffness (N/m) of every element, row-major 81 × 81.
    pub fn stiffness(&self, x: &[DVec3]) -> Vec<Vec<f64>> {
        let element = |e: usize| {
            let mut block = vec![0.0; 81 * 81];
            let (f, volume) = self.strained(e, x);
            for (point, (f, extra_pa)) in self.points[e].iter().zip(f.iter().zip(volume.extra_pa)) {
                self.add_stiffness(f, extra_pa, point, &mut block);
            }
            self.add_projected(e, &f, &mut block);
            block
        };
        (0..self.points.len()).map(element).collect()
    }

    /// With `δP = ∂P/∂F δF + κ(Πθ − θ) δ(cof F) − κ (cof F : δF) cof F`.
    fn add_stiffness(&self, f: &DMat3, extra_pa: f64, point: &Point, block: &mut [f64]) {
        let (cof, kappa) = (cofactor(f), volume::modulus_pa(&self.material));
        // differential[c][l] = ∂P/∂F_cl (Pa)
        let differential = [0, 1, 2].map(|c| {
            [0, 1, 2].map(|l| {
                let unit = outer(DVec3::AXES[c], DVec3::AXES[l]);
                self.material.piola_differential(f, &unit) + cofactor_differential(f, &unit) * extra_pa
                    - cof * (kappa * cof.col(l)[c])
            })
        });
        for (b, gradient_b) in point.gradients_per_m.iter().enumerate() {
            let stress = differential.map(|of_c| {
                (of_c[0] * gradient_b.x + of_c[1] * gradient_b.y + of_c[2] * gradient_b.z) * point.weight_m3
            });
            for (a, gradient_a) in point.gradients_per_m.iter().enumerate() {
                for (c, stress) in stress.iter().enumerate() {
                    let column = *stress * *gradient_a;
                    for r in 0..3 {
                        block[(3 * a + r) * 81 + 3 * b + c] += column[r];
                    }
                }
            }
        }
    }

    /// `κ Σ_k s_k s_kᵀ`, `s_k = ∂c_k/∂x_a = Σ_q w_q p_k cof F ∇N_a`.
    fn add_projected(&self, element: usize, f: &[DMat3; POINTS], block: &mut [f64]) {
        let kappa = volume::modulus_pa(&self.material);
        let mut slopes = [[DVec3::ZERO; 27]; volume::MODES];
        for (point, (f, modes)) in self.points[element].iter().zip(f.iter().zip(&self.modes[element])) {
            let cof = cofactor(f) * point.weight_m3;
            for (a, gradient) in point.gradients_per_m.iter().enumerate() {
                let slope = cof * *gradient;
                for (of_mode, mode) in slopes.iter_mut().zip(modes) {
                    of_mode[a] += slope * *mode;
                }
            }
        }
        for s in &slopes {
            for row in 0..81 {
                for column in 0..81 {
                    block[row * 81 + column] += kappa * s[row / 3][row % 3] * s[column / 3][column % 3];
                }
            }
        }
    }

    /// Deformation gradients at an element's points, and its change of volume.
    fn strained(&self, element: usize, x: &[DVec3]) -> ([DMat3; POINTS], Volume) {
        let (nodes, points) = (&self.grid.elements[element], &self.points[element]);
        let f: [DMat3; POINTS] = std::array::from_fn(|q| deformation_gradient(nodes, &points[q], x));
        let weights = std::array::from_fn(|q| points[q].weight_m3);
        (f, Volume::of(&f, &weights, &self.modes[element], volume::modulus_pa(&self.material)))
    }

    /// `(λ + 2µ) V` (J): the energy of unit strain.
    pub fn stiffest_j(&self) -> f64 {
        self.material.lame.p_wave_modulus_pa() * self.volume_m3()
    }

    /// Rest volume (m³).
    pub fn volume_m3(&self) -> f64 {
        self.points.iter().flatten().map(|point| point.weight_m3).sum()
    }
}

fn deformation_gradient(nodes: &[u32; 27], point: &Point, x: &[DVec3]) -> DMat3 {
    let terms = nodes.iter().zip(&point.gradients_per_m);
    terms.fold(DMat3::ZERO, |sum, (&node, gradient)| sum + outer(x[node as usize], *gradient))
}

fn quadrature(grid: &HexGrid, nodes: &[u32; 27]) -> Vec<Point> {
    let point = |n: usize| {
        let [i, j, k] = [n % 3, n / 3 % 3, n / 9];
        let at = [GAUSS[i].0, GAUSS[j].0, GAUSS[k].0];
        let slopes = shape::solid_slopes(at).map(DVec3::from);
        // J = Σ_a X_a ∂N_a/∂ξᵀ, ∇N_a = J⁻ᵀ ∂N_a/∂ξ
        let corners = nodes.iter().zip(&slopes);
        let jacobian = corners.fold(DMat3::ZERO, |sum, (&node, s)| sum + outer(grid.positions_m[node as usize], *s));
        let to_gradient = jacobian.inverse().transpose();
        Point {
            gradients_per_m: slopes.map(|s| to_gradient * s),
            weight_m3: jacobian.determinant() * GAUSS[i].1 * GAUSS[j].1 * GAUSS[k].1,
            at_m: nodes.iter().zip(shape::solid_values(at)).map(|(&node, w)| grid.positions_m[node as usize] * w).sum(),
        }
    };
    (0..27).map(point).collect()
}

/// A point of a face for integrals over the rest surface.
#[derive(Debug, Clone)]
pub struct SurfacePoint {
    /// Weights of the face's nodes.
    pub weights: [f64; 9],
    /// Unit normal, outwards.
    pub normal: DVec3,
    /// Its share of the rest area (m²).
    pub area_m2: f64,
}

/// Gauss points of `parts × parts` parts of a face at rest.
pub fn surface_points(grid: &HexGrid, face: &Face, parts: usize) -> Vec<SurfacePoint> {
    let x = face.map(|node| grid.positions_m[node as usize]);
    let mut points = Vec::with_capacity(9 * parts * parts);
    let local = |part: usize, s: f64| (2.0 * part as f64 + 1.0 + s) / parts as f64 - 1.0;
    for part in 0..parts * parts {
        for (sa, wa) in GAUSS {
            for (sb, wb) in GAUSS {
                let (a, b) = (local(part % parts, sa), local(part / parts, sb));
                let slopes = shape::face_slopes(a, b);
                let along = |d: usize| x.iter().zip(&slopes).map(|(x, s)| *x * s[d]).sum::<DVec3>();
                let area = along(0).cross(along(1));
                points.push(SurfacePoint {
                    weights: shape::face_values(a, b),
                    normal: area.normalize_or_zero(),
                    area_m2: area.length() * wa * wb / (parts * parts) as f64,
                });
            }
        }
    }
    points
}
