//! The tangent stiffness as a sum of dense blocks over groups of nodes, and its sparse Cholesky factorisation.
use faer::{
    Conj, MatMut, Par, Side, Spec,
    dyn_stack::{MemBuffer, MemStack},
    linalg::cholesky::llt::factor::LltRegularization,
    perm::PermRef,
    sparse::{
        Argsort, Pair, SparseColMat, SymbolicSparseColMat,
        linalg::cholesky::{
            CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
        },
    },
};
use glam::{BVec3, DVec3};
use miette::{IntoDiagnostic, Result};

const HELD: usize = usize::MAX;

/// Sparse system on the free axes of some nodes; its pattern is found once.
pub(super) struct System {
    number: Vec<[usize; 3]>,
    count: usize,
    groups: Vec<Vec<u32>>,
    pattern: SymbolicSparseColMat<usize>,
    order: Argsort<usize>,
    entries: usize,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    memory: MemBuffer,
}

impl System {
    /// `free[node]` says which axes move; `node_order` has all nodes in the order of elimination; every group's nodes are joined with
    /// each other. A node may be in a group more than once.
    pub(super) fn new(free: &[BVec3], node_order: &[u32], groups: Vec<Vec<u32>>) -> Result<Self> {
        let mut count = 0;
        let mut number = vec![[HELD; 3]; free.len()];
        for &node in node_order {
            for axis in (0..3).filter(|&axis| free[node as usize].test(axis)) {
                number[node as usize][axis] = count;
                count += 1;
            }
        }
        let mut places = Vec::new();
        for group in &groups {
            for_entries(&number, group, |row, column, _, _| places.push(Pair { row, col: column }));
        }
        let (pattern, order) = SymbolicSparseColMat::try_new_from_indices(count, count, &places).into_diagnostic()?;
        // Unknowns have their order already.
        let as_numbered: Vec<usize> = (0..count).collect();
        let symbolic = factorize_symbolic_cholesky(
            pattern.as_ref(),
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&as_numbered, &as_numbered, count)),
            CholeskySymbolicParams::default(),
        )
        .into_diagnostic()?;
        let numeric = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        let memory = MemBuffer::new(numeric.or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq)));
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self { number, count, groups, pattern, order, entries: places.len(), symbolic, factor, memory })
    }

    /// Solves `K u = f` on the free axes; `blocks` are the groups' symmetric matrices (N/m), row-major, `3m × 3m`. `None` when K is not
    /// positive definite.
    pub(super) fn solve(&mut self, blocks: &[Vec<f64>], forces_n: &[DVec3]) -> Option<Vec<DVec3>> {
        self.factorise(blocks)?;
        Some(self.solve_factorised(forces_n))
    }

    /// Factorises K, of blocks as in [`Self::solve`]. `None` when it is not positive definite.
    pub(super) fn factorise(&mut self, blocks: &[Vec<f64>]) -> Option<()> {
        let mut values = Vec::with_capacity(self.entries);
        for (group, block) in self.groups.iter().zip(blocks) {
            let width = 3 * group.len();
            for_entries(&self.number, group, |_, _, i, j| values.push(block[i * width + j]));
        }
        let matrix = SparseColMat::new_from_argsort(self.pattern.clone(), &self.order, &values).ok()?;
        let stack = MemStack::new(&mut self.memory);
        let (regular, spec) = (LltRegularization::default(), Spec::default());
        let factorised = self.symbolic.factorize_numeric_llt(
            &mut self.factor,
            matrix.as_ref(),
            Side::Lower,
            regular,
            Par::Seq,
            stack,
            spec,
        );
        factorised.ok().map(|_| ())
    }

    /// Solves `K u = f` on the free axes, with the K that was factorised last.
    pub(super) fn solve_factorised(&mut self, forces_n: &[DVec3]) -> Vec<DVec3> {
        let mut right = vec![0.0; self.count];
        for (numbers, force) in self.number.iter().zip(forces_n) {
            for axis in (0..3).filter(|&axis| numbers[axis] != HELD) {
                right[numbers[axis]] = force[axis];
            }
        }
        let factor = LltRef::<usize, f64>::new(&self.symbolic, &self.factor);
        let columns = MatMut::from_column_major_slice_mut(&mut right, self.count, 1);
        factor.solve_in_place_with_conj(Conj::No, columns, Par::Seq, MemStack::new(&mut self.memory));
        let value = |n: usize| if n == HELD { 0.0 } else { right[n] };
        self.number.iter().map(|n| DVec3::new(value(n[0]), value(n[1]), value(n[2]))).collect()
    }
}

/// Calls `visit(row, column, i, j)` for the entries of a group's block that fall into the lower triangle.
fn for_entries(number: &[[usize; 3]], group: &[u32], mut visit: impl FnMut(usize, usize, usize, usize)) {
    for (i, row) in group.iter().flat_map(|&n| number[n as usize]).enumerate() {
        for (j, column) in group.iter().flat_map(|&n| number[n as usize]).enumerate() {
            if row != HELD && column != HELD && row >= column {
                visit(row, column, i, j);
            }
        }
    }
}
