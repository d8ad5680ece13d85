//! From a Falcon's angles to its grip, and from forces to torques: the delta of R. E. Stamper's thesis (University of Maryland, 1997), whose letters these are.
//!
//! Leg i stands at the angle φ about z. In its axes u, v, w the grip is at `(pu, pv, pw)`, and with the leg's angles θ1 (motor), θ2, θ3
//!
//! ```text
//! pu = a cos θ1 − c + R cos θ2      R = d + e + b sin θ3
//! pv + f = b cos θ3
//! pw = a sin θ1 + R sin θ2
//! ```
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

/// From a leg's foot to its knee (m).
const A_M: f64 = 0.060;
/// Side of the shin's parallelogram (m).
const B_M: f64 = 0.1025;
/// From the shin's end to the grip, along u (m).
const C_M: f64 = 0.014;
/// From the shin to its joints at the grip and at the knee (m).
const D_M: f64 = 0.01125;
const E_M: f64 = D_M;
/// From the shin's end to the grip, along v (m).
const F_M: f64 = -0.025;
/// From the origin to a leg's foot, along u and v (m).
const R_M: f64 = 0.037233758;
const S_M: f64 = -0.027330909;
/// The legs are turned by 15 degrees against the desk.
const LEGS_RAD: [f64; 3] = [PI / 2.0 + PI / 12.0, -PI / 6.0 + PI / 12.0, -5.0 * PI / 6.0 + PI / 12.0];

/// Middle of what the grip reaches (m): z points at the hand.
pub const MIDDLE_M: DVec3 = DVec3::new(0.0, 0.0, 0.125);
/// The grip is never farther from there (m); all legs reach any place up to 55 mm from it.
const REACH_M: f64 = 0.1;
/// Sine of the angle between thigh and shin below which they are as good as in line.
const LEAST_SINE: f64 = 0.05;
/// More steps, and halvings of one, than any pose of the workspace takes.
const MOST_STEPS: usize = 16;
const MOST_HALVINGS: i32 = 6;
/// No step of Newton's method is longer (m).
const LONGEST_STEP_M: f64 = 0.04;
/// As near as this (rad) two sets of angles are the same.
const NEAR_RAD: f64 = 1e-9;

/// Angles of the motors where the grip is somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Legs {
    /// θ1 of each leg (rad).
    pub angles_rad: DVec3,
    /// `W = ∂θ/∂x` (rad/m), the inverse of the Jacobian: `ω = W v`, `F = Wᵀ τ`.
    pub slope_rad_per_m: DMat3,
}

/// The legs for a grip there (m); `None` where it cannot be.
pub fn legs(grip_m: DVec3) -> Option<Legs> {
    if !grip_m.is_finite() || grip_m.distance(MIDDLE_M) > REACH_M {
        return None;
    }
    let mut angles_rad = DVec3::ZERO;
    let mut rows = [DVec3::ZERO; 3];
    for leg in 0..3 {
        (angles_rad[leg], rows[leg]) = one_leg(LEGS_RAD[leg], grip_m)?;
    }
    Some(Legs { angles_rad, slope_rad_per_m: DMat3::from_cols_array_2d(&rows.map(|row| row.to_array())).transpose() })
}

/// θ1 and its gradient.
///
/// With `q = pu + c` the knee is on a circle around the foot and R away from `(q, pw)`:
/// `q cos θ1 + pw sin θ1 = (q² + pw² + a² − R²)/(2a)`, so `θ1 = atan2(pw, q) − acos((q² + pw² + a² − R²)/(2a √(q² + pw²)))`, the knee outwards.
/// From the derivative of the same, `a sin(θ2 − θ1) dθ1 = cos θ2 dpu + cot θ3 dpv + sin θ2 dpw`.
fn one_leg(phi_rad: f64, grip_m: DVec3) -> Option<(f64, DVec3)> {
    let (sin, cos) = phi_rad.sin_cos();
    let (along, across) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
    let (q, pv, pw) = (along.dot(grip_m) - R_M + C_M, across.dot(grip_m) - S_M, grip_m.z);
    let cos_3 = (pv + F_M) / B_M;
    let sin_3 = (1.0 - cos_3 * cos_3).sqrt();
    let r = D_M + E_M + B_M * sin_3;
    let far = q.hypot(pw);
    let cosine = (far * far + A_M * A_M - r * r) / (2.0 * A_M * far);
    // Neither is a number where the grip is too far to the side.
    if !(sin_3 > LEAST_SINE && cosine.abs() <= 1.0) {
        return None;
    }
    let theta_1 = pw.atan2(q) - cosine.acos();
    let (cos_2, sin_2) = ((q - A_M * theta_1.cos()) / r, (pw - A_M * theta_1.sin()) / r);
    // sin(θ2 − θ1)
    let lever = sin_2 * theta_1.cos() - cos_2 * theta_1.sin();
    (lever > LEAST_SINE).then(|| (theta_1, (cos_2 * along + cos_3 / sin_3 * across + sin_2 * DVec3::Z) / (A_M * lever)))
}

/// The grip (m) for these angles (rad) of the motors, and its legs, by Newton's method from where it was last, or from the middle; `None` where no Falcon can be.
///
/// `x ← x + W⁻¹ (θ − θ(x))`
pub fn grip(angles_rad: DVec3, last_m: DVec3) -> Option<(DVec3, Legs)> {
    newton(angles_rad, last_m).or_else(|| newton(angles_rad, MIDDLE_M))
}

