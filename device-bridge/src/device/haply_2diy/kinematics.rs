//! From a 2diy's angles to its tool, and from forces to torques: two arms of two links each, in a plane, that meet at the tool.
use glam::{DMat2, DVec2};

/// Elbows that seem to be farther apart than the outer links reach, by so much (m), are taken to be as far as they reach: encoders are set by hand.
const STRETCH_M: f64 = 3e-3;
/// Sine of the angle between the outer links below which they are as good as one: nothing is told of how the tool moves, and no force is given.
const LEAST_SINE: f64 = 0.05;

/// Lengths of the arm. Motor 1 is at the origin of the plane, motor 2 on its x axis; the tool is on the side of y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// From one motor to the other (m): 0 where they share their axis.
    pub base_m: f64,
    /// Length of the links at the motors, and of those at the tool (m).
    pub links_m: [f64; 2],
    /// Where the middle of the workspace is (m): the origin of poses.
    pub centre_m: DVec2,
}

/// Where the arm is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The tool (m).
    pub tool_m: DVec2,
    /// `J = ∂x/∂(θ1, θ2)` (m/rad): `v = J ω`, `τ = Jᵀ F`. Zero where the outer links are in line.
    pub jacobian_m_per_rad: DMat2,
}

impl Kinematics {
    /// The tool, with the angles (rad) of both motors from the x axis; `None` where no such arm can be.
    ///
    /// Elbows `A = l e(θ1)`, `B = (d, 0) + l e(θ2)`, `h = B − A`: the tool is at `x = (A + B)/2 + h⊥ √(L²/h² − ¼)`, `h⊥` being h turned to the left.
    pub fn place(&self, angles_rad: DVec2) -> Option<Place> {
        let [inner_m, outer_m] = self.links_m;
        let [a, b] = self.elbows_m(angles_rad);
        let h = b - a;
        let apart_m = h.length();
        // Also when the elbows meet, and the tool could be anywhere around them.
        if !(apart_m > 2.0 * LEAST_SINE * outer_m && apart_m <= 2.0 * outer_m + STRETCH_M) {
            return None;
        }
        let height_m = (outer_m.powi(2) - 0.25 * apart_m.powi(2)).max(0.0).sqrt();
        let x = 0.5 * (a + b) + height_m / apart_m * h.perp();
        let jacobian_m_per_rad = self.jacobian(x - a, x - b, angles_rad, inner_m);
        Some(Place { tool_m: x - self.centre_m, jacobian_m_per_rad })
    }

    /// With `u = x − A`, `w = x − B`, and the elbows moving along `a' = l e'(θ1)`, `b' = l e'(θ2)`: links keep their lengths when
    /// `u·dx = u·a' dθ1` and `w·dx = w·b' dθ2`, so `J = (u w)⁻ᵀ diag(u·a', w·b')`.
    fn jacobian(&self, u: DVec2, w: DVec2, angles_rad: DVec2, inner_m: f64) -> DMat2 {
        let outer_m = self.links_m[1];
        if u.perp_dot(w).abs() < LEAST_SINE * outer_m.powi(2) {
            return DMat2::ZERO;
        }
        let [da, db] = [angles_rad.x, angles_rad.y].map(|angle| inner_m * DVec2::from_angle(angle).perp());
        DMat2::from_cols(u, w).transpose().inverse() * DMat2::from_diagonal(DVec2::new(u.dot(da), w.dot(db)))
    }

    fn elbows_m(&self, angles_rad: DVec2) -> [DVec2; 2] {
        let elbow = |angle: f64| self.links_m[0] * DVec2::from_angle(angle);
        [elbow(angles_rad.x), DVec2::new(self.base_m, 0.0) + elbow(angles_rad.y)]
    }

