//! The quadratic form that the quasi-Newton method starts from, factorised once: `A = M/dt² + K₀` on the free axes.
//!
//! `K₀` is the tangent of the elastic force at rest. It is positive semidefinite for every law here, whose small strain is Hooke's, so `A`
//! is positive definite. Liu et al. take the Laplacian `Σ_t k_t V_t b_i·b_j I` in its place, which is one scalar matrix for all three axes
//! and so cheaper to solve; `docs/adr/integrators.md` has what both were measured to do.
use crate::methods::tet_body;
use faer::{
    Conj, MatMut, Par, Side, Spec,
    dyn_stack::{MemBuffer, MemStack},
    linalg::cholesky::llt::factor::LltRegularization,
    sparse::{
        SparseColMat, Triplet,
        linalg::cholesky::{
            CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
        },
    },
};
use glam::{DMat3, DVec3};
use miette::{IntoDiagnostic, Result};
use palpate_physics::Model;

const HELD: usize = usize::MAX;

/// The Cholesky factor of `A`.
pub(super) struct Prefactored {
    /// Unknown of every node's axes.
    number: Vec<[usize; 3]>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    memory: MemBuffer,
    right: Vec<f64>,
}

impl Prefactored {
    /// `A` for steps `dt_s` (s).
    ///
    /// # Errors
    /// A matrix that cannot be factorised.
    pub(super) fn new(model: &Model, dt_s: f64) -> Result<Self> {
        let (number, unknowns) = numbers(model);
        let matrix = SparseColMat::try_new_from_triplets(unknowns, unknowns, &lower_triangle(model, &number, dt_s));
        let matrix = matrix.into_diagnostic()?;
        let params = CholeskySymbolicParams::default();
        let symbolic = factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, SymmetricOrdering::Amd, params)
            .into_diagnostic()?;
        let mut values = vec![0.0; symbolic.len_val()];
        let mut memory = MemBuffer::new(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()));
        symbolic
            .factorize_numeric_llt(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Spec::default(),
            )
            .into_diagnostic()?;
        let memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        Ok(Self { number, symbolic, values, memory, right: vec![0.0; unknowns] })
    }

    /// `a ← A⁻¹ a`; held axes become zero.
    pub(super) fn solve(&mut self, a: &mut [DVec3]) {
        for (numbers, a) in self.number.iter().zip(a.iter()) {
            for (axis, &number) in numbers.iter().enumerate().filter(|(_, n)| **n != HELD) {
                self.right[number] = a[axis];
            }
        }
        let factor = LltRef::<usize, f64>::new(&self.symbolic, &self.values);
        let unknowns = self.right.len();
        let right = MatMut::from_column_major_slice_mut(&mut self.right, unknowns, 1);
        factor.solve_in_place_with_conj(Conj::No, right, Par::Seq, MemStack::new(&mut self.memory));
        for (numbers, a) in self.number.iter().zip(a) {
            *a = DVec3::from(numbers.map(|number| if number == HELD { 0.0 } else { self.right[number] }));
        }
    }
}

fn numbers(model: &Model) -> (Vec<[usize; 3]>, usize) {
    let mut unknowns = 0;
    let mut next = |inverse_mass: f64| {
        if inverse_mass == 0.0 {
            return HELD;
        }
        unknowns += 1;
        unknowns - 1
    };
    let number = tet_body(model).inverse_mass_per_kg().iter().map(|w| w.to_array().map(&mut next)).collect();
    (number, unknowns)
}

fn lower_triangle(model: &Model, number: &[[usize; 3]], dt_s: f64) -> Vec<Triplet<usize, usize, f64>> {
    let mut entries = Vec::new();
    let mut add = |i: usize, j: usize, block: &DMat3| {
        for (r, &row) in number[i].iter().enumerate() {
            for (c, &col) in number[j].iter().enumerate() {
                if row != HELD && col != HELD && row >= col {
                    entries.push(Triplet { row, col, val: block.col(c)[r] });
                }
            }
        }
    };
    for (node, mass) in model.body().mass_kg().iter().enumerate() {
        add(node, node, &DMat3::from_diagonal(DVec3::splat(mass / (dt_s * dt_s))));
    }
    for (tet, nodes) in tet_body(model).mesh().tets().iter().enumerate() {
        let (rest, material) = (&tet_body(model).rest_tets()[tet], tet_body(model).material_of(tet));
        for (i, &p) in nodes.iter().enumerate() {
            for (j, &q) in nodes.iter().enumerate() {
                let block = rest.stiffness_block(material, &DMat3::IDENTITY, i, j);
                add(p as usize, q as usize, &-block);
            }
        }
    }
    entries
}
