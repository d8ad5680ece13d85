//! Local numbers of the nodes of residual elements in their blocks of lanes.
use crate::bodies::hybrid::{composite::PARTS, residual_element::ResidualElement};
use glam::DVec3;

/// Returns a local number for every node of a residual element, among those of a block that have moments of the parts
/// `parts_of_local_node`, a bit each; these grow by the parts of the element's nodes. The node with moments of most
/// parts is the first. Any other gets the number to which the fewest parts have to be added, and of such numbers the
/// one of whose parts it leaves the fewest unused.
pub(super) fn assign_local_nodes(residual: &ResidualElement, parts_of_local_node: &mut Vec<u8>) -> Vec<u16> {
    let parts_of = |moments: &[DVec3; PARTS]| {
        moments.iter().enumerate().fold(0_u8, |parts, (part, moment)| parts | u8::from(*moment != DVec3::ZERO) << part)
    };
    let of_node: Vec<u8> = residual.moments_m2.iter().map(parts_of).collect();
    let mut order: Vec<usize> = (0..of_node.len()).collect();
    order.sort_by_key(|&number| (std::cmp::Reverse(of_node[number].count_ones()), number));
    let mut local_nodes = vec![0; of_node.len()];
    let mut is_taken = vec![false; parts_of_local_node.len().max(of_node.len())];
    parts_of_local_node.resize(is_taken.len(), 0);
    for (at, &number) in order.iter().enumerate() {
        let parts = of_node[number];
        let cost = |&local_node: &usize| {
            let there = parts_of_local_node[local_node];
            ((parts & !there).count_ones(), (there & !parts).count_ones(), local_node)
        };
        let free = (1..is_taken.len()).filter(|&local_node| !is_taken[local_node]);
        let local_node = if at == 0 { 0 } else { free.min_by_key(cost).unwrap_or(0) };
        is_taken[local_node] = true;
        parts_of_local_node[local_node] |= parts;
        local_nodes[number] = local_node as u16;
    }
    local_nodes
}
