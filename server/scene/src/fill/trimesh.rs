//! A triangulated surface that can change: half-edges by their ends, edge flips, Delaunay sweeps.
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};

/// Gain in the sum of opposite angles (rad) that a flip must bring; keeps regular quads from flipping for ever.
const FLIP_GAIN_RAD: f64 = 1e-6;
/// A flip must not turn a triangle's normal by more than about 60°.
const NORMAL_AGREEMENT: f64 = 0.5;

/// A manifold triangulation, counter-clockwise seen from outside.
#[derive(Debug, Clone, Default)]
pub(crate) struct TriMesh {
    /// Vertex positions (m).
    pub(crate) positions: Vec<DVec3>,
    /// Triangles as vertex indices.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Triangle on the left of every directed edge. Looked up only, never iterated: the order of work stays fixed.
    half_edges: HashMap<[u32; 2], u32>,
}

impl TriMesh {
    /// Takes an oriented manifold triangulation.
    pub(crate) fn new(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Self {
        let mut mesh = Self { positions, triangles, half_edges: HashMap::new() };
        mesh.index_edges();
        mesh
    }

    /// Rebuilds the half-edges after the triangles were changed.
    pub(crate) fn index_edges(&mut self) {
        self.half_edges.clear();
        self.half_edges.reserve(3 * self.triangles.len());
        for t in 0..self.triangles.len() {
            self.link(t as u32);
        }
    }

    fn link(&mut self, t: u32) {
        let [a, b, c] = self.triangles[t as usize];
        for edge in [[a, b], [b, c], [c, a]] {
            self.half_edges.insert(edge, t);
        }
    }

    /// Triangle on the left of `a → b`.
    pub(crate) fn left_of(&self, a: u32, b: u32) -> Option<u32> {
        self.half_edges.get(&[a, b]).copied()
    }

    /// The corner of triangle `t` that is neither `a` nor `b`.
    pub(crate) fn third(&self, t: u32, a: u32, b: u32) -> u32 {
        let [x, y, z] = self.triangles[t as usize];
        if x != a && x != b {
            x
        } else if y != a && y != b {
            y
        } else {
            z
        }
    }

    /// All edges, smaller end first, each once, in order of triangle and corner.
    pub(crate) fn edges(&self) -> Vec<[u32; 2]> {
        let mut edges = Vec::with_capacity(self.triangles.len() * 3 / 2);
        for &[a, b, c] in &self.triangles {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                if i < j || self.left_of(j, i).is_none() {
                    edges.push([i.min(j), i.max(j)]);
                }
            }
        }
        edges
    }

