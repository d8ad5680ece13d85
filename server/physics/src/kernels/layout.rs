//! From a mesh to blocks: tets grouped by material, ordered for locality, padded to whole blocks.
use super::tets::{RestLanes, Run, TetBlocks};
use crate::{
    elements::integration_points::{IntegrationPoint, IntegrationPoints},
    lanes::{
        blocks::{Block, Blocks},
        real::Scalar,
    },
    material::constants::Constants,
    mesh::TetMesh,
};
use glam::DVec3;

/// Consecutive tets along the space-filling curve are spread over the lanes of this many blocks, so that lanes of one
/// block rarely share a node: sums of one node would wait for each other in the scatter.
pub(super) const BLOCKS_PER_WINDOW: usize = 16;

/// Blocks of the points of all tets, and the runs of equal material among them.
pub(super) fn blocks<T: Scalar, const N: usize>(
    mesh: &TetMesh,
    points: &IntegrationPoints,
) -> (TetBlocks<T, N>, Vec<Run<T>>) {
    let (tet_material, materials) = points.materials();
    let tets = mesh.tets().len();
    let centroid = |tet| mesh.corners_m(tet).iter().sum::<DVec3>() / 4.0;
    let curve = morton_codes((0..tets).map(centroid), mesh.bounds_m());
    let mut order: Vec<u32> = (0..tets as u32).collect();
    order.sort_by_key(|&t| (tet_material[t as usize], curve[t as usize], t));
    let spare = mesh.positions_m().len() as u32;
    let mut blocks = Vec::with_capacity(order.len().div_ceil(N) + materials.len());
    let mut runs = Vec::new();
    for group in order.chunk_by(|&a, &b| tet_material[a as usize] == tet_material[b as usize]) {
        let start = blocks.len();
        for window in group.chunks(N * BLOCKS_PER_WINDOW) {
            let count = window.len().div_ceil(N);
            for first in 0..count {
                let lanes = window.iter().skip(first).step_by(count);
                blocks.push(block(lanes.map(|&t| points.point(t as usize)), spare));
            }
        }
        let material = materials[tet_material[group[0] as usize] as usize];
        runs.push(Run { material, constants: Constants::of(&material), blocks: start..blocks.len() });
    }
    (Blocks::new(blocks, spare as usize + 1), runs)
}

fn block<'a, T: Scalar, const N: usize>(
    tets: impl Iterator<Item = IntegrationPoint<'a>>,
    spare: u32,
) -> Block<RestLanes<T, N>, N> {
    let zero = T::of(0.0);
    let rest = RestLanes { gradients: [[zero; N]; 9], minus_volume: [zero; N] };
    let mut block = Block { nodes: [[spare; 4]; N], rest };
    for (lane, tet) in tets.enumerate() {
        block.nodes[lane].copy_from_slice(tet.nodes);
        for corner in 0..3 {
            for axis in 0..3 {
                let gradient = tet.gradients_per_m[corner + 1][axis];
                block.rest.gradients[3 * corner + axis][lane] = T::of(gradient);
            }
        }
        block.rest.minus_volume[lane] = T::of(-tet.volume_m3);
    }
    block
}

/// Place of each point (m) along the Morton curve through a box.
pub(super) fn morton_codes(points_m: impl Iterator<Item = DVec3>, (low, high): (DVec3, DVec3)) -> Vec<u64> {
    let extent = (high - low).max_element();
    let cells = f64::from(1_u32 << 20);
    let code = |point: DVec3| {
        let cell = (point - low) / extent * cells;
        spread(cell.x as u64) | spread(cell.y as u64) << 1 | spread(cell.z as u64) << 2
    };
    points_m.map(code).collect()
}

/// Two zero bits between any two of the low 21 bits.
fn spread(mut bits: u64) -> u64 {
    for (shift, mask) in [
        (32, 0x001f_0000_0000_ffff),
        (16, 0x001f_0000_ff00_00ff),
        (8, 0x100f_00f0_0f00_f00f),
        (4, 0x10c3_0c30_c30c_30c3),
        (2, 0x1249_2492_4924_9249),
    ] {
        bits = (bits | bits << shift) & mask;
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::elements::linear_tet::RestTet;
    use crate::material::{Convention, Lame, Law, Material, Viscosity};

    #[test]
    fn bits_are_spread_by_three() {
        for bit in 0..21 {
            assert_eq!(spread(1 << bit), 1 << (3 * bit));
        }
        assert_eq!(spread(0x1f_ffff), 0x1249_2492_4924_9249);
    }

    /// 37 tets in two materials: every tet in one lane of its material's run, every other lane harmless.
    #[test]
    fn each_tet_has_one_lane_and_padding_points_to_the_spare_node() {
        let count = 37_u32;
        let mut points = vec![DVec3::Y, DVec3::Z];
        points.extend((0..=count).map(|i| DVec3::X * f64::from(i)));
        let tets = (0..count).map(|i| [i + 2, i + 3, 0, 1]).collect();
        let mesh = TetMesh::new(points, tets).unwrap();
        let rest: Vec<RestTet> = (0..37).map(|t| RestTet::new(&mesh.edge_matrix_m(t))).collect();
        let of = |mu_pa| {
            let lame = Lame::new(0.0, mu_pa).unwrap();
            Material::new(Law::default(), lame, Viscosity::default(), Convention::Consistent)
        };
        let tet_material: Vec<u16> = (0..37).map(|t| u16::from(t % 3 == 0)).collect();
        let points = IntegrationPoints::of_linear_tets(&mesh, &rest, &tet_material, &[of(1.0), of(2.0)]);
        let (blocks, runs) = blocks::<f32, 16>(&mesh, &points);
        let mut seen = vec![0; 37];
        for run in &runs {
            for block in blocks.batches(run.blocks.clone()).flat_map(|batch| batch.blocks()) {
                for lane in 0..16 {
                    match block.nodes[lane][0] as usize {
                        40 => {
                            assert_eq!(block.nodes[lane], [40; 4]);
                            assert_eq!(block.rest.minus_volume[lane], 0.0);
                        }
                        node => {
                            seen[node - 2] += 1;
                            assert_eq!(run.material.lame.mu_pa, if (node - 2) % 3 == 0 { 2.0 } else { 1.0 });
                        }
                    }
                }
            }
        }
        assert_eq!(seen, vec![1; 37]);
        assert_eq!(runs.iter().map(|run| run.blocks.len()).sum::<usize>(), 3);
    }
}
