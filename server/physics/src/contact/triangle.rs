//! The point of a triangle closest to a given point.
use glam::DVec3;

/// Returns the weights of the corners at the point of triangle `[a, b, c]` that is closest to `p`; they are ≥ 0 and sum
/// to 1.
///
/// The plane of the triangle falls into seven regions: three where a corner is closest, three an edge, and the inside.
/// With `ab·ap` and the like, the region follows from the signs of the projections on the edges and of the signed areas
/// `va, vb, vc` (times |n|) of the projected point. A triangle with (nearly) no area is treated as its edges.
pub fn closest_weights(p: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    let (ab, ac) = (b - a, c - a);
    let longest_sq = ab.length_squared().max(ac.length_squared());
    if ab.cross(ac).length_squared() <= FLAT * longest_sq * longest_sq {
        return closest_on_edges(p, [a, b, c]);
    }
    let (ap, bp, cp) = (p - a, p - b, p - c);
    let (ab_ap, ac_ap) = (ab.dot(ap), ac.dot(ap));
    if ab_ap <= 0.0 && ac_ap <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let (ab_bp, ac_bp) = (ab.dot(bp), ac.dot(bp));
    if ab_bp >= 0.0 && ac_bp <= ab_bp {
        return [0.0, 1.0, 0.0];
    }
    let (ab_cp, ac_cp) = (ab.dot(cp), ac.dot(cp));
    if ac_cp >= 0.0 && ab_cp <= ac_cp {
        return [0.0, 0.0, 1.0];
    }
    let vc = ab_ap * ac_bp - ab_bp * ac_ap;
    if vc <= 0.0 && ab_ap >= 0.0 && ab_bp <= 0.0 {
        let t = ab_ap / (ab_ap - ab_bp);
        return [1.0 - t, t, 0.0];
    }
    let vb = ab_cp * ac_ap - ab_ap * ac_cp;
    if vb <= 0.0 && ac_ap >= 0.0 && ac_cp <= 0.0 {
        let t = ac_ap / (ac_ap - ac_cp);
        return [1.0 - t, 0.0, t];
    }
    let va = ab_bp * ac_cp - ab_cp * ac_bp;
    let (along, back) = (ac_bp - ab_bp, ab_cp - ac_cp);
    if va <= 0.0 && along >= 0.0 && back >= 0.0 {
        let t = along / (along + back);
        return [0.0, 1.0 - t, t];
    }
    let total = va + vb + vc;
    let (wb, wc) = (vb / total, vc / total);
    [1.0 - wb - wc, wb, wc]
}

/// Squared ratio of height to longest edge below which rounding would decide the region.
const FLAT: f64 = 1e-16;

fn closest_on_edges(p: DVec3, corners: [DVec3; 3]) -> [f64; 3] {
    let mut best = ([1.0, 0.0, 0.0], f64::INFINITY);
    for (i, j) in [(0, 1), (1, 2), (2, 0)] {
        let edge = corners[j] - corners[i];
        let t = (edge.dot(p - corners[i]) / edge.length_squared().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
        let distance_sq = (corners[i] + edge * t).distance_squared(p);
        if distance_sq < best.1 {
            let mut weights = [0.0; 3];
            (weights[i], weights[j]) = (1.0 - t, t);
            best = (weights, distance_sq);
        }
    }
    best.0
}

/// Returns the point (m) of the triangle closest to `p`.
pub(super) fn closest_point(p: DVec3, corners: [DVec3; 3]) -> DVec3 {
    let [wa, wb, wc] = closest_weights(p, corners);
    corners[0] * wa + corners[1] * wb + corners[2] * wc
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = DVec3> {
        prop::array::uniform3(-1.0..1.0_f64).prop_map(DVec3::from_array)
    }

    /// `q` is the closest point of a convex set exactly when no corner lies further along `p − q`.
    fn certificate(p: DVec3, corners: [DVec3; 3]) -> f64 {
        let q = closest_point(p, corners);
        corners.iter().map(|corner| (p - q).dot(*corner - q)).fold(f64::NEG_INFINITY, f64::max)
    }

    proptest! {
        #[test]
        fn no_point_of_the_triangle_is_closer(p in point(), a in point(), b in point(), c in point()) {
            let weights = closest_weights(p, [a, b, c]);
            prop_assert!(weights.iter().all(|w| *w >= -1e-12));
            prop_assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-12);
            let excess = certificate(p, [a, b, c]);
            prop_assert!(excess < 1e-9, "{excess}");
        }

        #[test]
        fn slivers_and_segments_stay_finite_and_closest(p in point(), a in point(), b in point(), t in 0.0..1.0_f64) {
            let excess = certificate(p, [a, b, a.lerp(b, t)]);
            prop_assert!(excess < 1e-6, "{excess}");
        }
    }

    #[test]
    fn each_region_answers() {
        let t = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |x: f64, y: f64| closest_point(DVec3::new(x, y, 0.7), t);
        assert_eq!(at(-1.0, -1.0), DVec3::ZERO);
        assert_eq!(at(3.0, 0.5), DVec3::X);
        assert_eq!(at(0.5, 3.0), DVec3::Y);
        assert_eq!(at(0.5, -2.0), DVec3::new(0.5, 0.0, 0.0));
        assert_eq!(at(-2.0, 0.5), DVec3::new(0.0, 0.5, 0.0));
        assert!(at(1.0, 1.0).distance(DVec3::new(0.5, 0.5, 0.0)) < 1e-15);
        assert!(at(0.25, 0.5).distance(DVec3::new(0.25, 0.5, 0.0)) < 1e-15);
    }

    #[test]
    fn a_point_triangle_answers_itself() {
        assert_eq!(closest_point(DVec3::ONE, [DVec3::X; 3]), DVec3::X);
    }
}
