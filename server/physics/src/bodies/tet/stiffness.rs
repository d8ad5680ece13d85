//! The tangent stiffness `K = −∂f/∂x` of the free degrees of freedom: lower triangle, compressed columns, one pattern for ever.
use super::TetBody;
use crate::{
    elements::free_axes::{FreeAxes, NONE},
    linalg::{cholesky::LowerTriangle, eigen},
    material::Material,
    mesh::Surface,
};
use glam::{DMat3, DVec3};

/// Sparse lower triangle with the places where each integration point adds.
#[derive(Debug, Clone)]
pub(crate) struct Stiffness {
    pub(crate) matrix: LowerTriangle,
    /// Per integration point, pair of its nodes ([`pairs`]) and entry of the 3×3 block (column-major): index into `value`.
    places: Vec<[u32; 9]>,
}

/// How element stiffness enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Definiteness {
    /// As it is: Newton's method.
    Exact,
    /// Every element's negative eigenvalues raised to zero, so that the sum is positive semidefinite (Teran et al. 2005).
    Projected,
}

impl Stiffness {
    /// Lays out the pattern: two free axes share an entry when an integration point joins their nodes. A coupled tool, which may touch any part
    /// of the surface, is joined to all its nodes: three dense rows, which come last in the elimination.
    pub(crate) fn pattern(body: &TetBody, surface: &Surface, free: &FreeAxes) -> Self {
        let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); free.number.len()];
        for point in body.points().iter() {
            for &node in point.nodes {
                neighbours[node as usize].extend(point.nodes);
            }
        }
        let tools = body.mass_kg().len() as u32..free.number.len() as u32;
        for (node, near) in neighbours.iter_mut().enumerate().filter(|_| !tools.is_empty()) {
            if tools.contains(&(node as u32)) {
                near.push(node as u32);
            } else if surface.vertex_of_node[node] != u32::MAX {
                near.extend(tools.clone());
            }
        }
        let mut column_start = vec![0];
        let mut row = Vec::new();
        for (node, near) in neighbours.iter_mut().enumerate() {
            near.sort_unstable();
            near.dedup();
            for &column in free.number[node].iter().filter(|&&c| c != NONE) {
                // Numbers ascend with nodes and axes, so the rows come out sorted.
                let rows = near.iter().flat_map(|&n| free.number[n as usize]);
                row.extend(rows.filter(|&r| r != NONE && r >= column).map(|r| r as usize));
                column_start.push(row.len());
            }
        }
        let value = vec![0.0; row.len()];
        let matrix = LowerTriangle { column_start, row, value };
        let mut stiffness = Self { matrix, places: Vec::new() };
        let places = |nodes: &[u32]| -> Vec<[u32; 9]> {
            pairs(nodes.len()).map(|[i, j]| stiffness.places_of(free, [nodes[i], nodes[j]])).collect()
        };
        stiffness.places = body.points().iter().flat_map(|point| places(point.nodes)).collect();
        stiffness
    }

    fn places_of(&self, free: &FreeAxes, nodes: [u32; 2]) -> [u32; 9] {
        let [rows, columns] = nodes.map(|node| free.number[node as usize]);
        std::array::from_fn(|entry| {
            let (r, c) = (rows[entry % 3], columns[entry / 3]);
            if r == NONE || c == NONE || (nodes[0] == nodes[1] && r < c) {
                return NONE;
            }
            self.place(r.max(c), r.min(c)).map_or(NONE, |place| place as u32)
        })
    }

    /// Index into `value` of a lower-triangle entry.
    fn place(&self, row: u32, column: u32) -> Option<usize> {
        let (start, end) = (self.matrix.column_start[column as usize], self.matrix.column_start[column as usize + 1]);
        self.matrix.row[start..end].binary_search(&(row as usize)).ok().map(|k| start + k)
    }

    /// Elastic stiffness at positions `x`.
    pub(crate) fn assemble(&mut self, body: &TetBody, x: &[DVec3], definiteness: Definiteness) {
        self.matrix.value.fill(0.0);
        let mut places = self.places.iter();
        for point in body.points().iter() {
            let mut a = stress_differentials(point.material, &point.gradient_of(x));
            if definiteness == Definiteness::Projected {
                project(&mut a);
            }
            for ([i, j], places) in pairs(point.nodes.len()).zip(&mut places) {
                let block = block(&a, point.gradients_per_m[i], point.gradients_per_m[j]) * point.volume_m3;
                for (entry, &place) in places.iter().enumerate().filter(|(_, p)| **p != NONE) {
                    self.matrix.value[place as usize] += block.col(entry / 3)[entry % 3];
                }
            }
        }
    }

    /// Adds the symmetric part of a 3×3 block `∂(−f_a)/∂x_b` and its transpose at `(b, a)`; once for both, so `a ≠ b` blocks are
    /// given once as `½(K_ab + K_baᵀ)` and diagonal ones as `sym K_aa`.
    pub(crate) fn add_block(&mut self, free: &FreeAxes, a: u32, b: u32, block: &DMat3) {
        for (i, &r) in free.number[a as usize].iter().enumerate() {
            for (j, &c) in free.number[b as usize].iter().enumerate() {
                if r == NONE || c == NONE || (a == b && r < c) {
                    continue;
                }
                if let Some(place) = self.place(r.max(c), r.min(c)) {
                    self.matrix.value[place] += block.col(j)[i];
                }
            }
        }
    }

    /// Adds `shift` to the diagonal.
    pub(crate) fn shift_diagonal(&mut self, shift: f64) {
        for column in 0..self.matrix.column_start.len() - 1 {
            self.matrix.value[self.matrix.column_start[column]] += shift;
        }
    }

    /// The diagonal: the first entry of every column.
    pub(crate) fn diagonal(&self) -> impl Iterator<Item = f64> {
        self.matrix.column_start[..self.matrix.column_start.len() - 1].iter().map(|&start| self.matrix.value[start])
    }
}

