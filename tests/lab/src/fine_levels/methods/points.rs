//! The one operator of every particle method: gradients at points from differences of particles, in rows.
//!
//! ```text
//! F_q = O_q + Σ_p (y_p − y_o) ⊗ b_qp          o the row's origin, O_q = I − Σ_p (X_p − X_o) ⊗ b_qp, so that F_q = I at rest
//! U = Σ_q V_q Ψ_q(F_q) + ½ µ Σ_qp k_qp |e_qp|²          e_qp = (y_p − y_o) − F_q (X_p − X_o)
//! f_p = −Σ_q (V_q P_q − µ H_q) b_qp − µ Σ_q k_qp e_qp          H_q = Σ_p k_qp e_qp ⊗ (X_p − X_o),  origins the opposite
//! ```
//! What fills `b_qp`, `V_q` and `k_qp` is the method (`mod.rs`). Where a method reproduces affine motion, `O_q = 0`; where it does not (raw SPH), `O_q` makes
//! it measure strain from gradients of displacement, `F_q = I + Σ_p (u_p − u_o) ⊗ b_qp`: free of stress at rest, but not when turned.
//! The second term of U is the control of zero-energy modes (Ganzenmüller 2015, CMAME 286, 87-106): it costs what neighbours move beside the motion that
//! `F_q` tells. There it is an explicit force along `y_p − y_o`; here it is an energy, quadratic in y, so its force is its transpose like the rest.
//!
//! Every force is a sum over differences, so forces sum to zero. Where `O_q = 0`, U does not change as all turns, so neither is there a torque.
use glam::{DMat3, DVec3};
use palpate_physics::{
    bodies::hybrid::patch::Materials,
    linalg::tensor::outer,
    material::{Lame, Material, Viscosity, viscous},
};
use std::ops::Range;

/// What of a material a point has.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Role {
    /// All of it.
    Whole,
    /// Of nodal smoothing: `Ψ − γΨ̃`, at a node.
    Smoothed {
        /// γ.
        gamma: f64,
    },
    /// Of nodal smoothing: `γΨ̃`, in a tet. `Ψ̃` is the law with `λ̃ = min(λ, µ)`.
    Stabilising {
        /// γ.
        gamma: f64,
    },
}

impl Role {
    /// Every law's Ψ is linear in λ and µ, so a share of it is the law with other constants.
    fn of(self, material: &Material) -> Material {
        let Lame { lambda_pa, mu_pa } = material.lame;
        let shear = lambda_pa.min(mu_pa);
        let (lambda_pa, share) = match self {
            Self::Whole => return *material,
            Self::Smoothed { gamma } => (lambda_pa - gamma * shear, 1.0 - gamma),
            Self::Stabilising { gamma } => (gamma * shear, gamma),
        };
        let Viscosity { phi_pa_s, psi_pa_s } = material.viscosity;
        Material {
            lame: Lame { lambda_pa, mu_pa: share * mu_pa },
            viscosity: Viscosity { phi_pa_s: share * phi_pa_s, psi_pa_s: share * psi_pa_s },
            ..*material
        }
    }
}

/// Points of integration over what is awake, as a method makes them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Points {
    /// Their rows.
    pub rows: Vec<Row>,
    /// The volume that they answer for.
    pub handed: Vec<Handed>,
}

/// A part of a cell's volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Handed {
    /// Index of the cell.
    pub cell: usize,
    /// The part.
    pub part: f64,
}

/// A point of integration.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// `V_q` (m³).
    pub volume_m3: f64,
    /// The particle from which differences are taken.
    pub origin: u32,
    /// The coarse tet whose material it has.
    pub tet: u32,
    /// What of that.
    pub role: Role,
    /// The other particles.
    pub terms: Vec<Term>,
}

/// A particle in a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Term {
    /// p.
    pub particle: u32,
    /// `b_qp` (1/m).
    pub gradient_per_m: DVec3,
    /// `X_p − X_o` (m).
    pub span_m: DVec3,
    /// `k_qp` (m).
    pub control_m: f64,
}

impl Row {
    /// `Σ_p (X_p − X_o) ⊗ b_qp`: the gradient that the method gives the identity map.
    pub fn of_identity(&self) -> DMat3 {
        self.terms.iter().fold(DMat3::ZERO, |sum, term| sum + outer(term.span_m, term.gradient_per_m))
    }

    /// Does it see one of these particles?
    pub fn touches(&self, mut is_one: impl FnMut(u32) -> bool) -> bool {
        is_one(self.origin) || self.terms.iter().any(|term| is_one(term.particle))
    }
}

/// Rows over a patch's points, in CSR form.
#[derive(Debug, Clone)]
pub struct Operator {
    rows: Vec<Head>,
    /// Where each row's terms begin, and where the last one's end.
    starts: Vec<u32>,
    points: Vec<u32>,
    gradients_per_m: Vec<DVec3>,
    spans_m: Vec<DVec3>,
    controls_m: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Head {
    volume_m3: f64,
    origin: u32,
    tet: u32,
    role: Role,
    /// `O_q`.
    offset: DMat3,
}

impl Operator {
    /// From rows that answer for the share `handed` of their volume; `point_of` numbers particles.
    pub fn new(rows: &[Row], handed: f64, mut point_of: impl FnMut(u32) -> u32) -> Self {
        let mut operator = Self {
            rows: Vec::with_capacity(rows.len()),
            starts: vec![0],
            points: Vec::new(),
            gradients_per_m: Vec::new(),
            spans_m: Vec::new(),
            controls_m: Vec::new(),
        };
        for row in rows {
            operator.rows.push(Head {
                volume_m3: handed * row.volume_m3,
                origin: point_of(row.origin),
                tet: row.tet,
                role: row.role,
                offset: DMat3::IDENTITY - row.of_identity(),
            });
            for term in &row.terms {
                operator.points.push(point_of(term.particle));
                operator.gradients_per_m.push(term.gradient_per_m);
                operator.spans_m.push(term.span_m);
                operator.controls_m.push(handed * term.control_m);
            }
            operator.starts.push(operator.points.len() as u32);
        }
        operator
    }

