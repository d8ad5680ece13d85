//! From a WoodenHaptics' angles to its tool, and from forces to torques.
use glam::{DMat3, DVec3};

/// Lengths of the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Kinematics {
    /// Height of the second axis over the first body, length of the second and of the third body (m).
    pub links_m: [f64; 3],
    /// Where the middle of the workspace is, seen from the foot (m): the origin of poses.
    pub centre_m: DVec3,
}

impl Kinematics {
    /// The tool (m), with the angles (rad) of body a round the upright axis, and of b and c from it.
    ///
    /// `ρ = Lb sin b + Lc sin c`, `x = (ρ cos a, ρ sin a, La + Lb cos b − Lc cos c) − centre`.
    pub fn tool_m(&self, angles_rad: DVec3) -> DVec3 {
        let [la, lb, lc] = self.links_m;
        let (sin, cos) = (angles_rad.map(f64::sin), angles_rad.map(f64::cos));
        let reach_m = lb * sin.y + lc * sin.z;
        DVec3::new(reach_m * cos.x, reach_m * sin.x, la + lb * cos.y - lc * cos.z) - self.centre_m
    }

    /// `J = ∂x/∂(a, b, c)` (m/rad): `v = J ω`, `τ = Jᵀ F`.
    pub fn jacobian_m_per_rad(&self, angles_rad: DVec3) -> DMat3 {
        let [_, lb, lc] = self.links_m;
        let (sin, cos) = (angles_rad.map(f64::sin), angles_rad.map(f64::cos));
        let reach_m = lb * sin.y + lc * sin.z;
        DMat3::from_cols(
            DVec3::new(-reach_m * sin.x, reach_m * cos.x, 0.0),
            lb * DVec3::new(cos.x * cos.y, sin.x * cos.y, -sin.y),
            lc * DVec3::new(cos.x * cos.z, sin.x * cos.z, sin.z),
        )
    }

    /// Angles (rad) for a tool there (m), elbow up; `None` out of reach.
    ///
    /// In the plane of the arm two links reach `d = (ρ, h)`, `h = z − La`: with `γ` between them `cos γ = (d² − Lb² − Lc²)/(2 Lb Lc)`, and
    /// `b = atan2(ρ, h) − atan2(Lc sin γ, Lb + Lc cos γ)`, `c = π − b − γ`.
    pub fn angles_rad(&self, tool_m: DVec3) -> Option<DVec3> {
        let [la, lb, lc] = self.links_m;
        let p = tool_m + self.centre_m;
        let (reach_m, height_m) = (p.x.hypot(p.y), p.z - la);
        let cos_between = (reach_m.powi(2) + height_m.powi(2) - lb * lb - lc * lc) / (2.0 * lb * lc);
        if !(-1.0..=1.0).contains(&cos_between) {
            return None;
        }
        let between = cos_between.acos();
        let b = reach_m.atan2(height_m) - (lc * between.sin()).atan2(lb + lc * cos_between);
        Some(DVec3::new(p.y.atan2(p.x), b, std::f64::consts::PI - b - between))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ARM: Kinematics = Kinematics { links_m: [0.080, 0.205, 0.245], centre_m: DVec3::new(0.220, 0.0, 0.080) };

    #[test]
    fn known_poses() {
        let tool = |a: f64, b: f64, c: f64| ARM.tool_m(DVec3::new(a, b, c).map(f64::to_radians)) + ARM.centre_m;
        // Upright the third body hangs beside the second; lain down both reach out.
        assert!(tool(0.0, 0.0, 0.0).distance(DVec3::new(0.0, 0.0, 0.080 + 0.205 - 0.245)) < 1e-15);
        assert!(tool(0.0, 90.0, 90.0).distance(DVec3::new(0.450, 0.0, 0.080)) < 1e-15);
        assert!(tool(90.0, 90.0, 90.0).distance(DVec3::new(0.0, 0.450, 0.080)) < 1e-15);
        assert!(tool(0.0, 0.0, 90.0).distance(DVec3::new(0.245, 0.0, 0.285)) < 1e-15);
        assert_eq!(ARM.angles_rad(DVec3::X), None);
        assert_eq!(ARM.angles_rad(DVec3::NAN), None);
    }

    proptest! {
        /// Everywhere in the workspace, a ball of 100 mm.
        #[test]
        fn angles_and_tool_are_inverse_and_the_jacobian_is_the_derivative(d in prop::array::uniform3(-0.057..0.057_f64)) {
            let tool_m = DVec3::from(d);
            let angles = ARM.angles_rad(tool_m).unwrap();
            prop_assert!(ARM.tool_m(angles).distance(tool_m) < 1e-13);
            let jacobian = ARM.jacobian_m_per_rad(angles);
            for axis in 0..3 {
                let step = 1e-5 * DMat3::IDENTITY.col(axis);
                let slope = (ARM.tool_m(angles + step) - ARM.tool_m(angles - step)) / 2e-5;
                prop_assert!(slope.distance(jacobian.col(axis)) < 1e-10);
            }
            prop_assert!(jacobian.determinant().abs() > 1e-4, "no singular pose");
        }
    }
}