fn newton(angles_rad: DVec3, from_m: DVec3) -> Option<(DVec3, Legs)> {
    let (mut grip_m, mut there) = (from_m, legs(from_m)?);
    for _ in 0..MOST_STEPS {
        let missing_rad = angles_rad - there.angles_rad;
        if missing_rad.abs().max_element() < NEAR_RAD {
            return Some((grip_m, there));
        }
        let step_m = (there.slope_rad_per_m.inverse() * missing_rad).clamp_length_max(LONGEST_STEP_M);
        // A step that leads out of reach is made shorter.
        let shorter = |halvings: i32| {
            let next_m = grip_m + step_m * 0.5_f64.powi(halvings);
            legs(next_m).map(|legs| (next_m, legs))
        };
        (grip_m, there) = (0..MOST_HALVINGS).find_map(shorter)?;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// By Stamper's own way: a quadratic in tan(θ1/2).
    fn theta_1_by_half_angle(phi: f64, p: DVec3) -> f64 {
        let (sin, cos) = phi.sin_cos();
        let (pu, pv, pw) = (-R_M + cos * p.x + sin * p.y, -(S_M - cos * p.y + sin * p.x), p.z);
        let r = D_M + E_M + B_M * ((pv + F_M) / B_M).acos().sin();
        let q = pu + C_M;
        let l = |side: f64| pw * pw + q * q + A_M * A_M - r * r + side * 2.0 * A_M * q;
        let (l_0, l_1, l_2) = (l(-1.0), -4.0 * A_M * pw, l(1.0));
        2.0 * ((-l_1 - (l_1 * l_1 - 4.0 * l_2 * l_0).sqrt()) / (2.0 * l_2)).atan()
    }

    #[test]
    fn on_the_axis_all_legs_are_alike_and_z_alone_moves_them_alike() {
        for z in [0.09, 0.125, 0.16] {
            let legs = legs(DVec3::new(0.0, 0.0, z)).unwrap();
            let [a, b, c] = legs.angles_rad.to_array();
            assert!((a - b).abs() < 1e-12 && (b - c).abs() < 1e-12);
            let column = legs.slope_rad_per_m.z_axis;
            assert!((column.x - column.y).abs() < 1e-9 && column.x > 10.0, "{column}");
        }
    }

    /// Knee and shin drawn by hand: from the foot by a to the knee, from there by R to the grip's end, in the plane of the leg.
    #[test]
    fn a_known_pose() {
        let theta_1 = 35.0_f64.to_radians();
        let pv: f64 = 0.027330909;
        let r = 2.0 * 0.01125 + (0.1025_f64.powi(2) - (pv - 0.025).powi(2)).sqrt();
        let q: f64 = -0.037233758 + 0.014;
        let z = 0.060 * theta_1.sin() + (r.powi(2) - (q - 0.060 * theta_1.cos()).powi(2)).sqrt();
        let (grip_m, _) = grip(DVec3::splat(theta_1), MIDDLE_M).unwrap();
        assert!(grip_m.distance(DVec3::new(0.0, 0.0, z)) < 1e-7, "{grip_m} {z}");
        assert!((0.13..0.14).contains(&z), "{z}");
    }

    #[test]
    fn where_no_falcon_can_be_there_is_none() {
        for wrong in [DVec3::ZERO, DVec3::NAN, DVec3::splat(1.0), DVec3::new(0.0, 0.0, f64::INFINITY)] {
            assert_eq!(legs(wrong), None);
        }
        assert_eq!(grip(DVec3::NAN, MIDDLE_M), None);
        assert_eq!(grip(DVec3::splat(3.0), MIDDLE_M), None);
        assert_eq!(grip(DVec3::new(-2.0, 2.0, 0.0), DVec3::NAN), None);
    }

    proptest! {
        /// Everywhere in a ball of 50 mm.
        #[test]
        fn angles_and_grip_are_inverse_and_the_slope_is_the_derivative(
            d in prop::array::uniform3(-0.05..0.05_f64), from in prop::array::uniform3(-0.05..0.05_f64),
        ) {
            let inside = |d: [f64; 3]| MIDDLE_M + DVec3::from(d).clamp_length_max(0.05);
            let (grip_m, from_m) = (inside(d), inside(from));
            let there = legs(grip_m).unwrap();
            for leg in 0..3 {
                let expected = theta_1_by_half_angle(LEGS_RAD[leg], grip_m);
                prop_assert!((there.angles_rad[leg] - expected).abs() < 1e-10);
            }
            // From any other pose.
            let (found_m, _) = grip(there.angles_rad, from_m).unwrap();
            prop_assert!(found_m.distance(grip_m) < 1e-9, "{found_m} {grip_m}");
            for axis in 0..3 {
                let step = 1e-6 * DMat3::IDENTITY.col(axis);
                let slope = (legs(grip_m + step).unwrap().angles_rad - legs(grip_m - step).unwrap().angles_rad) / 2e-6;
                prop_assert!(slope.distance(there.slope_rad_per_m.col(axis)) < 1e-5, "{slope}");
            }
            prop_assert!(there.slope_rad_per_m.determinant().abs() > 100.0, "no singular pose");
        }

        #[test]
        fn any_angles_give_a_grip_within_reach_or_none(
            angles in prop::array::uniform3(any::<f64>()), last in prop::array::uniform3(any::<f64>()),
        ) {
            if let Some((grip_m, legs)) = grip(DVec3::from(angles), DVec3::from(last)) {
                prop_assert!(grip_m.distance(MIDDLE_M) <= REACH_M && legs.slope_rad_per_m.is_finite());
            }
        }

        #[test]
        fn any_likely_angles_give_a_grip_within_reach_or_none(angles in prop::array::uniform3(-1.5..2.5_f64)) {
            if let Some((grip_m, legs)) = grip(DVec3::from(angles), MIDDLE_M) {
                prop_assert!(legs.angles_rad.distance(DVec3::from(angles)) < 1e-5 && grip_m.is_finite());
            }
        }
    }
}
