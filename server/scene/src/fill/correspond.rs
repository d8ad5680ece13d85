//! Where each vertex of the outer triangulation lies on the inner surface.
//!
//! Every vertex follows the wall's thickness: down the gradient of d_in/(d_in + d_out), d the distances to the two
//! surfaces. These paths do not cross in a smooth wall. The tangential part of the displacement (the shear) is then
//! smoothed over a length of the order of the wall's thickness, so that bumps do not gather vertices and the straight
//! rim-to-rim lines of the base pass gradually into the paths across the wall.
use super::remesh::Target;
use super::trimesh::TriMesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// Steps through the wall.
const STEPS: usize = 8;
/// Smoothing length over wall thickness.
const SMOOTHING_LENGTH: f64 = 1.5;
/// Bounds of the number of smoothing passes.
const PASSES: (f64, f64) = (3.0, 80.0);
/// Smoothing passes along the rim: rims are short.
const RIM_PASSES: usize = 20;

/// Positions on the inner surface, one for every vertex of `mesh`.
pub(crate) fn onto_inner(mesh: &TriMesh, inner: &Target, outer: &Target, thickness_m: f64) -> Vec<DVec3> {
    let normals = mesh.vertex_normals();
    let rim = mesh.rim_neighbours();
    let mut on_inner: Vec<DVec3> = (0..mesh.positions.len())
        .map(|v| {
            let on_rim = rim.contains_key(&(v as u32));
            let start = mesh.positions[v];
            if on_rim { inner.rim.nearest(start).point } else { across(start, normals[v], inner, outer) }
        })
        .collect();
    smooth_rim(mesh, &rim, inner, &mut on_inner);
    smooth_shear(mesh, &normals, &rim, inner, thickness_m, &mut on_inner);
    on_inner
}

/// Follows the path across the wall from a point of the outer surface.
fn across(start: DVec3, normal: DVec3, inner: &Target, outer: &Target) -> DVec3 {
    let mut p = start;
    for step in 0..STEPS {
        let to_inner = inner.surface.nearest(p);
        let d_in = to_inner.distance_squared.sqrt();
        let d_out = if step == 0 { 0.0 } else { outer.surface.nearest(p).point.distance(p) };
        // ∇d of each surface: away from its nearest point; on the outer surface itself, along the inward normal.
        let away_from_inner = (p - to_inner.point).normalize_or(normal);
        let away_from_outer =
            if d_out > 0.0 { (p - outer.surface.nearest(p).point).normalize_or(-normal) } else { -normal };
        // −∇(d_in/(d_in + d_out)) ∝ d_in ∇d_out − d_out ∇d_in
        let down = (d_in * away_from_outer - d_out * away_from_inner).normalize_or(-away_from_inner);
        p += down * (d_in / (STEPS - step) as f64);
    }
    inner.surface.nearest(p).point
}

/// Evens out the displacement along the rim.
fn smooth_rim(mesh: &TriMesh, rim: &BTreeMap<u32, [u32; 2]>, inner: &Target, on_inner: &mut [DVec3]) {
    for _ in 0..RIM_PASSES {
        let shift = |v: u32| on_inner[v as usize] - mesh.positions[v as usize];
        let smoothed: Vec<(u32, DVec3)> = rim
            .iter()
            .map(|(&v, &[before, after])| (v, 0.5 * shift(v) + 0.25 * (shift(before) + shift(after))))
            .collect();
        for (v, shift) in smoothed {
            on_inner[v as usize] = inner.rim.nearest(mesh.positions[v as usize] + shift).point;
        }
    }
}

/// Diffuses the tangential part of the displacement; the part along the normal and the rim stay.
fn smooth_shear(
    mesh: &TriMesh,
    normals: &[DVec3],
    rim: &BTreeMap<u32, [u32; 2]>,
    inner: &Target,
    thickness_m: f64,
    on_inner: &mut [DVec3],
) {
    let edges = mesh.edges();
    let mean_edge =
        edges.iter().map(|&[a, b]| mesh.positions[a as usize].distance(mesh.positions[b as usize])).sum::<f64>()
            / edges.len().max(1) as f64;
    let passes = (SMOOTHING_LENGTH * thickness_m / mean_edge).powi(2).clamp(PASSES.0, PASSES.1) as usize;
    for _ in 0..passes {
        let shift: Vec<DVec3> = on_inner.iter().zip(&mesh.positions).map(|(y, x)| *y - *x).collect();
        let shear: Vec<DVec3> = shift.iter().zip(normals).map(|(d, n)| d.reject_from_normalized(*n)).collect();
        let mut sums = vec![(DVec3::ZERO, 0.0); shift.len()];
        for &[a, b] in &edges {
            for (to, from) in [(a as usize, b as usize), (b as usize, a as usize)] {
                sums[to].0 += shear[from];
                sums[to].1 += 1.0;
            }
        }
        for v in 0..shift.len() {
            if rim.contains_key(&(v as u32)) {
                continue;
            }
            let mean = (sums[v].0 / sums[v].1).reject_from_normalized(normals[v]);
            let smoothed = shift[v].project_onto_normalized(normals[v]) + 0.5 * (shear[v] + mean);
            on_inner[v] = inner.surface.nearest(mesh.positions[v] + smoothed).point;
        }
    }
}
