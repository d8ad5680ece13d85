//! Closed surfaces.
use glam::DVec3;
use std::collections::BTreeMap;

/// A sphere of radius 1 about the origin: an icosahedron whose triangles are split in four `rounds` times. Vertices, and triangles that face outwards.
pub(crate) fn sphere(rounds: u32) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut points: Vec<DVec3> = Vec::new();
    for (a, b) in [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)] {
        points.extend([DVec3::new(0.0, a, b), DVec3::new(a, b, 0.0), DVec3::new(b, 0.0, a)]);
    }
    let mut triangles = Vec::new();
    for (i, j) in (0..12).flat_map(|i| (i + 1..12).map(move |j| (i, j))) {
        for k in j + 1..12 {
            let near = |a: usize, b: usize| (points[a].distance(points[b]) - 2.0).abs() < 1e-9;
            if near(i, j) && near(j, k) && near(k, i) {
                let [a, b, c] = [i, j, k].map(|n| points[n]);
                let outward = (b - a).cross(c - a).dot(a) > 0.0;
                triangles.push(if outward { [i, j, k] } else { [i, k, j] }.map(|n| n as u32));
            }
        }
    }
    for _ in 0..rounds {
        let mut middle: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        let mut split = Vec::new();
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [[a, b], [b, c], [c, a]].map(|[u, v]| {
                *middle.entry([u.min(v), u.max(v)]).or_insert_with(|| {
                    points.push((points[u as usize] + points[v as usize]) * 0.5);
                    points.len() as u32 - 1
                })
            });
            split.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = split;
    }
    (points.iter().map(|p| p.normalize()).collect(), triangles)
}
