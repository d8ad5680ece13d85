//! Meshes of the stress suite: bricks with any spacing, jittered and slivered ones.
use crate::random::Random;
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{Surface, TetMesh};

/// Evenly spaced coordinates (m).
pub(crate) fn even(from_m: f64, to_m: f64, cells: usize) -> Vec<f64> {
    (0..=cells).map(|i| from_m + (to_m - from_m) * i as f64 / cells as f64).collect()
}

/// Bricks between the given coordinates (m), six tets each, every second brick mirrored so that no direction is preferred.
pub(crate) fn bricks(xs: &[f64], ys: &[f64], zs: &[f64]) -> Result<TetMesh> {
    let (nx, ny, nz) = (xs.len() - 1, ys.len() - 1, zs.len() - 1);
    let mut positions = Vec::with_capacity((nx + 1) * (ny + 1) * (nz + 1));
    for &z in zs {
        for &y in ys {
            positions.extend(xs.iter().map(|&x| DVec3::new(x, y, z)));
        }
    }
    let mut tets = Vec::with_capacity(6 * nx * ny * nz);
    for cell in (0..nx * ny * nz).map(|n| [n % nx, n / nx % ny, n / (nx * ny)]) {
        // Corner of the brick by bits; odd bricks are mirrored along each axis, so that the diagonals of shared faces meet.
        let corner = |bits: usize| {
            let [i, j, k]: [usize; 3] = std::array::from_fn(|axis| cell[axis] + ((bits >> axis ^ cell[axis]) & 1));
            (i + (nx + 1) * (j + (ny + 1) * k)) as u32
        };
        tets.extend([[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]].map(|[a, b]| [0, a, b, 7].map(corner)));
    }
    oriented(positions, tets)
}

/// A block of 40 × 40 × 20 mm with its top at z = 0, `cells` along x and y, half as many along z.
pub(super) fn block(cells: usize) -> Result<TetMesh> {
    let side = even(-0.02, 0.02, cells);
    bricks(&side, &side, &even(-0.02, 0.0, cells.div_ceil(2)))
}

/// The mesh with its inner nodes moved at random by up to `amount_m` along each axis; a move that makes a tet smaller than a
/// tenth of what it was is taken back.
pub(super) fn jittered(mesh: &TetMesh, amount_m: f64, random: &mut Random) -> Result<TetMesh> {
    let surface = Surface::of(mesh).into_diagnostic()?;
    let mut positions = mesh.positions_m().to_vec();
    for node in 0..positions.len() {
        if surface.vertex_of_node[node] != u32::MAX {
            continue;
        }
        let before = positions[node];
        positions[node] += random.vector() * amount_m;
        let around = (0..mesh.tets().len()).filter(|&tet| mesh.tets()[tet].contains(&(node as u32)));
        let mut volumes = around.map(|tet| volume_m3(&positions, mesh.tets()[tet]) / mesh.volume_m3(tet));
        if volumes.any(|share| share < 0.1) {
            positions[node] = before;
        }
    }
    TetMesh::new(positions, mesh.tets().to_vec()).into_diagnostic()
}

/// The block with a tet in it pressed flat: one of its inner nodes moved towards the opposite face of a tet until the smallest
/// dihedral angle is about `angle_deg`.
pub(super) fn with_sliver(mesh: &TetMesh, angle_deg: f64) -> Result<TetMesh> {
    let surface = Surface::of(mesh).into_diagnostic()?;
    let Some(node) = surface.vertex_of_node.iter().position(|&vertex| vertex == u32::MAX) else {
        miette::bail!("the mesh has no inner node to move");
    };
    let Some(tet) = mesh.tets().iter().find(|tet| tet.contains(&(node as u32))) else {
        miette::bail!("the inner node {node} has no tet");
    };
    let face = tet.iter().filter(|&&n| n as usize != node).map(|&n| mesh.positions_m()[n as usize]);
    let towards = face.sum::<DVec3>() / 3.0;
    let moved = |share: f64| {
        let mut positions = mesh.positions_m().to_vec();
        positions[node] = positions[node].lerp(towards, share);
        TetMesh::new(positions, mesh.tets().to_vec())
    };
    let (mut open, mut closed) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (open + closed);
        let wide =
            moved(middle).is_ok_and(|mesh| palpate_physics::mesh::quality::measure(&mesh).min_dihedral_deg > angle_deg);
        *(if wide { &mut open } else { &mut closed }) = middle;
    }
    moved(open).into_diagnostic()
}

/// Nodes whose rest position satisfies a condition.
pub(super) fn nodes_where(mesh: &TetMesh, wanted: impl Fn(DVec3) -> bool) -> Vec<u32> {
    (0..mesh.positions_m().len() as u32).filter(|&n| wanted(mesh.positions_m()[n as usize])).collect()
}

/// Surface triangles whose corners all satisfy a condition.
pub(super) fn triangles_where(mesh: &TetMesh, wanted: impl Fn(DVec3) -> bool) -> Result<Vec<u32>> {
    let surface = Surface::of(mesh).into_diagnostic()?;
    let inside = |t: &u32| {
        let corners = surface.triangle_nodes(*t as usize);
        corners.iter().all(|&n| wanted(mesh.positions_m()[n as usize]))
    };
    Ok((0..surface.triangles.len() as u32).filter(inside).collect())
}

fn volume_m3(positions: &[DVec3], tet: [u32; 4]) -> f64 {
    let [a, b, c, d] = tet.map(|n| positions[n as usize]);
    (b - a).cross(c - a).dot(d - a) / 6.0
}

fn oriented(positions: Vec<DVec3>, mut tets: Vec<[u32; 4]>) -> Result<TetMesh> {
    for tet in tets.iter_mut().filter(|tet| volume_m3(&positions, **tet) < 0.0) {
        tet.swap(2, 3);
    }
    TetMesh::new(positions, tets).into_diagnostic()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_fill_what_they_should() {
        let block = block(4).unwrap();
        assert!((block.total_volume_m3() / 32e-6 - 1.0).abs() < 1e-12);
        let shaken = jittered(&block, 2e-3, &mut Random::new(3)).unwrap();
        assert!((shaken.total_volume_m3() / 32e-6 - 1.0).abs() < 1e-12 && shaken != block);
    }

    #[test]
    fn a_sliver_has_the_angle_asked_for() {
        let mesh = with_sliver(&block(4).unwrap(), 1.0).unwrap();
        let angle = palpate_physics::mesh::quality::measure(&mesh).min_dihedral_deg;
        assert!((angle - 1.0).abs() < 1e-3, "{angle}");
    }
}
