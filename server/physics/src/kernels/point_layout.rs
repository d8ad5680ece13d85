//! From integration points to blocks: points grouped by material and by how many nodes they have, ordered for locality,
//! padded to whole blocks.
use super::{
    layout::{BLOCKS_PER_WINDOW, morton_codes},
    points::{PointBlock, PointRun, PointTables},
};
use crate::{
    elements::integration_points::{IntegrationPoint, IntegrationPoints},
    lanes::real::Scalar,
    material::constants::Constants,
    mesh::TetMesh,
};
use glam::DVec3;

/// The points of a mesh that are not of tets, in blocks.
pub(super) fn tables<T: Scalar, const N: usize>(points: &IntegrationPoints, mesh: &TetMesh) -> PointTables<T, N> {
    let middle = |number: usize| {
        let nodes = points.point(number).nodes;
        nodes.iter().map(|&node| mesh.positions_m()[node as usize]).sum::<DVec3>() / nodes.len() as f64
    };
    let numbers = points.beside_tets();
    let curve = morton_codes(numbers.clone().map(middle), mesh.bounds_m());
    let (material_of, materials) = points.materials();
    let groups_of = |number: usize| (points.point(number).nodes.len() - 1).div_ceil(3);
    let mut order: Vec<usize> = numbers.clone().collect();
    order.sort_by_key(|&number| (material_of[number], groups_of(number), curve[number - numbers.start], number));

    let spare = mesh.positions_m().len() as u32;
    let mut tables = PointTables { nodes: Vec::new(), gradients: Vec::new(), blocks: Vec::new(), runs: Vec::new() };
    for of_material in order.chunk_by(|&a, &b| material_of[a] == material_of[b]) {
        let start = tables.blocks.len();
        for of_size in of_material.chunk_by(|&a, &b| groups_of(a) == groups_of(b)) {
            for window in of_size.chunks(N * BLOCKS_PER_WINDOW) {
                let count = window.len().div_ceil(N);
                for first in 0..count {
                    let lanes: Vec<_> =
                        window.iter().skip(first).step_by(count).map(|&number| points.point(number)).collect();
                    tables.push(&lanes, groups_of(window[0]), spare);
                }
            }
        }
        let material = materials[material_of[of_material[0]] as usize];
        let blocks = start..tables.blocks.len();
        tables.runs.push(PointRun { material, constants: Constants::of(&material), blocks });
    }
    tables
}

impl<T: Scalar, const N: usize> PointTables<T, N> {
    fn push(&mut self, lanes: &[IntegrationPoint<'_>], groups: usize, spare: u32) {
        let zero = T::of(0.0);
        let (first_node, first_gradient) = (self.nodes.len(), self.gradients.len());
        self.nodes.resize(first_node + 1 + 3 * groups, [spare; N]);
        self.gradients.resize(first_gradient + 3 * groups, [[zero; N]; 3]);
        let mut block = PointBlock { first_node, first_gradient, groups, minus_volume: [zero; N] };
        for (lane, point) in lanes.iter().enumerate() {
            block.minus_volume[lane] = T::of(-point.volume_m3);
            for nodes in &mut self.nodes[first_node..] {
                nodes[lane] = point.nodes[0];
            }
            for (number, (&node, b)) in point.nodes.iter().zip(point.gradients_per_m).enumerate().skip(1) {
                self.nodes[first_node + number][lane] = node;
                self.gradients[first_gradient + number - 1][0][lane] = T::of(b.x);
                self.gradients[first_gradient + number - 1][1][lane] = T::of(b.y);
                self.gradients[first_gradient + number - 1][2][lane] = T::of(b.z);
            }
        }
        self.blocks.push(block);
    }
}
