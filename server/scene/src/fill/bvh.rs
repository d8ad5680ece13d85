//! Closest points on a triangulated surface, by a tree of boxes.
use glam::DVec3;

/// Triangles in a leaf.
const LEAF: usize = 4;

/// A surface that answers closest-point queries. Degenerate triangles are harmless.
pub(crate) struct SurfaceIndex {
    corners: Vec<[DVec3; 3]>,
    /// Triangle in the input's numbering.
    original: Vec<u32>,
    nodes: Vec<Node>,
}

struct Node {
    low: DVec3,
    high: DVec3,
    /// Leaf: first triangle and count; otherwise count 0 and `first` is the right child (the left one follows).
    first: u32,
    count: u32,
}

/// Nearest place on a surface.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Nearest {
    pub(crate) point: DVec3,
    pub(crate) distance_squared: f64,
}

impl SurfaceIndex {
    pub(crate) fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.map(|v| positions[v as usize])).collect();
        let mut original: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut nodes = Vec::with_capacity(triangles.len());
        if !original.is_empty() {
            build(&corners, &mut original, 0, &mut nodes);
        }
        Self { corners: original.iter().map(|&t| corners[t as usize]).collect(), original, nodes }
    }

    /// Nearest point of the surface; the query itself when the surface is empty.
    pub(crate) fn nearest(&self, query: DVec3) -> Nearest {
        let mut best = Nearest { point: query, distance_squared: f64::INFINITY };
        let mut stack = [0u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index as usize];
            if node.distance_squared(query) >= best.distance_squared {
                continue;
            }
            if node.count > 0 {
                self.search_leaf(node, query, &mut best);
                continue;
            }
            let (left, right) = (index + 1, node.first);
            let [dl, dr] = [left, right].map(|child| self.nodes[child as usize].distance_squared(query));
            // The nearer child on top.
            let [far, near] = if dl <= dr { [right, left] } else { [left, right] };
            stack[depth] = far;
            stack[depth + 1] = near;
            depth += 2;
        }
        best
    }

    fn search_leaf(&self, node: &Node, query: DVec3, best: &mut Nearest) {
        for i in node.first as usize..(node.first + node.count) as usize {
            let point = nearest_on_triangle(query, self.corners[i]);
            let distance_squared = point.distance_squared(query);
            if distance_squared < best.distance_squared {
                *best = Nearest { point, distance_squared };
            }
        }
    }

    /// Calls `visit` with every triangle (input numbering) whose box meets the given one.
    pub(crate) fn overlapping(&self, low: DVec3, high: DVec3, mut visit: impl FnMut(u32, [DVec3; 3])) {
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![0u32] };
        while let Some(index) = stack.pop() {
            let node = &self.nodes[index as usize];
            if node.low.cmpgt(high).any() || node.high.cmplt(low).any() {
                continue;
            }
            if node.count == 0 {
                stack.extend([node.first, index + 1]);
                continue;
            }
            for i in node.first as usize..(node.first + node.count) as usize {
                visit(self.original[i], self.corners[i]);
            }
        }
    }
}

impl Node {
    fn distance_squared(&self, p: DVec3) -> f64 {
        (self.low - p).max(p - self.high).max(DVec3::ZERO).length_squared()
    }
}

/// Builds the subtree over `order` (which starts at `offset` of the whole), halving along the longest side.
fn build(corners: &[[DVec3; 3]], order: &mut [u32], offset: usize, nodes: &mut Vec<Node>) {
    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    for &t in order.iter() {
        for p in corners[t as usize] {
            low = low.min(p);
            high = high.max(p);
        }
    }
    let index = nodes.len();
    nodes.push(Node { low, high, first: offset as u32, count: order.len() as u32 });
    if order.len() <= LEAF {
        return;
    }
    let size = high - low;
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
    let centre = |t: u32| corners[t as usize].iter().map(|p| p[axis]).sum::<f64>();
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |&a, &b| centre(a).total_cmp(&centre(b)).then(a.cmp(&b)));
    let (left, right) = order.split_at_mut(half);
    build(corners, left, offset, nodes);
    nodes[index].first = nodes.len() as u32;
    nodes[index].count = 0;
    build(corners, right, offset + half, nodes);
}

/// Nearest point of a triangle: by the regions of its plane (Ericson, Real-Time Collision Detection, 5.1.5).
pub(crate) fn nearest_on_triangle(p: DVec3, [a, b, c]: [DVec3; 3]) -> DVec3 {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 && d1 > d3 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 && d2 > d6 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    let (along, against) = (d4 - d3, d5 - d6);
    if va <= 0.0 && along >= 0.0 && against >= 0.0 && along + against > 0.0 {
        return b + (c - b) * (along / (along + against));
    }
    let sum = va + vb + vc;
    if sum > 0.0 { a + ab * (vb / sum) + ac * (vc / sum) } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        (-1.0..1.0, -1.0..1.0, -1.0..1.0).prop_map(|(x, y, z)| DVec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn tree_agrees_with_looking_at_every_triangle(
            points in prop::collection::vec(point(), 3..120), query in point()
        ) {
            let triangles: Vec<[u32; 3]> = (0..points.len() as u32 - 2).map(|i| [i, i + 1, i + 2]).collect();
            let all = triangles.iter().map(|t| nearest_on_triangle(query * 2.0, t.map(|v| points[v as usize])));
            let least = all.map(|p| p.distance_squared(query * 2.0)).fold(f64::INFINITY, f64::min);
            let found = SurfaceIndex::new(&points, &triangles).nearest(query * 2.0);
            prop_assert_eq!(found.distance_squared, least);
        }

        #[test]
        fn nearest_on_triangle_beats_samples(corners in [point(), point(), point()], query in point()) {
            let nearest = nearest_on_triangle(query, corners).distance(query);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let sample = corners[0] + (corners[1] - corners[0]) * u + (corners[2] - corners[0]) * v;
                    prop_assert!(nearest <= sample.distance(query) + 1e-12);
                }
            }
        }
    }
}
