//! Marching tetrahedra: the zero surface of a field on a lattice of voxels.
//!
//! Each voxel is cut into the six tetrahedra about its diagonal, whose faces meet those of the voxels beside it. Where the
//! field changes its sign along an edge there is a vertex; a tet with one corner apart has one triangle, one with two has
//! two. The surface is a manifold, closed but where it leaves the lattice. (Doi and Koide 1991.)
use glam::DVec3;
use std::collections::BTreeMap;

/// Part of an edge within which a vertex does not come to its ends, so that no triangle is degenerate.
const OFF_ENDS: f64 = 0.05;
/// The orders of axes in which a path goes from a voxel's lowest corner to its highest.
const PATHS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

/// A triangulated surface; triangles are counter-clockwise seen from where the field is positive.
#[derive(Debug, Clone, Default)]
pub(super) struct Isosurface {
    pub(super) vertices_m: Vec<DVec3>,
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A lattice of voxels with the values of a field at their corners.
#[derive(Debug, Clone)]
pub(super) struct Voxels {
    low_m: DVec3,
    size_m: DVec3,
    counts: [usize; 3],
    values: Vec<f64>,
}

impl Voxels {
    /// Samples a field, which is given a corner's place (m) and its number, on so many voxels between two corners (m).
    pub(super) fn new([low_m, high_m]: [DVec3; 2], voxels: [usize; 3], field: impl Fn(DVec3, usize) -> f64) -> Self {
        let counts = voxels.map(|count| count + 1);
        let size_m = (high_m - low_m) / DVec3::from(voxels.map(|count| count as f64));
        let mut lattice = Self { low_m, size_m, counts, values: Vec::new() };
        lattice.values = (0..counts.iter().product()).map(|corner| field(lattice.corner_m(corner), corner)).collect();
        lattice
    }

    fn corner_m(&self, corner: usize) -> DVec3 {
        let [nx, ny, _] = self.counts;
        let at = [corner % nx, corner / nx % ny, corner / (nx * ny)].map(|n| n as f64);
        self.low_m + self.size_m * DVec3::from(at)
    }

    /// Returns the zero surface.
    pub(super) fn zero_surface(&self) -> Isosurface {
        let [nx, ny, nz] = self.counts;
        let strides = [1, nx, nx * ny];
        let (mut surface, mut vertex_of_edge) = (Isosurface::default(), BTreeMap::new());
        for lowest in (0..nz - 1).flat_map(|k| (0..ny - 1).flat_map(move |j| (0..nx - 1).map(move |i| [i, j, k]))) {
            let lowest = lowest[0] + strides[1] * lowest[1] + strides[2] * lowest[2];
            for path in PATHS {
                let mut tet = [lowest; 4];
                for (step, axis) in path.into_iter().enumerate() {
                    tet[step + 1] = tet[step] + strides[axis];
                }
                self.march(tet, &mut surface, &mut vertex_of_edge);
            }
        }
        surface
    }

    /// Adds a tet's triangles.
    fn march(&self, tet: [usize; 4], surface: &mut Isosurface, vertex_of_edge: &mut BTreeMap<[usize; 2], u32>) {
        let is_inside = |corner: &usize| self.values[*corner] < 0.0;
        let (inside, outside): (Vec<usize>, Vec<usize>) = tet.into_iter().partition(is_inside);
        let mut vertex = |a: usize, b: usize| {
            *vertex_of_edge.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let [at_a, at_b] = [a, b].map(|corner| self.values[corner]);
                let part = (at_a / (at_a - at_b)).clamp(OFF_ENDS, 1.0 - OFF_ENDS);
                surface.vertices_m.push(self.corner_m(a).lerp(self.corner_m(b), part));
                surface.vertices_m.len() as u32 - 1
            })
        };
        let found = match (&inside[..], &outside[..]) {
            (&[a], &[b, c, d]) | (&[b, c, d], &[a]) => vec![[vertex(a, b), vertex(a, c), vertex(a, d)]],
            (&[a, b], &[c, d]) => {
                let around = [vertex(a, c), vertex(a, d), vertex(b, d), vertex(b, c)];
                vec![[around[0], around[1], around[2]], [around[0], around[2], around[3]]]
            }
            _ => return,
        };
        // Outwards is from the inside corners' middle to that of the others.
        let middle_m = |corners: &[usize]| -> DVec3 {
            corners.iter().map(|&corner| self.corner_m(corner)).sum::<DVec3>() / corners.len() as f64
        };
        let outwards = middle_m(&outside) - middle_m(&inside);
        for [a, b, c] in found {
            let [pa, pb, pc] = [a, b, c].map(|vertex| surface.vertices_m[vertex as usize]);
            let is_outwards = (pb - pa).cross(pc - pa).dot(outwards) > 0.0;
            surface.triangles.push(if is_outwards { [a, b, c] } else { [a, c, b] });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::{collections::BTreeMap, f64::consts::PI};

    /// How many triangles are at every edge, and in which senses they go along it.
    fn edges(surface: &Isosurface) -> BTreeMap<[u32; 2], Vec<bool>> {
        let mut edges = BTreeMap::<[u32; 2], Vec<bool>>::new();
        for &[a, b, c] in &surface.triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                edges.entry([from.min(to), from.max(to)]).or_default().push(from < to);
            }
        }
        edges
    }

    fn volume_m3(surface: &Isosurface) -> f64 {
        let corners = |triangle: &[u32; 3]| triangle.map(|vertex| surface.vertices_m[vertex as usize]);
        surface.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn a_sphere_is_closed_and_has_its_volume() {
        let errors = [12, 24].map(|count| {
            let bounds = [DVec3::splat(-1.3), DVec3::splat(1.25)];
            let sphere = Voxels::new(bounds, [count; 3], |p, _| p.length() - 1.0).zero_surface();
            assert!(edges(&sphere).values().all(|senses| senses.len() == 2 && senses[0] != senses[1]));
            // Euler's formula.
            let euler = sphere.vertices_m.len() + sphere.triangles.len() - edges(&sphere).len();
            assert_eq!(euler, 2);
            1.0 - volume_m3(&sphere) / (4.0 / 3.0 * PI)
        });
        assert!(errors[1] > 0.0 && errors[0] / errors[1] > 3.0 && errors[1] < 0.01, "{errors:?}");
    }

    /// Cut by the lattice's upper face it has one rim there.
    #[test]
    fn what_leaves_the_lattice_has_a_rim_on_its_face() {
        let bounds = [DVec3::new(-1.3, -1.3, -1.3), DVec3::new(1.3, 1.3, 0.2)];
        let cup = Voxels::new(bounds, [20, 20, 12], |p, _| p.length() - 1.0).zero_surface();
        let edges = edges(&cup);
        let rim: Vec<_> = edges.iter().filter(|(_, senses)| senses.len() == 1).map(|(edge, _)| edge).collect();
        assert!(rim.len() > 20 && edges.values().all(|senses| senses.len() <= 2));
        let on_face = |vertex: &u32| (cup.vertices_m[*vertex as usize].z - 0.2).abs() < 1e-12;
        assert!(rim.iter().flat_map(|edge| edge.iter()).all(on_face));
        assert_eq!(cup.vertices_m.len() + cup.triangles.len() - edges.len(), 1);
    }
}
