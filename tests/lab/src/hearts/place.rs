//! Where a heart is pressed.
use glam::{DQuat, DVec3};
use palpate_physics::Model;

/// Radius (m) of the fingertip.
pub(super) const RADIUS_M: f64 = 6e-3;

/// A place, and how a finger goes there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    touch_m: DVec3,
    outwards: DVec3,
    drag: DVec3,
}

impl Place {
    /// The vertex that is outermost across the heart's axis, turned about it by so much, and somewhat towards its apex, whose tangent plane has nothing
    /// before it.
    pub(super) fn of(bare: &Model, turned_rad: f64) -> Self {
        let x = bare.surface_rest_positions_m();
        let held: Vec<DVec3> =
            bare.prescribed()[0].nodes.iter().map(|&n| bare.rest_positions_m()[n as usize]).collect();
        let mean = |points: &[DVec3]| points.iter().sum::<DVec3>() / points.len() as f64;
        let apexwards = (mean(x) - mean(&held)).normalize();
        let across = DQuat::from_axis_angle(apexwards, turned_rad) * apexwards.any_orthonormal_vector();
        let outwards = (across + 0.5 * apexwards).normalize();
        let touch_m = x.iter().copied().max_by(|a, b| a.dot(outwards).total_cmp(&b.dot(outwards))).unwrap_or_default();
        Self { touch_m, outwards, drag: apexwards.cross(outwards).normalize() }
    }

    /// Position (m) of a finger that is so deep (m), dragged so far (m).
    pub(super) fn finger_m(&self, depth_m: f64, dragged_m: f64) -> DVec3 {
        self.touch_m + self.outwards * (RADIUS_M - depth_m) + self.drag * dragged_m
    }
}
