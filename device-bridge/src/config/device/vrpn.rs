//! The keys of an arm behind a VRPN server.
use serde::{Deserialize, Serialize};

/// An arm that VRPN programs call `Phantom0@host`: its name there is the name of its tracker, its buttons and its force device, usually the same.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VrpnConfig {
    /// Host and port of the server.
    pub address: String,
    /// Name of the tracker.
    pub tracker: String,
    /// Sensor of the tracker.
    pub sensor: i32,
    /// Name of the buttons; empty: none.
    pub button: String,
    /// Name of the force device; empty: the arm is read, and never gets a force.
    pub force_device: String,
    /// So far (m) from where it was last told to be the arm still has the newest force.
    pub field_radius_m: f64,
    /// Make velocities from poses, even when the server sends some.
    pub velocity_from_poses: bool,
    /// How far apart two measurements of one place may be (m), such as a step of its encoders; for velocities from poses.
    pub position_step_m: f64,
    /// The force that the server reports is the hand's, by a sensor; a PHANToM's is that of its motors.
    pub force_is_measured: bool,
    /// Without a pose for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for VrpnConfig {
    /// The first PHANToM of a server on this machine.
    fn default() -> Self {
        Self {
            address: "127.0.0.1:3883".into(),
            tracker: "Phantom0".into(),
            sensor: 0,
            button: "Phantom0".into(),
            force_device: "Phantom0".into(),
            field_radius_m: 0.05,
            velocity_from_poses: false,
            position_step_m: 5e-5,
            force_is_measured: false,
            silence_s: 0.05,
        }
    }
}