    /// Angles (rad) for a tool there (m), elbows outwards; `None` out of reach.
    ///
    /// For a motor at m and `p = x − m`: `θ = atan2(p) ± acos((p² + l² − L²)/(2 l |p|))`, + for motor 1.
    pub fn angles_rad(&self, tool_m: DVec2) -> Option<DVec2> {
        let [inner_m, outer_m] = self.links_m;
        let angle = |motor_x_m: f64, side: f64| {
            let p = tool_m + self.centre_m - DVec2::new(motor_x_m, 0.0);
            let cosine = (p.length_squared() + inner_m.powi(2) - outer_m.powi(2)) / (2.0 * inner_m * p.length());
            (-1.0..=1.0).contains(&cosine).then(|| p.to_angle() + side * cosine.acos())
        };
        Some(DVec2::new(angle(0.0, 1.0)?, angle(self.base_m, -1.0)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    const THIRD: Kinematics = Kinematics { base_m: 0.038, links_m: [0.070, 0.090], centre_m: DVec2::new(0.019, 0.095) };
    const SECOND: Kinematics = Kinematics { base_m: 0.0, centre_m: DVec2::new(0.0, 0.095), ..THIRD };

    fn degrees(a: f64, b: f64) -> DVec2 {
        DVec2::new(a, b).map(f64::to_radians)
    }

    #[test]
    fn known_poses() {
        // Inner links upright and parallel: elbows 38 mm apart, so √(90² − 19²) mm above them.
        let upright = THIRD.place(degrees(90.0, 90.0)).unwrap().tool_m + THIRD.centre_m;
        assert!(upright.distance(DVec2::new(0.019, 0.070 + (0.090_f64.powi(2) - 0.019_f64.powi(2)).sqrt())) < 1e-15);
        // Inner links in line on one axis, 140 mm from elbow to elbow.
        let spread = SECOND.place(degrees(180.0, 0.0)).unwrap().tool_m + SECOND.centre_m;
        assert!(spread.distance(DVec2::new(0.0, (0.090_f64.powi(2) - 0.070_f64.powi(2)).sqrt())) < 1e-15);
        // Where its encoders begin: 168 and 12 degrees, symmetric about the middle between the motors.
        assert!((THIRD.place(degrees(168.0, 12.0)).unwrap().tool_m.x + THIRD.centre_m.x - 0.019).abs() < 1e-15);
    }

    #[test]
    fn where_no_arm_can_be_there_is_none_and_no_number_that_is_none() {
        assert_eq!(SECOND.place(degrees(90.0, 90.0)), None, "elbows meet");
        let wide = Kinematics { base_m: 0.06, ..THIRD };
        assert_eq!(wide.place(degrees(180.0, 0.0)), None, "elbows 200 mm apart");
        assert_eq!(THIRD.place(DVec2::NAN), None);
        assert_eq!(THIRD.place(DVec2::new(f64::INFINITY, 0.0)), None);
        assert_eq!(THIRD.angles_rad(DVec2::X), None);
        assert_eq!(THIRD.angles_rad(DVec2::NAN), None);
        // At a motor's own axis.
        assert_eq!(THIRD.angles_rad(-THIRD.centre_m), None);
    }

    /// Outer links in line: elbows as far apart as can be, or by the slip of an encoder more.
    #[test]
    fn in_line_the_tool_is_between_the_elbows_and_no_force_is_told() {
        for apart_m in [0.180, 0.182] {
            let arm = Kinematics { base_m: apart_m - 0.140, ..THIRD };
            let place = arm.place(DVec2::new(PI, 0.0)).unwrap();
            assert!((place.tool_m + arm.centre_m).distance(DVec2::new(0.5 * arm.base_m, 0.0)) < 1e-9);
            assert_eq!(place.jacobian_m_per_rad, DMat2::ZERO);
        }
    }

    proptest! {
        /// Everywhere in the workspace, 120 by 60 mm, on both arms.
        #[test]
        fn angles_and_tool_are_inverse_and_the_jacobian_is_the_derivative(x in -0.06..0.06_f64, y in -0.03..0.03_f64) {
            for arm in [THIRD, SECOND] {
                let tool_m = DVec2::new(x, y);
                let angles = arm.angles_rad(tool_m).unwrap();
                let place = arm.place(angles).unwrap();
                prop_assert!(place.tool_m.distance(tool_m) < 1e-12, "{}", place.tool_m);
                for axis in 0..2 {
                    let step = 1e-6 * DMat2::IDENTITY.col(axis);
                    let there = |angles| arm.place(angles).unwrap().tool_m;
                    let slope = (there(angles + step) - there(angles - step)) / 2e-6;
                    prop_assert!(slope.distance(place.jacobian_m_per_rad.col(axis)) < 1e-8);
                }
                prop_assert!(place.jacobian_m_per_rad.determinant().abs() > 1e-3, "no singular pose");
            }
        }

        #[test]
        fn any_angles_give_numbers_or_none(a in any::<f64>(), b in any::<f64>()) {
            for arm in [THIRD, SECOND] {
                if let Some(place) = arm.place(DVec2::new(a, b)) {
                    prop_assert!(place.tool_m.is_finite() && place.jacobian_m_per_rad.is_finite());
                }
            }
        }
    }
}
