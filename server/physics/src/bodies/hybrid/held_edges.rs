//! Middles of held edges. Composite tets have nodes there, which are no nodes of the mesh and so in none of its regions.
//!
//! Where all corners of a boundary triangle are in a set, so are the middles of its edges. Sets that are fixed hold together: along an axis
//! along which every corner is in some of them, as beside the edge between two planes of symmetry, the middles are fixed, too.
use super::composite::Composite;
use crate::{
    mesh::{Surface, TetMesh, tet::EDGES},
    settings::PrescribedSpec,
};
use std::collections::{BTreeMap, BTreeSet};

/// Returns the prescribed sets, extended by the middles of edges.
pub(super) fn with_edges(
    mesh: &TetMesh,
    surface: &Surface,
    composite: &Composite,
    prescribed: &[PrescribedSpec],
) -> Vec<PrescribedSpec> {
    let mut middle_of: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for (corners, nodes) in mesh.tets().iter().zip(composite.tets()) {
        for (number, [a, b]) in EDGES.into_iter().enumerate() {
            middle_of.insert(ascending(corners[a], corners[b]), nodes[4 + number]);
        }
    }
    let (fixed, moved): (Vec<usize>, Vec<usize>) = (0..prescribed.len()).partition(|&set| prescribed[set].is_fixed);
    let mut middles = vec![BTreeSet::new(); prescribed.len()];
    for set in moved {
        let nodes: BTreeSet<u32> = prescribed[set].nodes.iter().copied().collect();
        for (edges, _) in held_triangles(surface, |node| [nodes.contains(&node); 3]) {
            middles[set].extend(edges.iter().filter_map(|edge| middle_of.get(edge)));
        }
    }
    let mut axes_of: BTreeMap<u32, [bool; 3]> = BTreeMap::new();
    for spec in fixed.iter().map(|&set| &prescribed[set]) {
        for &node in &spec.nodes {
            let axes = axes_of.entry(node).or_default();
            *axes = [0, 1, 2].map(|axis| axes[axis] || spec.axes[axis]);
        }
    }
    let mut axes_of_middle: BTreeMap<u32, [bool; 3]> = BTreeMap::new();
    for (edges, held) in held_triangles(surface, |node| axes_of.get(&node).copied().unwrap_or_default()) {
        for middle in edges.iter().filter_map(|edge| middle_of.get(edge)) {
            let axes = axes_of_middle.entry(*middle).or_default();
            *axes = [0, 1, 2].map(|axis| axes[axis] || held[axis]);
        }
    }
    for (middle, mut left) in axes_of_middle {
        while let Some(set) = widest_within(left, &fixed, prescribed) {
            middles[set].insert(middle);
            left = [0, 1, 2].map(|axis| left[axis] && !prescribed[set].axes[axis]);
        }
    }
    let extended = prescribed.iter().zip(middles);
    extended.map(|(set, middles)| PrescribedSpec { nodes: with(&set.nodes, middles), ..set.clone() }).collect()
}

fn with(nodes: &[u32], middles: BTreeSet<u32>) -> Vec<u32> {
    nodes.iter().copied().chain(middles).collect()
}

/// Returns the edges of boundary triangles of which all corners are held along the same axes, with these axes.
fn held_triangles(
    surface: &Surface,
    axes_of: impl Fn(u32) -> [bool; 3],
) -> impl Iterator<Item = ([[u32; 2]; 3], [bool; 3])> {
    (0..surface.triangles.len()).filter_map(move |triangle| {
        let [a, b, c] = surface.triangle_nodes(triangle);
        let held = [a, b, c].map(&axes_of);
        let all = [0, 1, 2].map(|axis| held.iter().all(|axes| axes[axis]));
        all.contains(&true).then(|| ([ascending(a, b), ascending(b, c), ascending(c, a)], all))
    })
}

/// Returns the set that holds the most of some axes and no other, if one holds any.
fn widest_within(axes: [bool; 3], sets: &[usize], prescribed: &[PrescribedSpec]) -> Option<usize> {
    let count = |set: &usize| prescribed[*set].axes.iter().filter(|held| **held).count();
    let is_within = |set: &usize| (0..3).all(|axis| axes[axis] || !prescribed[*set].axes[axis]);
    sets.iter().copied().filter(is_within).filter(|set| count(set) > 0).max_by_key(count)
}

fn ascending(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::tet_box;
    use glam::DVec3;

    /// Two planes of symmetry and a base that is held whole: every middle in one of these planes is held across it, one of the base along
    /// all axes, no other along any, and none twice.
    #[test]
    fn middles_are_held_across_every_fixed_plane_that_they_lie_in() {
        let mesh = tet_box(DVec3::ZERO, DVec3::ONE, [2, 3, 2]);
        let (surface, composite) = (Surface::of(&mesh).unwrap(), Composite::new(&mesh));
        let lies = |p: DVec3| [p.x < 1e-9 || p.z < 1e-9, p.y < 1e-9 || p.z < 1e-9, p.z < 1e-9];
        let mut by_axes: BTreeMap<[bool; 3], Vec<u32>> = BTreeMap::new();
        for (node, p) in (0..).zip(mesh.positions_m()) {
            by_axes.entry(lies(*p)).or_default().push(node);
        }
        by_axes.remove(&[false; 3]);
        assert_eq!(by_axes.len(), 4);
        let set = |(axes, nodes)| PrescribedSpec { name: format!("{axes:?}"), nodes, axes, is_fixed: true };
        let sets: Vec<PrescribedSpec> = by_axes.into_iter().map(set).collect();
        let extended = with_edges(&mesh, &surface, &composite, &sets);
        let mut held: BTreeMap<u32, [u32; 3]> = BTreeMap::new();
        for set in &extended {
            for node in &set.nodes {
                (0..3).for_each(|axis| held.entry(*node).or_default()[axis] += u32::from(set.axes[axis]));
            }
        }
        let (mut seen, mut of_both) = (0, 0);
        for (corners, nodes) in mesh.tets().iter().zip(composite.tets()) {
            for (number, [a, b]) in EDGES.into_iter().enumerate() {
                let middle = 0.5 * (mesh.positions_m()[corners[a] as usize] + mesh.positions_m()[corners[b] as usize]);
                let expected = lies(middle).map(u32::from);
                assert_eq!(held.get(&nodes[4 + number]).copied().unwrap_or_default(), expected, "{middle}");
                seen += u32::from(expected != [0; 3]);
                of_both += u32::from(expected == [1, 1, 0]);
            }
        }
        assert!(seen > 50 && of_both > 1, "{seen} {of_both}");
        // Sets that may move hold what lies within one of them alone.
        let moved: Vec<PrescribedSpec> =
            sets.into_iter().map(|set| PrescribedSpec { is_fixed: false, ..set }).collect();
        let fewer: usize = with_edges(&mesh, &surface, &composite, &moved).iter().map(|set| set.nodes.len()).sum();
        assert!(fewer < extended.iter().map(|set| set.nodes.len()).sum::<usize>());
    }
}
