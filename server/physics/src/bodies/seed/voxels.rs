//! A box of cubic voxels, and the voxels that a closed surface encloses.
use glam::DVec3;

/// Stands for no voxel, particle or slot.
pub const NONE: u32 = u32::MAX;

/// A box of voxels with centres at `origin + (i + ½, j + ½, k + ½) spacing`, numbered with x fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Voxels {
    /// Lowest corner (m).
    pub origin_m: DVec3,
    /// Edge of a voxel (m).
    pub spacing_m: f64,
    /// Number of voxels along each axis.
    pub size: [usize; 3],
}

impl Voxels {
    /// Returns voxels that cover the box from `low_m` to `high_m` (m), and `margin` more on every side.
    pub fn covering(low_m: DVec3, high_m: DVec3, spacing_m: f64, margin: usize) -> Self {
        let across = ((high_m - low_m) / spacing_m).ceil().max(DVec3::ONE).to_array();
        Self {
            origin_m: low_m - DVec3::splat(margin as f64 * spacing_m),
            spacing_m,
            size: across.map(|n| n as usize + 2 * margin),
        }
    }

    /// Returns the number of voxels.
    pub fn count(&self) -> usize {
        self.size.iter().product()
    }

    /// Returns the number of the voxel at a place.
    pub fn number(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.size[1] + j) * self.size[0] + i
    }

    /// Returns the place of a voxel, in voxels from the lowest one along each axis.
    pub fn place(&self, number: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [number % nx, number / nx % ny, number / (nx * ny)]
    }

    /// Returns the centre (m) of a voxel.
    pub fn centre_m(&self, number: usize) -> DVec3 {
        let place = self.place(number).map(|n| n as f64 + 0.5);
        self.origin_m + DVec3::from(place) * self.spacing_m
    }

    /// Returns the voxel that holds a point (m), or `None` outside the box.
    pub fn holding(&self, point_m: DVec3) -> Option<usize> {
        let at = (point_m - self.origin_m) / self.spacing_m;
        let size = DVec3::from(self.size.map(|n| n as f64));
        let inside = at.cmpge(DVec3::ZERO).all() && at.cmplt(size).all();
        inside.then(|| self.number(at.to_array().map(|a| a as usize)))
    }

    /// Returns the voxel that holds a point (m) or is nearest to it.
    pub fn nearest(&self, point_m: DVec3) -> usize {
        let at = ((point_m - self.origin_m) / self.spacing_m).to_array();
        // NaN becomes 0.
        self.number(std::array::from_fn(|axis| (at[axis] as usize).min(self.size[axis] - 1)))
    }

    /// Returns the box of voxels from `low` to `high`, both included.
    #[must_use]
    pub fn part(&self, low: [usize; 3], high: [usize; 3]) -> Self {
        Self {
            origin_m: self.origin_m + DVec3::from(low.map(|n| n as f64)) * self.spacing_m,
            spacing_m: self.spacing_m,
            size: std::array::from_fn(|axis| high[axis] - low[axis] + 1),
        }
    }

    /// Returns the numbers of the up to six voxels that share a face with a voxel.
    pub fn beside(&self, number: usize) -> impl Iterator<Item = usize> {
        let (place, me) = (self.place(number), *self);
        (0..6).filter_map(move |side| {
            let axis = side / 2;
            let mut at = place;
            at[axis] = if side % 2 == 0 { at[axis].checked_sub(1)? } else { at[axis] + 1 };
            (at[axis] < me.size[axis]).then(|| me.number(at))
        })
    }

    /// Returns for every voxel whether a closed surface encloses its centre.
    ///
    /// Along every column of voxels, the winding number is `n(z) = Σ sign(t)` over the triangles t that the column
    /// meets above z. Where a column meets an edge or a corner, ties are broken by the edge's direction, so that it
    /// meets exactly one of the triangles there.
    pub fn enclosed(&self, positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Vec<bool> {
        let [nx, ny, nz] = self.size;
        // turns[column][k] is the change of the winding number from voxel k − 1 to k.
        let mut turns = vec![0_i32; nx * ny * (nz + 1)];
        for &triangle in triangles {
            let corners = triangle.map(|n| positions_m[n as usize]);
            let local = corners.map(|p| (p - self.origin_m) / self.spacing_m - DVec3::splat(0.5));
            let (low, high) = local.iter().fold((local[0], local[0]), |(low, high), &p| (low.min(p), high.max(p)));
            let columns = |axis: usize, n: usize| {
                (low[axis].ceil().max(0.0) as usize)..((high[axis].floor() + 1.0).max(0.0) as usize).min(n)
            };
            for j in columns(1, ny) {
                for i in columns(0, nx) {
                    let Some((sign, z)) = crossing(triangle, local, i as f64, j as f64) else { continue };
                    let above = (z.ceil().max(0.0) as usize).min(nz);
                    turns[(j * nx + i) * (nz + 1) + above] += sign;
                }
            }
        }
        let mut inside = vec![false; self.count()];
        for column in 0..nx * ny {
            let mut winding = 0;
            for k in 0..nz {
                winding += turns[column * (nz + 1) + k];
                inside[k * nx * ny + column] = winding != 0;
            }
        }
        inside
    }
}