    /// Number of rows.
    pub fn row_count(&self) -> usize {
        self.rows.len()
    }

    /// Elastic energy (J) at positions of the points.
    pub fn energy_j(&self, materials: &Materials<'_>, y: &[DVec3]) -> f64 {
        let of_row = |(row, head): (usize, &Head)| {
            let material = materials.of(head.tet as usize);
            let g = self.gradient_of(row, y);
            let control = self.terms(row).map(|k| self.controls_m[k] * self.beside(row, k, &g, y).length_squared());
            head.volume_m3 * head.role.of(material).energy_density(&(head.offset + g))
                + 0.5 * material.lame.mu_pa * control.sum::<f64>()
        };
        self.rows.iter().enumerate().map(of_row).sum()
    }

    /// Adds forces (N) of elastic and viscous stress; returns the power (W) that viscous stress takes.
    pub fn add_forces_n(&self, materials: &Materials<'_>, y: &[DVec3], rate: &[DVec3], forces_n: &mut [DVec3]) -> f64 {
        let mut power_w = 0.0;
        for (row, head) in self.rows.iter().enumerate() {
            let (whole, g) = (materials.of(head.tet as usize), self.gradient_of(row, y));
            let (material, f) = (head.role.of(whole), head.offset + g);
            let mut stress = material.piola(&f);
            if !material.viscosity.is_zero() {
                let f_dot = self.gradient_of(row, rate);
                stress += viscous::piola(material.viscosity, &f, &f_dot);
                power_w += head.volume_m3 * viscous::power_density(material.viscosity, &f, &f_dot);
            }
            self.scatter(row, whole.lame.mu_pa, &stress, &g, y, forces_n);
        }
        power_w
    }

    /// Adds `−K a` (N), the change of the elastic forces along `a` at positions `y`.
    pub fn add_products_n(&self, materials: &Materials<'_>, y: &[DVec3], a: &[DVec3], products_n: &mut [DVec3]) {
        for (row, head) in self.rows.iter().enumerate() {
            let (whole, change) = (materials.of(head.tet as usize), self.gradient_of(row, a));
            let f = head.offset + self.gradient_of(row, y);
            let stress = head.role.of(whole).piola_differential(&f, &change);
            self.scatter(row, whole.lame.mu_pa, &stress, &change, a, products_n);
        }
    }

    /// Adds the diagonal blocks (N/m) of the stiffness at rest, `V ((λ + µ) b_p b_pᵀ + µ |b_p|² I) + µ Σ_r k_r (δ_rp − b_p·(X_r − X_o))² I`; the origin has
    /// `b_o = −Σ b_p` and moves against the others.
    pub fn add_diagonal_n_per_m(&self, materials: &Materials<'_>, blocks: &mut [DMat3]) {
        for (row, head) in self.rows.iter().enumerate() {
            let whole = materials.of(head.tet as usize);
            let Lame { lambda_pa, mu_pa } = head.role.of(whole).lame;
            let block = |b: DVec3, itself: &dyn Fn(usize) -> f64| {
                let of_control = |r: usize| {
                    let moved = itself(r) - b.dot(self.spans_m[r]);
                    self.controls_m[r] * moved * moved
                };
                let control: f64 = self.terms(row).map(of_control).sum();
                let all_round = mu_pa * head.volume_m3 * b.length_squared() + whole.lame.mu_pa * control;
                outer(b, b) * (head.volume_m3 * (lambda_pa + mu_pa)) + DMat3::from_diagonal(DVec3::splat(all_round))
            };
            for k in self.terms(row) {
                let itself = |r: usize| if r == k { 1.0 } else { 0.0 };
                blocks[self.points[k] as usize] += block(self.gradients_per_m[k], &itself);
            }
            let of_origin: DVec3 = self.gradients_per_m[self.terms(row)].iter().sum();
            blocks[head.origin as usize] += block(-of_origin, &|_| -1.0);
        }
    }

    fn terms(&self, row: usize) -> Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    /// `Σ_p (a_p − a_o) ⊗ b_qp`.
    fn gradient_of(&self, row: usize, a: &[DVec3]) -> DMat3 {
        let origin = a[self.rows[row].origin as usize];
        let term = |k: usize| outer(a[self.points[k] as usize] - origin, self.gradients_per_m[k]);
        self.terms(row).fold(DMat3::ZERO, |sum, k| sum + term(k))
    }

    /// `e_qp` (m), with the gradient of the same `a`.
    fn beside(&self, row: usize, k: usize, gradient: &DMat3, a: &[DVec3]) -> DVec3 {
        a[self.points[k] as usize] - a[self.rows[row].origin as usize] - *gradient * self.spans_m[k]
    }

    fn scatter(&self, row: usize, mu_pa: f64, stress: &DMat3, gradient: &DMat3, a: &[DVec3], forces_n: &mut [DVec3]) {
        let head = &self.rows[row];
        let control = |k: usize| self.beside(row, k, gradient, a) * (mu_pa * self.controls_m[k]);
        // V_q P_q − µ H_q
        let h = self.terms(row).fold(DMat3::ZERO, |sum, k| sum + outer(control(k), self.spans_m[k]));
        let stress = *stress * head.volume_m3 - h;
        for k in self.terms(row) {
            let force = stress * self.gradients_per_m[k] + control(k);
            forces_n[self.points[k] as usize] -= force;
            forces_n[head.origin as usize] += force;
        }
    }
}
