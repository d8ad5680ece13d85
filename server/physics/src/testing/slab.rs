//! Boxes of tets.
use crate::mesh::TetMesh;
use glam::DVec3;

/// A box of `cells` of six tets each.
pub(crate) fn tet_box(low: DVec3, size: DVec3, cells: [usize; 3]) -> TetMesh {
    let count = cells.map(|n| n + 1);
    let number = |[i, j, k]: [usize; 3]| ((k * count[1] + j) * count[0] + i) as u32;
    let places =
        |n: [usize; 3]| (0..n[2]).flat_map(move |k| (0..n[1]).flat_map(move |j| (0..n[0]).map(move |i| [i, j, k])));
    let positions: Vec<DVec3> = places(count)
        .map(|at| low + size * DVec3::from(std::array::from_fn(|axis| at[axis] as f64 / cells[axis] as f64)))
        .collect();
    let mut tets = Vec::new();
    for place in places(cells) {
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            let mut at = place;
            let mut tet = [number(at); 4];
            for (step, axis) in order.into_iter().enumerate() {
                at[axis] += 1;
                tet[step + 1] = number(at);
            }
            let [a, b, c, d] = tet.map(|n| positions[n as usize]);
            if (b - a).cross(c - a).dot(d - a) < 0.0 {
                tet.swap(2, 3);
            }
            tets.push(tet);
        }
    }
    TetMesh::new(positions, tets).unwrap()
}

/// 80 × 80 × 40 mm in 2 × 2 × 1 cells.
pub(crate) fn slab() -> TetMesh {
    tet_box(DVec3::ZERO, DVec3::new(0.08, 0.08, 0.04), [2, 2, 1])
}
