//! A tool's axis: the points from which its surface is one radius away. A sphere's is its centre, a capsule's a
//! segment.
use super::triangle::{closest_point, closest_weights};
use glam::DVec3;

/// Number of pieces of an axis that bounds look at one by one.
const PIECES: usize = 8;

/// A segment `centre ± half`, or a point where `half` is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Axis {
    /// Its middle (m).
    pub(super) centre_m: DVec3,
    /// Vector (m) from the middle to one of its ends.
    pub(super) half_m: DVec3,
}

/// The points of an axis and of a triangle that are nearest to each other.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Approach {
    /// Vector (m) from the centre to the point of the axis.
    pub(super) arm_m: DVec3,
    /// Vector (m) from that point to the triangle's.
    pub(super) to_triangle_m: DVec3,
    /// Weights of the triangle's corners at its point.
    pub(super) weights: [f64; 3],
}

impl Axis {
    /// Makes an axis that is a point.
    pub(super) fn point(centre_m: DVec3) -> Self {
        Self { centre_m, half_m: DVec3::ZERO }
    }

    pub(super) fn is_point(&self) -> bool {
        self.half_m == DVec3::ZERO
    }

    /// Returns half its length (m).
    pub(super) fn half_length_m(&self) -> f64 {
        self.half_m.length()
    }

    /// Returns the vector (m) from the centre to the point of the axis that is nearest to `p`, which is given from the
    /// centre, too: `c(p) = s h`, `s = p·h/h²` limited to −1 to 1.
    pub(super) fn nearest_m(&self, from_centre_m: DVec3) -> DVec3 {
        self.half_m * (from_centre_m.dot(self.half_m) / self.half_m.length_squared()).clamp(-1.0, 1.0)
    }

    /// Returns a lower bound (m) of the distance of something from the axis, made of such a bound from any point: that
    /// from its centre less half its length `L`, or, where that is below `wanted_m`, the least from the middles of its
    /// pieces less half the length of a piece.
    /// ```text
    /// max(d(c) − L, min_i d(c + ((2i + 1)/n − 1) h) − L/n)
    /// ```
    pub(super) fn distance_bound_m(&self, wanted_m: f64, from_point_m: impl Fn(DVec3) -> f64) -> f64 {
        let half_length_m = self.half_length_m();
        let of_whole_m = from_point_m(self.centre_m) - half_length_m;
        if self.is_point() || of_whole_m >= wanted_m {
            return of_whole_m;
        }
        let count = PIECES as f64;
        let middles_m = (0..PIECES).map(|i| self.centre_m + self.half_m * ((2 * i + 1) as f64 / count - 1.0));
        let nearest_m = middles_m.map(from_point_m).fold(f64::INFINITY, f64::min);
        of_whole_m.max(nearest_m - half_length_m / count)
    }

    /// Returns its distance (m) from a triangle.
    pub(super) fn distance_m(&self, corners: [DVec3; 3]) -> f64 {
        if self.is_point() {
            return self.centre_m.distance(closest_point(self.centre_m, corners));
        }
        self.approach(corners).to_triangle_m.length()
    }

    /// Returns the vectors (m) from the centres of two axes to the points of them that are nearest to each other.
    pub(super) fn nearest_of(one: &Self, other: &Self) -> [DVec3; 2] {
        let start = |axis: &Self| axis.centre_m - axis.half_m;
        let (s, t) = nearest_of_segments(start(one), one.half_m * 2.0, start(other), other.half_m * 2.0);
        [one.half_m * (2.0 * s - 1.0), other.half_m * (2.0 * t - 1.0)]
    }

    /// Finds where a triangle is nearest to it. A segment that does not cross the triangle is nearest to it at one of
    /// its ends, or at one of the triangle's edges.
    pub(super) fn approach(&self, corners: [DVec3; 3]) -> Approach {
        let from_point = |arm_m: DVec3| {
            let p = self.centre_m + arm_m;
            let weights = closest_weights(p, corners);
            let to_triangle_m = corners[0] * weights[0] + corners[1] * weights[1] + corners[2] * weights[2] - p;
            Approach { arm_m, to_triangle_m, weights }
        };
        if self.is_point() {
            return from_point(DVec3::ZERO);
        }
        if let Some(crossing) = self.crossing(corners) {
            return crossing;
        }
        let mut best = from_point(self.half_m);
        let mut take = |other: Approach| {
            if other.to_triangle_m.length_squared() < best.to_triangle_m.length_squared() {
                best = other;
            }
        };
        take(from_point(-self.half_m));
        for (i, j) in [(0, 1), (1, 2), (2, 0)] {
            let (s, t) = nearest_of_segments(
                self.centre_m - self.half_m,
                self.half_m * 2.0,
                corners[i],
                corners[j] - corners[i],
            );
            let arm_m = self.half_m * (2.0 * s - 1.0);
            let mut weights = [0.0; 3];
            (weights[i], weights[j]) = (1.0 - t, t);
            let to_triangle_m = corners[i] + (corners[j] - corners[i]) * t - self.centre_m - arm_m;
            take(Approach { arm_m, to_triangle_m, weights });
        }
        best
    }

