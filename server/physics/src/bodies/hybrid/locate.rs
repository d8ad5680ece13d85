//! Finds the tet of a mesh that holds a point.
use crate::mesh::TetMesh;
use glam::{DMat3, DVec3};

/// A point that is farther than this (m) within a tet is in no other one, however the distances are rounded.
const SURELY_INSIDE_M: f64 = 1e-12;
/// Largest number of boxes along an axis.
const MOST_BOXES: usize = 64;

/// The tets of a mesh at rest, sorted into boxes.
#[derive(Debug, Clone)]
pub(super) struct Locator {
    tets: Vec<Frame>,
    low_m: DVec3,
    box_m: DVec3,
    boxes: [usize; 3],
    /// Index in `list` of the first entry of each box, and the end of the last.
    first: Vec<u32>,
    list: Vec<u32>,
}

/// What gives barycentric coordinates in a tet: `L_1..3 = inverse (p − corner)`, `L_0 = 1 − Σ`.
#[derive(Debug, Clone, Copy)]
struct Frame {
    corner_m: DVec3,
    inverse: DMat3,
    /// Height (m) of each corner above the face opposite to it.
    heights_m: [f64; 4],
}

impl Frame {
    fn barycentric(&self, point_m: DVec3) -> [f64; 4] {
        let l = self.inverse * (point_m - self.corner_m);
        [1.0 - l.x - l.y - l.z, l.x, l.y, l.z]
    }

    /// Returns the least distance (m) of a point from the tet's faces, positive inside.
    fn inside_m(&self, barycentric: &[f64; 4]) -> f64 {
        barycentric.iter().zip(self.heights_m).map(|(l, height)| l * height).fold(f64::INFINITY, f64::min)
    }
}

impl Locator {
    pub(super) fn new(mesh: &TetMesh) -> Self {
        let frame = |tet: usize| {
            let inverse_per_m = mesh.edge_matrix_m(tet).inverse();
            let rows = inverse_per_m.transpose();
            let gradients = [-(rows.x_axis + rows.y_axis + rows.z_axis), rows.x_axis, rows.y_axis, rows.z_axis];
            let corner_m = mesh.corners_m(tet)[0];
            Frame { corner_m, inverse: inverse_per_m, heights_m: gradients.map(|g| g.length().recip()) }
        };
        let count = mesh.tets().len();
        let (low_m, high_m) = mesh.bounds_m();
        let extent = |tet: usize| {
            let corners = mesh.corners_m(tet);
            let low = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
            let high = corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
            (low, high)
        };
        let mean_m: DVec3 = (0..count).map(|tet| extent(tet).1 - extent(tet).0).sum::<DVec3>() / count as f64;
        let boxes = ((high_m - low_m) / mean_m).to_array().map(|n| (n.ceil() as usize).clamp(1, MOST_BOXES));
        let box_m = (high_m - low_m) / DVec3::from(boxes.map(|n| n as f64));
        let mut locator =
            Self { tets: (0..count).map(frame).collect(), low_m, box_m, boxes, first: vec![], list: vec![] };
        let mut in_box = vec![Vec::new(); boxes.iter().product()];
        for tet in 0..count {
            // Half a tet of margin, so that a point outside finds its neighbours in its box.
            let (low, high) = extent(tet);
            let (from, to) = (locator.box_of(low - mean_m * 0.5), locator.box_of(high + mean_m * 0.5));
            for z in from[2]..=to[2] {
                for y in from[1]..=to[1] {
                    for x in from[0]..=to[0] {
                        in_box[(z * boxes[1] + y) * boxes[0] + x].push(tet as u32);
                    }
                }
            }
        }
        locator.first.push(0);
        for tets in in_box {
            locator.list.extend(tets);
            locator.first.push(locator.list.len() as u32);
        }
        locator
    }

    /// Returns the barycentric coordinates of a point in a tet.
    pub(super) fn barycentric(&self, tet: usize, point_m: DVec3) -> [f64; 4] {
        self.tets[tet].barycentric(point_m)
    }

    /// Returns the least distance (m) of a point, given by its barycentric coordinates, from the tet's faces, negative
    /// outside.
    pub(super) fn inside_m(&self, tet: usize, barycentric: &[f64; 4]) -> f64 {
        self.tets[tet].inside_m(barycentric)
    }

    /// Returns the tet that holds a point, or the one that the point is least far outside of, and the point's
    /// barycentric coordinates in it.
    pub(super) fn nearest(&self, point_m: DVec3) -> (usize, [f64; 4]) {
        let [x, y, z] = self.box_of(point_m);
        let at = (z * self.boxes[1] + y) * self.boxes[0] + x;
        let listed = &self.list[self.first[at] as usize..self.first[at + 1] as usize];
        if listed.is_empty() {
            self.best(point_m, 0..self.tets.len())
        } else {
            self.best(point_m, listed.iter().map(|&tet| tet as usize))
        }
    }

    fn best(&self, point_m: DVec3, tets: impl Iterator<Item = usize>) -> (usize, [f64; 4]) {
        let mut best = (0, [0.0; 4], f64::NEG_INFINITY);
        for tet in tets {
            let frame = &self.tets[tet];
            let barycentric = frame.barycentric(point_m);
            let inside_m = frame.inside_m(&barycentric);
            if inside_m > best.2 {
                best = (tet, barycentric, inside_m);
            }
            // Tets do not overlap: no other holds it as well.
            if inside_m > SURELY_INSIDE_M {
                break;
            }
        }
        (best.0, best.1)
    }

    fn box_of(&self, point_m: DVec3) -> [usize; 3] {
        let from = (point_m - self.low_m) / self.box_m;
        std::array::from_fn(|axis| (from[axis].max(0.0) as usize).min(self.boxes[axis] - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{Random, slab};

    #[test]
    fn boxes_find_what_looking_everywhere_finds() {
        let mesh = slab();
        let locator = Locator::new(&mesh);
        let mut random = Random(1);
        for _ in 0..2000 {
            let point = DVec3::new(0.04, 0.04, 0.02) + random.vector() * 0.045;
            let (found, barycentric) = locator.nearest(point);
            let (_, everywhere) = locator.best(point, 0..mesh.tets().len());
            let inside = |l: [f64; 4]| l.into_iter().fold(f64::INFINITY, f64::min) > -1e-12;
            assert_eq!(inside(barycentric), inside(everywhere), "{point}");
            let corners = mesh.corners_m(found);
            let back: DVec3 = corners.iter().zip(barycentric).map(|(c, l)| *c * l).sum();
            assert!((back - point).length() < 1e-15);
        }
    }
}
