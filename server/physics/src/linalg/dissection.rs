//! Nested dissection by geometry: an order of nodes in which a Cholesky factor of what couples neighbours has few entries.
//!
//! A set of nodes is cut in half across its longest extent. The nodes of one half that have neighbours in the other separate
//! the rest of it from that: they come last, after both parts, each of which is cut in the same way (George 1973). A part
//! fills nothing of the factor in another part's rows. An order of all nodes serves any of them: what is left of a separator
//! separates what is left of its parts.
use glam::DVec3;
use std::ops::Range;

/// Number of nodes that are not cut further.
const SMALL: usize = 8;

/// Returns the place of every node in the order. `neighbours` has those of each node.
pub(crate) fn places(positions_m: &[DVec3], neighbours: &[Vec<u32>]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..positions_m.len() as u32).collect();
    let mut part_of = vec![0_u32; positions_m.len()];
    let mut parts = 0;
    // Ranges of the order that are to be cut, and the number of the cut.
    let mut open: Vec<Range<usize>> = std::iter::once(0..order.len()).collect();
    while let Some(range) = open.pop() {
        if range.len() <= SMALL {
            continue;
        }
        let nodes = &mut order[range.clone()];
        let at = |node: u32| positions_m[node as usize];
        let (low, high) = nodes
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &node| (low.min(at(node)), high.max(at(node))));
        let extent = (high - low).to_array();
        let axis = (0..3).max_by(|a, b| extent[*a].total_cmp(&extent[*b])).unwrap_or(0);
        nodes.sort_unstable_by(|a, b| at(*a)[axis].total_cmp(&at(*b)[axis]).then(a.cmp(b)));
        let (one, other) = nodes.split_at(nodes.len() / 2);
        parts += 1;
        for &node in other {
            part_of[node as usize] = parts;
        }
        let separates = |node: u32| neighbours[node as usize].iter().any(|n| part_of[*n as usize] == parts);
        let (separator, rest): (Vec<u32>, Vec<u32>) = one.iter().copied().partition(|&node| separates(node));
        let (first, second) = (rest.len(), other.len());
        let ordered: Vec<u32> = rest.into_iter().chain(other.iter().copied()).chain(separator).collect();
        nodes.copy_from_slice(&ordered);
        open.push(range.start..range.start + first);
        open.push(range.start + first..range.start + first + second);
    }
    let mut places = vec![0; order.len()];
    for (place, &node) in (0..).zip(&order) {
        places[node as usize] = place;
    }
    places
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Number of entries below the diagonal of the factor of a matrix that couples neighbours, eliminated in an order.
    fn entries_of_factor(neighbours: &[Vec<u32>], places: &[u32]) -> usize {
        let mut columns: Vec<BTreeSet<u32>> = vec![BTreeSet::new(); places.len()];
        for (node, of_node) in neighbours.iter().enumerate() {
            columns[places[node] as usize]
                .extend(of_node.iter().map(|n| places[*n as usize]).filter(|p| *p > places[node]));
        }
        let mut entries = 0;
        for column in 0..columns.len() {
            let rows = std::mem::take(&mut columns[column]);
            entries += rows.len();
            if let Some(&first) = rows.first() {
                columns[first as usize].extend(rows.into_iter().filter(|row| *row > first));
            }
        }
        entries
    }

    #[test]
    fn it_is_an_order_that_fills_little_of_a_block_and_of_its_parts() {
        let n = 9_u32;
        let at = |node: u32| DVec3::new(f64::from(node % n), f64::from(node / n % n), f64::from(node / n / n));
        let positions: Vec<DVec3> = (0..n.pow(3)).map(at).collect();
        let near = |a: u32| (0..n.pow(3)).filter(|&b| b != a && at(a).distance(at(b)) < 1.1).collect();
        let neighbours: Vec<Vec<u32>> = (0..n.pow(3)).map(near).collect();
        let places = places(&positions, &neighbours);
        let mut sorted = places.clone();
        sorted.sort_unstable();
        assert!(sorted.into_iter().eq(0..n.pow(3)));
        let (as_numbered, dissected) = (
            entries_of_factor(&neighbours, &(0..n.pow(3)).collect::<Vec<u32>>()),
            entries_of_factor(&neighbours, &places),
        );
        println!("{dissected} of {as_numbered}");
        assert!(5 * dissected < 3 * as_numbered, "{dissected} {as_numbered}");
        // Of a corner alone, in the same order.
        let corner: Vec<u32> = (0..n.pow(3)).filter(|&node| at(node).max_element() < 6.0).collect();
        let number = |node: &u32| corner.binary_search(node).ok().map(|number| number as u32);
        let of_corner: Vec<Vec<u32>> =
            corner.iter().map(|&node| neighbours[node as usize].iter().filter_map(number).collect()).collect();
        let mut by_place: Vec<usize> = (0..corner.len()).collect();
        by_place.sort_unstable_by_key(|&number| places[corner[number] as usize]);
        let mut places_in_corner = vec![0; corner.len()];
        (0..).zip(&by_place).for_each(|(place, &number)| places_in_corner[number] = place);
        let (as_numbered, dissected) = (
            entries_of_factor(&of_corner, &(0..corner.len() as u32).collect::<Vec<u32>>()),
            entries_of_factor(&of_corner, &places_in_corner),
        );
        println!("{dissected} of {as_numbered} in a corner");
        assert!(dissected < as_numbered, "{dissected} {as_numbered}");
    }
}
