//! Where the arm's axes are in the world.
use glam::{DMat3, DVec3};
use thiserror::Error;

/// `x_world = origin + R x_arm`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    rotation: DMat3,
    origin_m: DVec3,
}

/// Why axes are no frame.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum FrameError {
    /// Not one of six names.
    #[error("\"{0}\" is no axis: write +x, -x, +y, -y, +z or -z")]
    Unknown(String),
    /// An axis twice, or a mirrored frame.
    #[error(
        "{0}, {1}, {2} are not the axes of a right-handed frame: each letter once, and an even number of them turned round"
    )]
    NotRightHanded(String, String, String),
    /// The origin is not finite.
    #[error("the origin must be finite")]
    Origin,
}

impl Frame {
    /// The arm's x, y and z point along these axes of the world, and its origin is there (m, world).
    ///
    /// # Errors
    /// [`FrameError`].
    pub fn new(axes: &[String; 3], origin_m: DVec3) -> Result<Self, FrameError> {
        let axis = |name: &String| match name.as_str() {
            "+x" | "x" => Ok(DVec3::X),
            "-x" => Ok(DVec3::NEG_X),
            "+y" | "y" => Ok(DVec3::Y),
            "-y" => Ok(DVec3::NEG_Y),
            "+z" | "z" => Ok(DVec3::Z),
            "-z" => Ok(DVec3::NEG_Z),
            _ => Err(FrameError::Unknown(name.clone())),
        };
        let [x, y, z] = axes;
        let rotation = DMat3::from_cols(axis(x)?, axis(y)?, axis(z)?);
        // A frame of axes has determinant 1, a mirrored one −1, and one with an axis twice 0.
        if rotation.determinant() < 0.5 {
            return Err(FrameError::NotRightHanded(x.clone(), y.clone(), z.clone()));
        }
        if origin_m.is_finite() { Ok(Self { rotation, origin_m }) } else { Err(FrameError::Origin) }
    }

    /// A place (m).
    pub fn to_world_m(&self, arm_m: DVec3) -> DVec3 {
        self.origin_m + self.rotation * arm_m
    }

    /// A velocity or force of the arm, in the world's axes.
    pub fn turned(&self, of_arm: DVec3) -> DVec3 {
        self.rotation * of_arm
    }

    /// A velocity or force of the world, in the arm's axes.
    pub fn from_world(&self, of_world: DVec3) -> DVec3 {
        self.rotation.transpose() * of_world
    }

    /// A place (m) of the world, for the arm.
    pub fn place_from_world_m(&self, world_m: DVec3) -> DVec3 {
        self.from_world(world_m - self.origin_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axes(names: [&str; 3]) -> [String; 3] {
        names.map(str::to_owned)
    }

    #[test]
    fn all_24_rotations_are_frames_and_nothing_else_is() {
        let names = ["+x", "-x", "+y", "-y", "+z", "-z"];
        let mut frames = Vec::new();
        for n in 0..216 {
            frames.extend(Frame::new(&axes([names[n % 6], names[n / 6 % 6], names[n / 36]]), DVec3::ONE));
        }
        assert_eq!(frames.len(), 24);
        for frame in &frames {
            let p = DVec3::new(0.1, -0.2, 0.3);
            assert!(frame.place_from_world_m(frame.to_world_m(p)).distance(p) < 1e-15);
            assert_eq!(frame.from_world(frame.turned(p)), p);
        }
        assert!(matches!(Frame::new(&axes(["up", "y", "z"]), DVec3::ZERO), Err(FrameError::Unknown(_))));
        assert_eq!(Frame::new(&axes(["x", "y", "z"]), DVec3::NAN), Err(FrameError::Origin));
    }

    #[test]
    fn axes_go_where_they_are_said_to_point() {
        let frame = Frame::new(&axes(["-y", "+x", "+z"]), DVec3::new(0.0, 0.0, 1.0)).unwrap();
        assert_eq!(frame.to_world_m(DVec3::new(2.0, 3.0, 4.0)), DVec3::new(3.0, -2.0, 5.0));
    }
}
