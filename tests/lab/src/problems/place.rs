//! Where on its outside the ventricle is touched.
use glam::{DMat3, DVec3};

/// A place on the outer ellipsoid: parallels between base and tip, each on a meridian of its own, so that every one meets another part of an irregular
/// mesh. The body itself is the same about its axis, and references know the parallel alone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The equator, from +x.
    Side,
    /// 10 mm below the base that holds it.
    UnderBase,
    /// Below the equator.
    Flank,
    /// Between equator and tip.
    Shoulder,
    /// Where it is half as wide as at the equator.
    NearTip,
}

impl Place {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Side, Self::UnderBase, Self::Flank, Self::Shoulder, Self::NearTip];

    /// Of the ventricle touched there, for names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Side => "ventricle",
            Self::UnderBase => "ventricle-under-base",
            Self::Flank => "ventricle-flank",
            Self::Shoulder => "ventricle-shoulder",
            Self::NearTip => "ventricle-near-tip",
        }
    }

    /// For sentences.
    pub fn sentence(self) -> &'static str {
        match self {
            Self::Side => "the side of a ventricle of human size (90 mm long, wall 11 mm) held at its base",
            Self::UnderBase => "a ventricle of human size (90 mm long, wall 11 mm) 10 mm below the base that holds it",
            Self::Flank => "the flank of a ventricle of human size (90 mm long, wall 11 mm), 25 mm below its equator",
            Self::Shoulder => {
                "the shoulder of a ventricle of human size (90 mm long, wall 11 mm), 46 mm below its equator"
            }
            Self::NearTip => "a ventricle of human size (90 mm long, wall 11 mm) near its tip, 62 mm below its equator",
        }
    }

    /// φ (rad), with `z = long sin φ`.
    pub fn latitude_rad(self) -> f64 {
        let degrees: f64 = match self {
            Self::Side => 0.0,
            Self::UnderBase => 6.4,
            Self::Flank => -20.0,
            Self::Shoulder => -40.0,
            Self::NearTip => -60.0,
        };
        degrees.to_radians()
    }

    /// From a body touched on the meridian of +x to the one that is.
    pub fn turn(self) -> DMat3 {
        DMat3::from_rotation_z(72_f64.to_radians() * f64::from(self as u8))
    }
}

/// A meridian of an ellipsoid with semi-axes `(short, long)`, in the plane of +x and z.
#[derive(Debug, Clone, Copy)]
pub struct Meridian(pub (f64, f64));

impl Meridian {
    /// The point (m) at latitude φ.
    pub fn point_m(self, latitude_rad: f64) -> DVec3 {
        let (sin, cos) = latitude_rad.sin_cos();
        DVec3::new(self.0.0 * cos, 0.0, self.0.1 * sin)
    }

    /// Unit normal outwards.
    pub fn normal(self, latitude_rad: f64) -> DVec3 {
        let (sin, cos) = latitude_rad.sin_cos();
        DVec3::new(cos / self.0.0, 0.0, sin / self.0.1).normalize()
    }

    /// Its length over that of φ (m/rad): `√(short² sin²φ + long² cos²φ)`.
    pub fn metres_per_radian(self, latitude_rad: f64) -> f64 {
        let (sin, cos) = latitude_rad.sin_cos();
        (self.0.0 * sin).hypot(self.0.1 * cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problems::body::VENTRICLE_M;

    #[test]
    fn places_are_on_the_outside_with_room_for_a_touch() {
        let outer = Meridian(VENTRICLE_M.0);
        for place in Place::ALL {
            let (latitude, step) = (place.latitude_rad(), 1e-6);
            let along = outer.point_m(latitude + step) - outer.point_m(latitude - step);
            assert!((along.length() / (2.0 * step) / outer.metres_per_radian(latitude) - 1.0).abs() < 1e-8);
            assert!(outer.normal(latitude).dot(along.normalize()).abs() < 1e-8);
            // The patch's radius is 7.5 mm.
            assert!(outer.point_m(latitude).z + 7.5e-3 < VENTRICLE_M.2 && outer.point_m(latitude).x > 15e-3);
        }
    }
}
