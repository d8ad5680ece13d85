//! A perspective camera that sees the whole body.
use glam::{Mat4, Vec3, Vec4};

/// Vertical field of view (rad).
const FIELD_OF_VIEW_RAD: f32 = 0.61;

/// From the world (m) to the picture.
pub(super) struct Camera {
    view_projection: Mat4,
    /// Unit vector from the body towards the eye; the lamp stands beside it.
    pub(super) to_eye: Vec3,
    /// Diagonal of the body's box (m).
    pub(super) body_size_m: f32,
}

impl Camera {
    /// Looks at the middle of `points_m` from direction `from`, z up, far enough to see all.
    pub(super) fn looking_at(points_m: &[Vec3], from: Vec3, aspect: f32) -> Self {
        let low = points_m.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
        let high = points_m.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ONE);
        let size = low.distance(high).max(1e-9);
        let centre = (low + high) / 2.0;
        let to_eye = from.normalize();
        // Looking straight down, z cannot be up.
        let up = if to_eye.z.abs() > 0.999 { Vec3::Y } else { Vec3::Z };
        let distance = size / (2.0 * (FIELD_OF_VIEW_RAD / 2.0).tan()) / aspect.min(1.0) * 1.08;
        let view = glam::camera::rh::view::look_at_mat4(centre + to_eye * distance, centre, up);
        let projection =
            glam::camera::rh::proj::directx::perspective(FIELD_OF_VIEW_RAD, aspect, distance / 50.0, distance * 10.0);
        Self { view_projection: projection * view, to_eye, body_size_m: size }
    }

    /// Homogeneous clip coordinates of a world position (m).
    pub(super) fn clip(&self, position_m: Vec3) -> Vec4 {
        self.view_projection * position_m.extend(1.0)
    }
}
