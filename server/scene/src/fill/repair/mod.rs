//! From the triangles of a file to a clean surface: one oriented manifold, closed or with one rim.
mod alone;
mod holes;
mod manifold;
mod weld;

pub(crate) use alone::{Mended, mend};

use super::error::FillError;
use super::trimesh::TriMesh;
use crate::places::same_place;
use crate::wording::counted;
use glam::DVec3;
use std::fmt;

/// A hole counts as a defect when its area is below this part of the surface's; a base rim has more.
const LARGEST_HOLE: f64 = 0.03;
/// A separate part is dropped as debris when its area is below this part of the whole.
const LARGEST_DEBRIS: f64 = 0.05;

/// What was repaired in a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Points merged because they coincide.
    pub welded_points: usize,
    /// Points on gaps and seams merged with their neighbours across.
    pub joined_gap_points: usize,
    /// Triangles without area, dropped.
    pub degenerate_triangles: usize,
    /// Triangles present twice, dropped.
    pub duplicate_triangles: usize,
    /// Triangles on edges of more than two, dropped.
    pub non_manifold_triangles: usize,
    /// Triangles turned round to agree with the rest.
    pub turned_triangles: usize,
    /// Small separate parts, dropped.
    pub dropped_parts: usize,
    /// Holes closed.
    pub filled_holes: usize,
}

impl fmt::Display for Repairs {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counts = [
            (self.welded_points, "point", "welded"),
            (self.joined_gap_points, "gap point", "joined"),
            (self.degenerate_triangles, "degenerate triangle", "dropped"),
            (self.duplicate_triangles, "duplicate triangle", "dropped"),
            (self.non_manifold_triangles, "non-manifold triangle", "dropped"),
            (self.turned_triangles, "triangle", "turned"),
            (self.dropped_parts, "small part", "dropped"),
            (self.filled_holes, "hole", "filled"),
        ];
        let told = |&(count, what, done): &(usize, &str, &str)| format!("{} {done}", counted(count, what));
        let done: Vec<String> = counts.iter().filter(|(count, ..)| *count > 0).map(told).collect();
        if done.is_empty() { out.write_str("nothing to repair") } else { out.write_str(&done.join(", ")) }
    }
}

/// An oriented manifold, normals outwards.
pub(crate) struct CleanSurface {
    pub(crate) mesh: TriMesh,
    /// The open rim in the direction of the surface's edges; empty when closed.
    pub(crate) rim: Vec<u32>,
    pub(crate) repairs: Repairs,
}

/// Cleans a surface (m); `which` names it in errors.
pub(crate) fn clean(which: &'static str, points: &[DVec3], triangles: &[[u32; 3]]) -> Result<CleanSurface, FillError> {
    let mut repairs = Repairs::default();
    if triangles.is_empty() {
        return Err(FillError::Empty { which });
    }
    if let Some(vertex) = points.iter().position(|p| !p.is_finite()) {
        return Err(FillError::NonFinite { which, vertex });
    }
    if let Some(&vertex) = triangles.iter().flatten().find(|&&v| v as usize >= points.len()) {
        return Err(FillError::IndexOutOfRange { which, vertex, vertices: points.len() });
    }
    let mut soup = weld::weld(points, triangles, same_place(points), |_| true, &mut repairs);
    if soup.triangles.is_empty() {
        return Err(FillError::Empty { which });
    }
    weld::join_gaps(&mut soup, &mut repairs);
    manifold::drop_extra_triangles(&mut soup, &mut repairs);
    manifold::orient(which, &mut soup, &mut repairs)?;
    manifold::keep_largest_part(which, &mut soup, LARGEST_DEBRIS, &mut repairs)?;
    manifold::split_pinched_vertices(&mut soup);
    let mut mesh = TriMesh::new(soup.points, soup.triangles);
    let rim = holes::close_all_but_rim(which, &mut mesh, LARGEST_HOLE, &mut repairs)?;
    let (mesh, rim) = manifold::outwards(mesh, rim);
    Ok(CleanSurface { mesh, rim, repairs })
}

/// Triangles over points, not yet a manifold.
#[derive(Clone)]
struct Soup {
    points: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
}

impl Soup {
    fn area(&self, [a, b, c]: [u32; 3]) -> f64 {
        let p = |v: u32| self.points[v as usize];
        0.5 * (p(b) - p(a)).cross(p(c) - p(a)).length()
    }

    /// Renumbers the points by `map` (target of each point), drops what collapses, repeats and is not used.
    fn renumber(&mut self, map: &[u32], repairs: &mut Repairs) {
        let mut seen = std::collections::HashSet::with_capacity(self.triangles.len());
        let mut kept = Vec::with_capacity(self.triangles.len());
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| map[v as usize]);
            let mut key = [a, b, c];
            key.sort_unstable();
            if a == b || b == c || c == a {
                repairs.degenerate_triangles += 1;
            } else if seen.insert(key) {
                kept.push([a, b, c]);
            } else {
                repairs.duplicate_triangles += 1;
            }
        }
        self.triangles = kept;
        self.compact();
    }

    fn compact(&mut self) {
        let mut new = vec![u32::MAX; self.points.len()];
        let mut points = Vec::with_capacity(self.points.len());
        for triangle in &mut self.triangles {
            for v in triangle {
                if new[*v as usize] == u32::MAX {
                    new[*v as usize] = points.len() as u32;
                    points.push(self.points[*v as usize]);
                }
                *v = new[*v as usize];
            }
        }
        self.points = points;
    }
}

/// Triangles at every edge (smaller end first), in a fixed order.
fn edges_of(triangles: &[[u32; 3]]) -> std::collections::BTreeMap<[u32; 2], Vec<u32>> {
    let mut edges: std::collections::BTreeMap<[u32; 2], Vec<u32>> = std::collections::BTreeMap::new();
    for (t, &[a, b, c]) in triangles.iter().enumerate() {
        for [i, j] in [[a, b], [b, c], [c, a]] {
            edges.entry([i.min(j), i.max(j)]).or_default().push(t as u32);
        }
    }
    edges
}
