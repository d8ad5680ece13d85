//! Poses of an arm: polynomials, and a square root where it turns, so that they are the same bits everywhere.
use glam::{DQuat, DVec3};
use palpate_physics::contact::ToolTarget;

/// A press, a drag with a turn, and a way back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    /// How long (s) each of the three takes.
    pub(super) each_s: f64,
    /// The way in (m).
    pub(super) press_m: DVec3,
    /// The way along (m).
    pub(super) drag_m: DVec3,
    /// About what it turns, of length 1.
    pub(super) axis: DVec3,
    /// The sine of half of the angle that it turns by.
    pub(super) half_sine: f64,
}

/// `s³ (10 − 15 s + 6 s²)` of a number held in 0..=1, and its derivative.
fn smooth(s: f64) -> (f64, f64) {
    let s = s.clamp(0.0, 1.0);
    (s * s * s * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) * (1.0 - s))
}

impl Stroke {
    /// The pose at a time, of a device that starts there.
    pub(super) fn at(&self, start: ToolTarget, time_s: f64) -> ToolTarget {
        let part = |number: f64| smooth(time_s / self.each_s - number);
        let ((into, into_rate), (along, along_rate), (back, back_rate)) = (part(0.0), part(1.0), part(2.0));
        let sine = self.half_sine * along;
        let cosine = (1.0 - sine * sine).sqrt();
        let turn = DQuat::from_vec4((self.axis * sine).extend(cosine));
        ToolTarget {
            position_m: start.position_m + self.press_m * (into - back) + self.drag_m * along,
            velocity_m_per_s: (self.press_m * (into_rate - back_rate) + self.drag_m * along_rate) / self.each_s,
            orientation: (turn * start.orientation).normalize(),
            angular_velocity_rad_per_s: self.axis * (2.0 * self.half_sine * along_rate / (cosine * self.each_s)),
        }
    }
}