/// Pairs of so many nodes, each once, with itself too.
fn pairs(nodes: usize) -> impl Iterator<Item = [usize; 2]> {
    (0..nodes).flat_map(move |i| (i..nodes).map(move |j| [i, j]))
}

/// `∂P/∂F` (Pa) as a symmetric 9×9 matrix over the entries of `F` in column-major order; row `q` is `∂P : e_q`.
fn stress_differentials(material: &Material, f: &DMat3) -> [f64; 81] {
    let mut a = [0.0; 81];
    for (q, row) in a.chunks_exact_mut(9).enumerate() {
        let mut unit = [0.0; 9];
        unit[q] = 1.0;
        let dp = material.piola_differential(f, &DMat3::from_cols_array(&unit));
        row.copy_from_slice(&dp.to_cols_array());
    }
    a
}

/// Raises negative eigenvalues to zero: `A ← Σ_k max(λ_k, 0) v_k v_kᵀ`.
fn project(a: &mut [f64; 81]) {
    let mut work = *a;
    let (values, vectors) = eigen::symmetric(&mut work, 9);
    if values.iter().all(|&value| value >= 0.0) {
        return;
    }
    a.fill(0.0);
    for (k, &value) in values.iter().enumerate().filter(|(_, value)| **value > 0.0) {
        let v = &vectors[9 * k..9 * k + 9];
        for i in 0..9 {
            for j in 0..9 {
                a[9 * i + j] += value * v[i] * v[j];
            }
        }
    }
}

/// `K_ij/V`: entry `(r, c)` is `Σ_kl b_i[k] ∂P_rk/∂F_cl b_j[l]`.
fn block(a: &[f64; 81], bi: DVec3, bj: DVec3) -> DMat3 {
    // Contract the second index of F first: B_c = Σ_l (∂P/∂F_cl) b_j[l] is a 3×3 stress; then K e_c = B_c b_i.
    let stress = |c: usize| {
        let mut p = [0.0; 9];
        for l in 0..3 {
            for (entry, value) in p.iter_mut().enumerate() {
                *value += a[9 * (3 * l + c) + entry] * bj[l];
            }
        }
        DMat3::from_cols_array(&p)
    };
    DMat3::from_cols(stress(0) * bi, stress(1) * bi, stress(2) * bi)
}

/// `∂f/∂x · dx` (N) of the elastic forces, without a matrix: for increments of prescribed axes too.
pub(crate) fn force_differential_n(body: &TetBody, x: &[DVec3], dx: &[DVec3]) -> Vec<DVec3> {
    let mut df = vec![DVec3::ZERO; x.len()];
    for point in body.points().iter().filter(|point| point.nodes.iter().any(|&n| dx[n as usize] != DVec3::ZERO)) {
        let dp = point.material.piola_differential(&point.gradient_of(x), &point.gradient_of(dx));
        point.add_forces_n(&dp, &mut df);
    }
    df
}

/// `[v]×`, so that `[v]× w = v × w`.
pub(crate) fn cross_matrix(v: DVec3) -> DMat3 {
    DMat3::from_cols(v.cross(DVec3::X), v.cross(DVec3::Y), v.cross(DVec3::Z))
}

/// `sym A = ½(A + Aᵀ)`.
pub(crate) fn symmetric_part(a: &DMat3) -> DMat3 {
    (*a + a.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn projection_keeps_a_definite_matrix_and_clears_a_negative_one() {
        let mut a = [0.0; 81];
        for i in 0..9 {
            a[10 * i] = if i == 4 { -2.0 } else { 1.0 + i as f64 };
        }
        a[1] = 0.5;
        a[9] = 0.5;
        let before = a;
        project(&mut a);
        for i in 0..81 {
            let expected = if i == 40 { 0.0 } else { before[i] };
            assert!((a[i] - expected).abs() < 1e-12, "{i}: {} {expected}", a[i]);
        }
    }

    #[test]
    fn cross_matrix_is_the_cross_product() {
        let (v, w) = (DVec3::new(1.0, -2.0, 0.5), DVec3::new(0.3, 0.7, -1.1));
        assert!((cross_matrix(v) * w - v.cross(w)).length() < 1e-15);
    }
}
