//! What one has to know of the arm.
use super::{kinematics::Kinematics, wire::Axis};
use glam::DVec2;
use std::time::Duration;

/// The arm's constants. Of each two, the first is of motor 1, whose link is on the far side of x.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Path of the serial port.
    pub port: String,
    /// Its rate; a board with USB of its own does not care.
    pub baud: u32,
    /// What the board calls the arm, and begins its answers with.
    pub device_id: u8,
    /// Lengths.
    pub kinematics: Kinematics,
    /// Motors and encoders.
    pub axes: [Axis; 2],
    /// Motors that push against the way that their encoders count.
    pub reversed: [bool; 2],
    /// Largest torque (N m) that a motor is ever given.
    pub max_torque_nm: f64,
    /// Without an answer for so long the arm is lost.
    pub silence: Duration,
}

impl Settings {
    /// From the order of motors to that of ports, which messages have, and back.
    pub fn swapped<T: Copy>(&self, [first, second]: [T; 2]) -> [T; 2] {
        if self.axes[0].port < self.axes[1].port { [first, second] } else { [second, first] }
    }

    /// Torques (N m) as they are sent, all shortened alike when one is too large: then the force keeps its direction.
    pub fn sent_nm(&self, torques_nm: DVec2) -> [f32; 2] {
        if !torques_nm.is_finite() {
            return [0.0; 2];
        }
        let share = (self.max_torque_nm / torques_nm.abs().max_element()).min(1.0);
        self.swapped((self.signs() * torques_nm * share).to_array()).map(|nm| nm as f32)
    }

    /// Torques (N m) of the motors from what was sent.
    pub fn torques_nm(&self, sent_nm: [f64; 2]) -> DVec2 {
        self.signs() * DVec2::from(self.swapped(sent_nm))
    }

    /// A step of each encoder (degrees).
    pub fn steps_deg(&self) -> DVec2 {
        DVec2::from(self.axes.map(|axis| 360.0 / axis.counts_per_turn))
    }

    fn signs(&self) -> DVec2 {
        DVec2::from(self.reversed.map(|reversed| if reversed { -1.0 } else { 1.0 }))
    }
}