    /// Finds where the axis crosses a triangle: `c + s h = a + v (b − a) + w (c − a)`.
    fn crossing(&self, [a, b, c]: [DVec3; 3]) -> Option<Approach> {
        let (ab, ac) = (b - a, c - a);
        let normal = ab.cross(ac);
        let rate = normal.dot(self.half_m);
        let s = normal.dot(a - self.centre_m) / rate;
        if s.is_nan() || s.abs() > 1.0 {
            return None;
        }
        let at = self.centre_m + self.half_m * s - a;
        let area_sq = normal.length_squared();
        let (v, w) = (at.cross(ac).dot(normal) / area_sq, ab.cross(at).dot(normal) / area_sq);
        (v >= 0.0 && w >= 0.0 && v + w <= 1.0).then(|| Approach {
            arm_m: self.half_m * s,
            to_triangle_m: DVec3::ZERO,
            weights: [1.0 - v - w, v, w],
        })
    }
}

/// Returns `s` and `t` in 0..=1 at which `p + s d` and `q + t e` are nearest (Ericson, Real-time collision detection,
/// 5.1.9); for parallel segments it is one of the nearest pairs. A segment without length is a point.
fn nearest_of_segments(p: DVec3, d: DVec3, q: DVec3, e: DVec3) -> (f64, f64) {
    let r = p - q;
    let (dd, ee, de, dr, er) = (d.length_squared(), e.length_squared(), d.dot(e), d.dot(r), e.dot(r));
    let over = |a: f64, b: f64| if b > 0.0 { (a / b).clamp(0.0, 1.0) } else { 0.0 };
    // s = (de er − dr ee)/(dd ee − de²), then t = (de s + er)/ee, and where that leaves the segment s again
    let s = over(de * er - dr * ee, dd * ee - de * de);
    let t = if ee > 0.0 { (de * s + er) / ee } else { 0.0 };
    if ee > 0.0 && (0.0..=1.0).contains(&t) {
        return (s, t);
    }
    let t = t.clamp(0.0, 1.0);
    (over(de * t - dr, dd), t)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array)
    }

    /// Returns the distance of the nearest of many points of the axis.
    fn by_trying(axis: Axis, corners: [DVec3; 3]) -> f64 {
        let at = |s: f64| {
            (axis.centre_m + axis.half_m * s).distance(closest_point(axis.centre_m + axis.half_m * s, corners))
        };
        (0..=2000).map(|i| at(f64::from(i) * 1e-3 - 1.0)).fold(f64::INFINITY, f64::min)
    }

    proptest! {
        #[test]
        fn no_point_of_the_axis_is_nearer(
            centre in point(),
            half in point(),
            a in point(),
            b in point(),
            c in point(),
        ) {
            let axis = Axis { centre_m: centre, half_m: half };
            let near = axis.approach([a, b, c]);
            let tried = by_trying(axis, [a, b, c]);
            let found = near.to_triangle_m.length();
            prop_assert!(found <= tried + 1e-12 && found >= tried - 1e-3 * half.length(), "{found} {tried}");
            prop_assert!(near.weights.iter().all(|w| *w >= -1e-12));
            prop_assert!((near.weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let at = a * near.weights[0] + b * near.weights[1] + c * near.weights[2];
            prop_assert!((centre + near.arm_m + near.to_triangle_m - at).length() < 1e-9);
            let is_nearest = (axis.nearest_m(at - centre) - near.arm_m).length() < 1e-6;
            prop_assert!(is_nearest || found < 1e-9 || half.cross(b - a).length() < 1e-3);
        }

        #[test]
        fn a_bound_is_one_and_a_useful_one(
            centre in point(),
            half in point(),
            a in point(),
            b in point(),
            c in point(),
            wanted in 0.0..3.0_f64,
        ) {
            let (axis, corners) = (Axis { centre_m: centre, half_m: half }, [a, b, c]);
            let from_point = |p: DVec3| p.distance(closest_point(p, corners));
            let (distance, bound) = (axis.distance_m(corners), axis.distance_bound_m(wanted, from_point));
            prop_assert!(bound <= distance + 1e-12, "{bound} {distance}");
            // Where the bound is used it is good to within a piece.
            prop_assert!(bound >= wanted || bound >= distance - 2.0 * half.length() / PIECES as f64 - 1e-12);
            let point = Axis::point(centre);
            prop_assert_eq!(point.distance_bound_m(wanted, from_point), point.distance_m(corners));
        }

        #[test]
        fn flat_triangles_and_short_axes_stay_finite(
            centre in point(),
            a in point(),
            b in point(),
            t in 0.0..1.0_f64,
            half in 0.0..1e-9_f64,
        ) {
            let axis = Axis { centre_m: centre, half_m: DVec3::X * half };
            for corners in [[a, b, a.lerp(b, t)], [a; 3]] {
                let near = axis.approach(corners);
                prop_assert!(near.to_triangle_m.is_finite());
                prop_assert!((near.to_triangle_m.length() - by_trying(axis, corners)).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn a_point_is_its_own_axis() {
        let (axis, corners) = (Axis::point(DVec3::Z), [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!((axis.distance_m(corners), axis.approach(corners).arm_m), (1.0, DVec3::ZERO));
    }
}
