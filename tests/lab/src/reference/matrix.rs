//! The tangent stiffness as a sum of dense blocks over groups of nodes, and its sparse Cholesky factorisation.
use faer::{
    Mat, Side,
    linalg::solvers::Solve,
    sparse::{
        Argsort, Pair, SparseColMat, SymbolicSparseColMat,
        linalg::solvers::{Llt, SymbolicLlt},
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
    symbolic: SymbolicLlt<usize>,
}

impl System {
    /// `free[node]` says which axes move; every group's nodes are joined with each other. A node may be in a group more than once.
    pub(super) fn new(free: &[BVec3], groups: Vec<Vec<u32>>) -> Result<Self> {
        let mut count = 0;
        let mut next = |is_free: bool| {
            if is_free {
                count += 1;
                count - 1
            } else {
                HELD
            }
        };
        let number: Vec<[usize; 3]> = free.iter().map(|f| [next(f.x), next(f.y), next(f.z)]).collect();
        let mut places = Vec::new();
        for group in &groups {
            for_entries(&number, group, |row, column, _, _| places.push(Pair { row, col: column }));
        }
        let (pattern, order) = SymbolicSparseColMat::try_new_from_indices(count, count, &places).into_diagnostic()?;
        let symbolic = SymbolicLlt::try_new(pattern.as_ref(), Side::Lower).into_diagnostic()?;
        Ok(Self { number, count, groups, pattern, order, entries: places.len(), symbolic })
    }

    /// Solves `K u = f` on the free axes; `blocks` are the groups' symmetric matrices (N/m), row-major, `3m × 3m`. `None` when K is not
    /// positive definite.
    pub(super) fn solve(&self, blocks: &[Vec<f64>], forces_n: &[DVec3]) -> Option<Vec<DVec3>> {
        let mut values = Vec::with_capacity(self.entries);
        for (group, block) in self.groups.iter().zip(blocks) {
            let width = 3 * group.len();
            for_entries(&self.number, group, |_, _, i, j| values.push(block[i * width + j]));
        }
        let matrix = SparseColMat::new_from_argsort(self.pattern.clone(), &self.order, &values).ok()?;
        let factor = Llt::try_new_with_symbolic(self.symbolic.clone(), matrix.as_ref(), Side::Lower).ok()?;
        let mut right = Mat::<f64>::zeros(self.count, 1);
        for (numbers, force) in self.number.iter().zip(forces_n) {
            for axis in (0..3).filter(|&axis| numbers[axis] != HELD) {
                right[(numbers[axis], 0)] = force[axis];
            }
        }
        factor.solve_in_place(right.as_mut());
        let value = |n: usize| if n == HELD { 0.0 } else { right[(n, 0)] };
        Some(self.number.iter().map(|n| DVec3::new(value(n[0]), value(n[1]), value(n[2]))).collect())
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
