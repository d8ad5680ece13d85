//! How two surfaces lie to each other: crossing, inside, apart.
use super::bvh::SurfaceIndex;
use super::trimesh::TriMesh;
use glam::DVec3;
use std::f64::consts::PI;

/// A place where two surfaces cross, and how many pairs of triangles do.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    pub(crate) at_m: DVec3,
    pub(crate) pairs: usize,
}

/// Looks for triangles of one surface that cut triangles of the other.
pub(crate) fn crossing(a: &TriMesh, b: &TriMesh, index_b: &SurfaceIndex) -> Option<Crossing> {
    let mut found: Option<Crossing> = None;
    for triangle in &a.triangles {
        let corners = triangle.map(|v| a.positions[v as usize]);
        let low = corners[0].min(corners[1]).min(corners[2]);
        let high = corners[0].max(corners[1]).max(corners[2]);
        index_b.overlapping(low, high, |other, _| {
            let other = b.triangles[other as usize].map(|v| b.positions[v as usize]);
            if let Some(at_m) = triangles_cross(corners, other) {
                let pairs = found.map_or(0, |c| c.pairs) + 1;
                found = Some(Crossing { at_m: found.map_or(at_m, |c| c.at_m), pairs });
            }
        });
    }
    found
}

/// Two triangles cross when an edge of one pierces the other.
fn triangles_cross(a: [DVec3; 3], b: [DVec3; 3]) -> Option<DVec3> {
    let edges = |t: [DVec3; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    edges(a).iter().find_map(|&e| pierces(e, b)).or_else(|| edges(b).iter().find_map(|&e| pierces(e, a)))
}

/// Where a segment goes through a triangle (signs of volumes).
fn pierces([p, q]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    let normal = (b - a).cross(c - a);
    let (above, below) = (normal.dot(p - a), normal.dot(q - a));
    if above * below > 0.0 || above == below {
        return None;
    }
    let hit = p + (q - p) * (above / (above - below));
    let inside = [[a, b], [b, c], [c, a]].iter().all(|&[u, v]| (v - u).cross(hit - u).dot(normal) >= 0.0);
    inside.then_some(hit)
}

/// Winding number of a closed oriented surface at a point: 1 inside, 0 outside, in between near gaps.
/// Solid angle of a triangle after van Oosterom and Strackee: tan(Ω/2) = a·(b×c)/(abc + (a·b)c + (b·c)a + (c·a)b).
pub(crate) fn winding_number(triangles: impl Iterator<Item = [DVec3; 3]>, at: DVec3) -> f64 {
    let solid_angle = |corners: [DVec3; 3]| {
        let [a, b, c] = corners.map(|p| p - at);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        2.0 * a.dot(b.cross(c)).atan2(below)
    };
    triangles.map(solid_angle).sum::<f64>() / (4.0 * PI)
}

/// Volume (m³) enclosed by the surface and the cone from its rim to `apex`: Σ (a−o)·((b−o)×(c−o))/6.
pub(crate) fn enclosed_volume(mesh: &TriMesh, rim: &[u32], apex: DVec3) -> f64 {
    closed_triangles(mesh, rim, apex).map(|[a, b, c]| (a - apex).dot((b - apex).cross(c - apex)) / 6.0).sum()
}

/// The surface's triangles and those that close its rim (in the direction of the surface's edges) with a point.
pub(crate) fn closed_triangles<'a>(
    mesh: &'a TriMesh,
    rim: &'a [u32],
    apex: DVec3,
) -> impl Iterator<Item = [DVec3; 3]> + 'a {
    let position = |v: u32| mesh.positions[v as usize];
    let next = |i: usize| rim[(i + 1) % rim.len()];
    let cap = (0..rim.len()).map(move |i| [position(next(i)), position(rim[i]), apex]);
    mesh.triangles.iter().map(move |t| t.map(position)).chain(cap)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriMesh {
        let p = vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        TriMesh::new(p, vec![[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])
    }

    #[test]
    fn winding_and_volume_of_a_tetrahedron_whole_and_with_a_face_replaced_by_a_cap() {
        let whole = tetrahedron();
        let inside = DVec3::splat(0.1);
        assert!((winding_number(closed_triangles(&whole, &[], DVec3::ZERO), inside) - 1.0).abs() < 1e-12);
        assert!(winding_number(closed_triangles(&whole, &[], DVec3::ZERO), DVec3::ONE).abs() < 1e-12);
        assert!((enclosed_volume(&whole, &[], DVec3::splat(5.0)) - 1.0 / 6.0).abs() < 1e-12);
        let open = TriMesh::new(whole.positions.clone(), whole.triangles[..3].to_vec());
        // The missing face 0 2 1 leaves the surface's half-edges 0→1, 1→2, 2→0.
        let rim = [0, 1, 2];
        let centre = DVec3::new(0.3, 0.3, 0.0);
        assert!((winding_number(closed_triangles(&open, &rim, centre), inside) - 1.0).abs() < 1e-12);
        assert!((enclosed_volume(&open, &rim, centre) - 1.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn crossing_is_found_where_it_is() {
        let a = tetrahedron();
        let moved = |by: DVec3| TriMesh::new(a.positions.iter().map(|p| *p + by).collect(), a.triangles.clone());
        let near = moved(DVec3::splat(0.2));
        let hit = crossing(&a, &near, &SurfaceIndex::new(&near.positions, &near.triangles)).unwrap();
        assert!(hit.at_m.cmpge(DVec3::ZERO).all() && hit.at_m.element_sum() <= 1.0 + 1e-12, "{hit:?}");
        let far = moved(DVec3::splat(2.0));
        assert_eq!(crossing(&a, &far, &SurfaceIndex::new(&far.positions, &far.triangles)), None);
    }
}
