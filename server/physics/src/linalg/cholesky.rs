//! Sparse Cholesky by faer: one symbolic factorisation, numeric ones in the same memory.
use faer::{
    Conj, MatMut, Par, Side, Spec,
    dyn_stack::{MemBuffer, MemStack},
    linalg::cholesky::llt::factor::LltRegularization,
    sparse::{
        SparseColMatRef, SymbolicSparseColMatRef,
        linalg::cholesky::{
            CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
        },
    },
};

use thiserror::Error;

/// The lower triangle of a sparse symmetric matrix in compressed columns.
#[derive(Debug, Clone)]
pub(crate) struct LowerTriangle {
    /// Where each column's entries start, and the end of the last.
    pub(crate) column_start: Vec<usize>,
    /// Row of every entry, ascending in each column.
    pub(crate) row: Vec<usize>,
    /// Value of every entry.
    pub(crate) value: Vec<f64>,
}

impl LowerTriangle {
    /// Returns the sum of entries, each a column, a row that is not above it, and a value; every column has its diagonal.
    pub(crate) fn summed(unknowns: usize, mut entries: Vec<([u32; 2], f64)>) -> Self {
        entries.extend((0..unknowns as u32).map(|diagonal| ([diagonal; 2], 0.0)));
        // Stable, so that sums have the same bits in every run.
        entries.sort_by_key(|(place, _)| *place);
        let (mut column_start, mut row, mut value) = (Vec::with_capacity(unknowns + 1), Vec::new(), Vec::new());
        for of_place in entries.chunk_by(|one, next| one.0 == next.0) {
            let [column, at] = of_place[0].0;
            if at == column {
                column_start.push(row.len());
            }
            row.push(at as usize);
            value.push(of_place.iter().map(|(_, value)| value).sum());
        }
        column_start.push(row.len());
        Self { column_start, row, value }
    }
}

/// Why a matrix cannot be factorised.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the sparse factorisation of {unknowns} unknowns failed: {reason}")]
pub struct CholeskyError {
    /// Size of the system.
    pub unknowns: usize,
    /// What the library says.
    pub reason: String,
}

/// `P K Pᵀ = L Lᵀ`.
pub(crate) struct Factor {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    numeric_memory: MemBuffer,
    solve_memory: MemBuffer,
    unknowns: usize,
}

impl Factor {
    /// Orders (AMD) and analyses the pattern.
    pub(crate) fn analyse(matrix: &LowerTriangle) -> Result<Self, CholeskyError> {
        let unknowns = matrix.column_start.len() - 1;
        let failed = |reason: String| CholeskyError { unknowns, reason };
        let pattern = pattern(matrix);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|e| failed(e.to_string()))?;
        let memory = |req| MemBuffer::try_new(req).map_err(|_| failed("out of memory".into()));
        let numeric_memory = memory(symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()))?;
        let solve_memory = memory(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq))?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|e| failed(e.to_string()))?;
        values.resize(symbolic.len_val(), 0.0);
        Ok(Self { symbolic, values, numeric_memory, solve_memory, unknowns })
    }

    /// Factorises; false when `K` is not positive definite.
    pub(crate) fn factorise(&mut self, matrix: &LowerTriangle) -> bool {
        let sparse = SparseColMatRef::new(pattern(matrix), matrix.value.as_slice());
        let stack = MemStack::new(&mut self.numeric_memory);
        let result = self.symbolic.factorize_numeric_llt(
            &mut self.values,
            sparse,
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            stack,
            Spec::default(),
        );
        result.is_ok()
    }

    /// `b ← K⁻¹ b`.
    pub(crate) fn solve(&mut self, b: &mut [f64]) {
        let factor = LltRef::<usize, f64>::new(&self.symbolic, &self.values);
        let rhs = MatMut::from_column_major_slice_mut(b, self.unknowns, 1);
        factor.solve_in_place_with_conj(Conj::No, rhs, Par::Seq, MemStack::new(&mut self.solve_memory));
    }
}

fn pattern(matrix: &LowerTriangle) -> SymbolicSparseColMatRef<'_, usize> {
    let unknowns = matrix.column_start.len() - 1;
    SymbolicSparseColMatRef::new_checked(unknowns, unknowns, &matrix.column_start, None, &matrix.row)
}
