//! Which nodes of a mesh hang together through its elements.

/// Returns the connected part of each node, numbered in order of the parts' first nodes. A node that no element has is
/// a part by itself.
pub fn connected_parts<'e>(nodes: usize, elements: impl Iterator<Item = &'e [u32]>) -> Vec<usize> {
    let mut root: Vec<usize> = (0..nodes).collect();
    for element in elements {
        for pair in element.windows(2) {
            let (a, b) = (find(&mut root, pair[0] as usize), find(&mut root, pair[1] as usize));
            root[a.max(b)] = a.min(b);
        }
    }
    let mut number = vec![usize::MAX; nodes];
    let mut count = 0;
    (0..nodes)
        .map(|node| {
            let root = find(&mut root, node);
            if number[root] == usize::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect()
}

fn find(root: &mut [usize], mut node: usize) -> usize {
    while root[node] != node {
        root[node] = root[root[node]];
        node = root[node];
    }
    node
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joined late, and by their last nodes: the lower number stands for both.
    #[test]
    fn parts_are_numbered_by_their_first_nodes() {
        let elements: [&[u32]; 4] = [&[5, 6], &[0, 3], &[4, 2], &[3, 6]];
        assert_eq!(connected_parts(7, elements.into_iter()), [0, 1, 2, 0, 2, 0, 0]);
    }
}
