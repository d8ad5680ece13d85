//! Nested dissection: the order of nodes in which a sparse Cholesky factorisation of a grid fills in least.
//!
//! The elements are halved by a plane of the lattice, the nodes that both halves share come last, and each half is treated the same. A
//! body of N nodes so costs some N² operations, in which the largest separator, a plane, is most of it.
use super::grid::HexGrid;

/// Groups of so few elements are not halved any further.
const LEAST: usize = 2;

/// All nodes in their order.
pub(super) fn nested_dissection(grid: &HexGrid) -> Vec<u32> {
    let mut order = Vec::with_capacity(grid.positions_m.len());
    let mut placed = vec![false; grid.positions_m.len()];
    let elements: Vec<usize> = (0..grid.elements.len()).collect();
    dissect(grid, &elements, &mut placed, &mut order);
    order
}

fn dissect(grid: &HexGrid, elements: &[usize], placed: &mut [bool], order: &mut Vec<u32>) {
    let extent = |axis: usize| {
        let at = elements.iter().map(|&e| grid.cell(e)[axis]);
        (at.clone().min().unwrap_or(0), at.max().unwrap_or(0))
    };
    let extents = [0, 1, 2].map(extent);
    let longest = (0..3).max_by_key(|&axis| extents[axis].1 - extents[axis].0).unwrap_or(0);
    let middle = (extents[longest].0 + extents[longest].1).div_ceil(2);
    let (below, above): (Vec<usize>, Vec<usize>) = elements.iter().partition(|&&e| grid.cell(e)[longest] < middle);
    if elements.len() <= LEAST || below.is_empty() {
        let mut unplaced = |nodes: &[usize]| {
            for node in nodes.iter().flat_map(|&e| grid.elements[e]) {
                if !std::mem::replace(&mut placed[node as usize], true) {
                    order.push(node);
                }
            }
        };
        unplaced(elements);
        return;
    }
    let mut in_below = vec![false; placed.len()];
    below.iter().flat_map(|&e| grid.elements[e]).for_each(|node| in_below[node as usize] = true);
    let mut shared = Vec::new();
    for node in above.iter().flat_map(|&e| grid.elements[e]) {
        if in_below[node as usize] && !std::mem::replace(&mut placed[node as usize], true) {
            shared.push(node);
        }
    }
    dissect(grid, &below, placed, order);
    dissect(grid, &above, placed, order);
    order.extend(shared);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reference::grid::graded;

    #[test]
    fn every_node_comes_once_and_the_middle_plane_last() {
        let unit = |n| graded(0.0, 1.0, n, 1.0);
        let grid = HexGrid::new([unit(8), unit(4), unit(4)], |p| p);
        let order = nested_dissection(&grid);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert!(sorted.iter().enumerate().all(|(i, &n)| i == n as usize) && sorted.len() == 17 * 81);
        assert!(order[order.len() - 81..].iter().all(|&n| grid.positions_m[n as usize].x == 0.5));
    }
}
