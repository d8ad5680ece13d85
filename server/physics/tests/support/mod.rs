//! Meshes and states shared by the physics tests.
#![allow(dead_code, missing_docs, clippy::expect_used)]
use glam::{DMat3, DQuat, DVec3};
use palpate_physics::TetMesh;

/// splitmix64: the same numbers on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// Uniform in [0, 1).
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform in [low, high).
    pub(crate) fn in_range(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Components uniform in [−1, 1).
    pub(crate) fn vector(&mut self) -> DVec3 {
        DVec3::new(self.in_range(-1.0, 1.0), self.in_range(-1.0, 1.0), self.in_range(-1.0, 1.0))
    }

    pub(crate) fn matrix(&mut self) -> DMat3 {
        DMat3::from_cols(self.vector(), self.vector(), self.vector())
    }

    pub(crate) fn rotation(&mut self) -> DMat3 {
        let axis = self.vector().normalize();
        DMat3::from_quat(DQuat::from_axis_angle(axis, self.in_range(0.0, std::f64::consts::PI)))
    }

    /// `R₁ diag(σ) R₂ᵀ` with σ from the ranges given.
    pub(crate) fn gradient(&mut self, low: [f64; 3], high: [f64; 3]) -> DMat3 {
        let sigma = DVec3::from_array(std::array::from_fn(|i| self.in_range(low[i], high[i])));
        self.rotation() * DMat3::from_diagonal(sigma) * self.rotation().transpose()
    }
}

/// A box of `cells` cubes of edge `h_m`, six tets each (Kuhn), with the inner nodes moved by up to `jitter` of `h_m`.
pub(crate) fn block(cells: [usize; 3], h_m: f64, jitter: f64, random: &mut Random) -> TetMesh {
    let [nx, ny, nz] = cells;
    let id = |i: usize, j: usize, k: usize| (i + (nx + 1) * (j + (ny + 1) * k)) as u32;
    let mut positions = Vec::new();
    for k in 0..=nz {
        for j in 0..=ny {
            for i in 0..=nx {
                positions.push((DVec3::new(i as f64, j as f64, k as f64) + random.vector() * jitter) * h_m);
            }
        }
    }
    let mut tets = Vec::new();
    let paths = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                for path in paths {
                    let mut corner = [i, j, k];
                    let mut tet = [id(i, j, k); 4];
                    for (step, axis) in path.into_iter().enumerate() {
                        corner[axis] += 1;
                        tet[step + 1] = id(corner[0], corner[1], corner[2]);
                    }
                    if path == [0, 2, 1] || path == [1, 0, 2] || path == [2, 1, 0] {
                        tet.swap(2, 3);
                    }
                    tets.push(tet);
                }
            }
        }
    }
    TetMesh::new(positions, tets).expect("a valid block")
}

/// Largest length in a list of vectors.
pub(crate) fn largest(vectors: &[DVec3]) -> f64 {
    vectors.iter().map(|f| f.length()).fold(0.0, f64::max)
}

/// Largest distance between two lists of vectors.
pub(crate) fn largest_difference(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}
