//! The arm that is built in: a simulated one whose hand follows the scene's path, in simulated time.
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, ParameterError, SimulatedArm};
use palpate_physics::contact::ToolTarget;
use palpate_scene::MotionPath;

/// A simulated arm on a scene's path.
#[derive(Debug)]
pub struct BuiltinArm {
    path: MotionPath,
    period_s: f64,
    start_m: DVec3,
    arm: SimulatedArm,
}

impl BuiltinArm {
    /// At rest at the beginning of the path, to be advanced by `period_s`.
    ///
    /// # Errors
    /// When the period is not positive.
    pub fn new(path: MotionPath, period_s: f64) -> Result<Self, ParameterError> {
        let start_m = path.at(0.0).position_m;
        let arm = SimulatedArm::new(ArmSpec::default(), HandPath::resting_at(start_m), period_s)?;
        Ok(Self { path, period_s, start_m, arm })
    }

    /// The arm at `time_s` (s, end of the tick) under a force (N) on its handle.
    pub fn advance(&mut self, time_s: f64, force_n: DVec3) -> ToolTarget {
        // The hand as it is in the middle of the tick.
        let hand = self.path.at(time_s - 0.5 * self.period_s);
        let motion = self.arm.step_towards(hand.position_m, hand.velocity_m_per_s, force_n);
        // The hand does not turn it.
        ToolTarget { position_m: motion.position_m, velocity_m_per_s: motion.velocity_m_per_s, ..hand.at_rest() }
    }

    /// Back to the beginning of the path.
    pub fn reset(&mut self) {
        self.arm.place(self.start_m, DVec3::ZERO);
    }

    /// To where its tool was sent last.
    pub fn place(&mut self, target: ToolTarget) {
        self.arm.place(target.position_m, target.velocity_m_per_s);
    }
}
