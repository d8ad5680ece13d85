//! Shapes for tests.
use super::{LayerSpec, PaperModel, SeedParameters, SeedSpec};
use crate::{mesh::TetMesh, testing};
use glam::DVec3;

/// Returns vertices (m) and triangles of an ellipsoid: an icosahedron whose triangles are split in four `rounds` times.
pub(crate) fn sphere(axes_m: DVec3, rounds: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let (directions, triangles) = testing::sphere(rounds);
    (directions.iter().map(|&direction| direction * axes_m).collect(), triangles)
}

/// Returns one layer of prisms between two ellipsoids, each split in three tets.
pub(crate) fn shell(inner_m: DVec3, outer_m: DVec3, rounds: u32) -> TetMesh {
    let (directions, triangles) = sphere(DVec3::ONE, rounds);
    let count = directions.len() as u32;
    let positions = directions.iter().map(|&d| d * inner_m).chain(directions.iter().map(|&d| d * outer_m)).collect();
    let mut tets = Vec::new();
    for triangle in triangles {
        // Diagonals of the quads go from the lower number inside to the higher one outside.
        let mut low = triangle;
        low.sort_unstable();
        let [a, b, c] = low;
        let (up_a, up_b, up_c) = (a + count, b + count, c + count);
        for tet in [[a, b, c, up_c], [a, b, up_b, up_c], [a, up_a, up_b, up_c]] {
            tets.push(tet);
        }
    }
    let positions: Vec<DVec3> = positions;
    for tet in &mut tets {
        let [a, b, c, d] = tet.map(|n: u32| positions[n as usize]);
        if (b - a).cross(c - a).dot(d - a) < 0.0 {
            tet.swap(2, 3);
        }
    }
    TetMesh::new(positions, tets).unwrap()
}

/// Returns a ball of 30 mm radius: a core of 240 tets from 12 to 20 mm, held at its upper end, and 8000 particles
/// around it under 320 triangles.
pub(crate) fn ball_spec() -> SeedSpec {
    let (skin_m, skin_triangles) = sphere(DVec3::splat(0.03), 2);
    let core = shell(DVec3::splat(0.012), DVec3::splat(0.02), 1);
    let top = (0..core.positions_m().len() as u32).filter(|&n| core.positions_m()[n as usize].z > 0.010).collect();
    SeedSpec {
        core,
        held_nodes: top,
        layer: Some(LayerSpec { skin_m, skin_triangles, particles: 8000 }),
        parameters: SeedParameters::paper_2006(PaperModel::Hybrid),
    }
}