/// Returns the change of the winding number on the way up where the vertical line through (x, y) meets a triangle, and
/// the height z there.
fn crossing(nodes: [u32; 3], p: [DVec3; 3], x: f64, y: f64) -> Option<(i32, f64)> {
    // Twice the area of (p_a, p_b, (x, y)), which is the same number from both sides of an edge, except for its sign.
    let area = |a: usize, b: usize| {
        let (from, to, sign) = if nodes[a] < nodes[b] { (p[a], p[b], 1.0) } else { (p[b], p[a], -1.0) };
        sign * ((to.x - from.x) * (y - from.y) - (to.y - from.y) * (x - from.x))
    };
    let areas = [area(1, 2), area(2, 0), area(0, 1)];
    let total: f64 = areas.iter().sum();
    let turn = if total > 0.0 { 1.0 } else { -1.0 };
    // A point on an edge belongs to the triangle that has the edge on its left or bottom.
    let owns = |a: usize, b: usize| {
        let along = (p[b] - p[a]) * turn;
        along.y < 0.0 || (along.y == 0.0 && along.x > 0.0)
    };
    let on_side = |side: usize| {
        let towards = areas[side] * turn;
        towards > 0.0 || (towards == 0.0 && owns((side + 1) % 3, (side + 2) % 3))
    };
    let meets = total != 0.0 && (0..3).all(on_side);
    let z = (areas[0] * p[0].z + areas[1] * p[1].z + areas[2] * p[2].z) / total;
    meets.then_some((-(turn as i32), z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bodies::seed::testing::sphere, contact::is_inside};

    #[test]
    fn columns_enclose_what_the_winding_number_says() {
        let (positions, triangles) = sphere(DVec3::new(0.9, 0.7, 1.1), 2);
        let voxels = Voxels::covering(DVec3::splat(-1.2), DVec3::splat(1.2), 0.13, 1);
        let inside = voxels.enclosed(&positions, &triangles);
        let said: Vec<bool> =
            (0..voxels.count()).map(|n| is_inside(voxels.centre_m(n), &triangles, &positions)).collect();
        assert_eq!(inside, said);
        assert!(inside.iter().filter(|&&i| i).count() > 1000);
    }

    #[test]
    fn columns_through_edges_and_corners_meet_a_surface_once() {
        // An octahedron with corners on the columns, and edges in their planes.
        let p = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z].map(|p| p * 2.0);
        let faces = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        let voxels = Voxels::covering(DVec3::splat(-2.5), DVec3::splat(2.5), 0.5, 0);
        for (number, inside) in voxels.enclosed(&p, &faces).into_iter().enumerate() {
            let reach = voxels.centre_m(number).abs().element_sum();
            assert!(inside == (reach < 2.0) || reach == 2.0, "{}", voxels.centre_m(number));
        }
    }

    #[test]
    fn numbers_places_and_parts_agree() {
        let voxels = Voxels::covering(DVec3::ZERO, DVec3::new(0.3, 0.2, 0.4), 0.1, 2);
        for number in 0..voxels.count() {
            assert_eq!(voxels.number(voxels.place(number)), number);
            assert_eq!(voxels.holding(voxels.centre_m(number)), Some(number));
        }
        assert_eq!(voxels.holding(DVec3::splat(-1.0)), None);
        assert_eq!(voxels.holding(DVec3::NAN), None);
        assert_eq!(voxels.place(voxels.nearest(DVec3::new(-9.0, 0.15, 9.0))), [0, 3, 7]);
        let part = voxels.part([1, 2, 3], [3, 3, 3]);
        assert!((part.centre_m(0) - voxels.centre_m(voxels.number([1, 2, 3]))).length() < 1e-15);
        assert_eq!((part.size, part.beside(0).count()), ([3, 2, 1], 2));
    }
}
