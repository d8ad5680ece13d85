//! The simulated arm as a device: it lives in servo time, so it moves by as many periods as really passed.
use super::{Arm, Effort, Fault, Reading};
use glam::DVec3;
use palpate_control::SimulatedArm;

/// After a pause longer than this (periods) the arm goes on from where it was.
const LONGEST_GAP: u64 = 100;

/// The arm and the force held on it.
#[derive(Debug)]
pub struct SimulatedDevice {
    arm: SimulatedArm,
    force_n: DVec3,
}

impl SimulatedDevice {
    /// At the start of its path, without force.
    pub fn new(arm: SimulatedArm) -> Self {
        Self { arm, force_n: DVec3::ZERO }
    }
}

impl Arm for SimulatedDevice {
    /// Moves on under the force held, and reads.
    fn read(&mut self, periods: u64) -> Result<Reading, Fault> {
        for _ in 0..periods.min(LONGEST_GAP) {
            self.arm.step(self.force_n);
        }
        Ok(Reading {
            motion: self.arm.motion(),
            buttons: 0,
            measured_force_n: Some(self.arm.hand_force_n()),
            age_s: 0.0,
            force_share: 1.0,
        })
    }

    fn apply(&mut self, effort: &Effort) {
        self.force_n = effort.force_n;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_control::{ArmSpec, HandPath};

    #[test]
    fn skipped_ticks_pass_in_the_arms_time_too() {
        let arm = SimulatedArm::new(ArmSpec::default(), HandPath::resting_at(DVec3::ZERO), 1e-3).unwrap();
        let (mut steady, mut skipping) = (SimulatedDevice::new(arm.clone()), SimulatedDevice::new(arm));
        steady.apply(&Effort::force(DVec3::X));
        skipping.apply(&Effort::force(DVec3::X));
        for _ in 0..6 {
            steady.read(1).unwrap();
        }
        skipping.read(1).unwrap();
        assert_eq!(skipping.read(5), steady.read(0));
    }
}
