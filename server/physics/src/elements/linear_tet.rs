//! The linear tetrahedron, as plain f64 code: the oracle of the vector kernels, and what the static solver assembles.
//!
//! `F = Σ_i x_i b_iᵀ` with the shape gradients `b_i = ∇N_i` (1/m) of the rest state, `Σ_i b_i = 0`.
//! Nodal force: `f_i = −∂U/∂x_i = −V P b_i` (N).
use crate::linalg::tensor::outer;
use crate::material::{Material, viscous};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// What the rest state fixes for one tet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestTet {
    /// Shape gradients `b_i` (1/m) of the four corners; they sum to zero.
    pub gradients_per_m: [DVec3; 4],
    /// Rest volume `V` (m³).
    pub volume_m3: f64,
}

impl RestTet {
    /// From the edge matrix `D = [X1−X0, X2−X0, X3−X0]` (m): rows of `D⁻¹` are `b_1, b_2, b_3`; `b_0 = −Σ`.
    pub fn new(edge_matrix_m: &DMat3) -> Self {
        let inverse_transpose = edge_matrix_m.inverse().transpose();
        let (b1, b2, b3) = (inverse_transpose.x_axis, inverse_transpose.y_axis, inverse_transpose.z_axis);
        Self { gradients_per_m: [-(b1 + b2 + b3), b1, b2, b3], volume_m3: edge_matrix_m.determinant() / 6.0 }
    }

    /// `Σ_i a_i b_iᵀ`: the deformation gradient of positions, or its rate of velocities. Written with differences to
    /// corner 0, so that a translation drops out exactly.
    pub fn gradient_of(&self, a: &[DVec3; 4]) -> DMat3 {
        let [_, b1, b2, b3] = self.gradients_per_m;
        outer(a[1] - a[0], b1) + outer(a[2] - a[0], b2) + outer(a[3] - a[0], b3)
    }

    /// Elastic energy `U = V Ψ(F)` (J).
    pub fn energy_j(&self, material: &Material, x: &[DVec3; 4]) -> f64 {
        self.volume_m3 * material.energy_density(&self.gradient_of(x))
    }

    /// Corner forces `f_i = −V P b_i` (N) of elastic stress and, where the material has any, viscous stress. They sum
    /// to zero.
    pub fn forces_n(&self, material: &Material, x: &[DVec3; 4], v: &[DVec3; 4]) -> [DVec3; 4] {
        let f = self.gradient_of(x);
        let mut p = material.piola(&f);
        if !material.viscosity.is_zero() {
            p += viscous::piola(material.viscosity, &f, &self.gradient_of(v));
        }
        self.corner_forces_n(&p)
    }

    /// Power `V S_v : Ė` (W ≥ 0) that viscous stress takes.
    pub fn viscous_power_w(&self, material: &Material, x: &[DVec3; 4], v: &[DVec3; 4]) -> f64 {
        self.volume_m3 * viscous::power_density(material.viscosity, &self.gradient_of(x), &self.gradient_of(v))
    }

    /// `f_i = −V P b_i` (N).
    pub fn corner_forces_n(&self, p: &DMat3) -> [DVec3; 4] {
        let [_, b1, b2, b3] = self.gradients_per_m;
        let [f1, f2, f3] = [b1, b2, b3].map(|b| *p * b * -self.volume_m3);
        [-(f1 + f2 + f3), f1, f2, f3]
    }

    /// Stiffness block `∂f_i/∂x_j` (N/m), negative semi-definite at rest: column `c` is `−V δP b_i` for
    /// `δF = e_c b_jᵀ`.
    pub fn stiffness_block(&self, material: &Material, f: &DMat3, i: usize, j: usize) -> DMat3 {
        let column = |axis: DVec3| {
            let dp = material.piola_differential(f, &outer(axis, self.gradients_per_m[j]));
            dp * self.gradients_per_m[i] * -self.volume_m3
        };
        DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z))
    }
}

/// The smallest `J = det F` of a body.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct VolumeRatio {
    /// `J`; below zero: inverted.
    pub ratio: f64,
    /// Where it is: a tet's number, of a hybrid body a coarse tet's.
    pub tet: usize,
}