    /// Vertices on an edge that has only one triangle.
    pub(crate) fn on_boundary(&self) -> Vec<bool> {
        let mut on = vec![false; self.positions.len()];
        for &[a, b, c] in &self.triangles {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                if self.left_of(j, i).is_none() {
                    on[i as usize] = true;
                    on[j as usize] = true;
                }
            }
        }
        on
    }

    /// Twice the area times the unit normal of a triangle.
    pub(crate) fn area_vector(&self, [a, b, c]: [u32; 3]) -> DVec3 {
        let p = |v: u32| self.positions[v as usize];
        (p(b) - p(a)).cross(p(c) - p(a))
    }

    /// Area-weighted unit normals at the vertices.
    pub(crate) fn vertex_normals(&self) -> Vec<DVec3> {
        let mut normals = vec![DVec3::ZERO; self.positions.len()];
        for &triangle in &self.triangles {
            let area = self.area_vector(triangle);
            for v in triangle {
                normals[v as usize] += area;
            }
        }
        normals.into_iter().map(|n| n.normalize_or(DVec3::Z)).collect()
    }

    /// Area (m²).
    pub(crate) fn area(&self) -> f64 {
        Self::area_of(&self.positions, &self.triangles)
    }

    /// Area (m²) of triangles over positions.
    pub(crate) fn area_of(positions: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        let corners = triangles.iter().map(|t| t.map(|v| positions[v as usize]));
        corners.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
    }

    /// For every vertex on the boundary, the ones before and after it along the rim.
    pub(crate) fn rim_neighbours(&self) -> BTreeMap<u32, [u32; 2]> {
        let mut sides: BTreeMap<u32, [u32; 2]> = BTreeMap::new();
        for &[a, b, c] in &self.triangles {
            for [i, j] in [[a, b], [b, c], [c, a]] {
                if self.left_of(j, i).is_none() {
                    sides.entry(i).or_insert([i, i])[1] = j;
                    sides.entry(j).or_insert([j, j])[0] = i;
                }
            }
        }
        sides
    }

    /// Drops vertices that no triangle uses and rebuilds the half-edges.
    pub(crate) fn compact(&mut self) {
        let mut used = vec![false; self.positions.len()];
        self.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
        let mut new = Vec::with_capacity(used.len());
        let mut count = 0;
        for &is_used in &used {
            new.push(count);
            count += u32::from(is_used);
        }
        let mut is_used = used.iter();
        self.positions.retain(|_| is_used.next() == Some(&true));
        for triangle in &mut self.triangles {
            *triangle = triangle.map(|v| new[v as usize]);
        }
        self.index_edges();
    }

    fn angle_at(&self, at: u32, b: u32, c: u32) -> f64 {
        let p = |v: u32| self.positions[v as usize];
        (p(b) - p(at)).angle_between(p(c) - p(at))
    }

    /// Exchanges the edge `a–b` for the other diagonal of its two triangles.
    fn flip(&mut self, a: u32, b: u32) {
        let (Some(left), Some(right)) = (self.left_of(a, b), self.left_of(b, a)) else { return };
        let (c, d) = (self.third(left, a, b), self.third(right, a, b));
        self.half_edges.remove(&[a, b]);
        self.half_edges.remove(&[b, a]);
        self.triangles[left as usize] = [a, d, c];
        self.triangles[right as usize] = [d, b, c];
        self.link(left);
        self.link(right);
    }

    /// Whether flipping `a–b` brings the triangulation nearer to Delaunay without folding it.
    fn flip_pays(&self, a: u32, b: u32) -> bool {
        let (Some(left), Some(right)) = (self.left_of(a, b), self.left_of(b, a)) else { return false };
        let (c, d) = (self.third(left, a, b), self.third(right, a, b));
        if c == d || self.left_of(c, d).is_some() || self.left_of(d, c).is_some() {
            return false;
        }
        if self.angle_at(c, a, b) + self.angle_at(d, a, b) <= std::f64::consts::PI + FLIP_GAIN_RAD {
            return false;
        }
        let normal = (self.area_vector([a, b, c]) + self.area_vector([b, a, d])).normalize_or_zero();
        [[a, d, c], [d, b, c]].iter().all(|&t| {
            let area = self.area_vector(t);
            area.dot(normal) > NORMAL_AGREEMENT * area.length()
        })
    }

    /// Flips edges until the surface is Delaunay or `sweeps` are over; returns the number of flips.
    pub(crate) fn delaunay(&mut self, sweeps: usize) -> usize {
        let mut flips = 0;
        for _ in 0..sweeps {
            let before = flips;
            for [a, b] in self.edges() {
                if self.flip_pays(a, b) {
                    self.flip(a, b);
                    flips += 1;
                }
            }
            if flips == before {
                break;
            }
        }
        flips
    }

    /// For every vertex the area-weighted centroid of its triangles: one step of centroidal smoothing.
    pub(crate) fn centroids(&self) -> Vec<DVec3> {
        let mut sums = vec![(DVec3::ZERO, 0.0); self.positions.len()];
        for &triangle in &self.triangles {
            let area = self.area_vector(triangle).length();
            let centre = triangle.iter().map(|&v| self.positions[v as usize]).sum::<DVec3>() / 3.0;
            for v in triangle {
                sums[v as usize].0 += area * centre;
                sums[v as usize].1 += area;
            }
        }
        let centroid = |((sum, area), &position): ((DVec3, f64), &DVec3)| {
            if area > 0.0 { sum / area } else { position }
        };
        sums.into_iter().zip(&self.positions).map(centroid).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kite_flips_to_its_short_diagonal_and_stays() {
        let p = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(2.0, 1.0, 0.0), DVec3::new(2.0, -1.0, 0.0)];
        let mut mesh = TriMesh::new(p.to_vec(), vec![[0, 1, 2], [1, 0, 3]]);
        assert_eq!(mesh.delaunay(5), 1);
        assert_eq!(mesh.edges().len(), 5);
        assert!(mesh.left_of(2, 3).is_some() && mesh.left_of(0, 1).is_none());
        assert!(mesh.triangles.iter().all(|&t| mesh.area_vector(t).z > 0.0));
        assert_eq!(mesh.delaunay(5), 0);
    }
}
