//! What the keys of the simulated arm mean.
use super::super::{parameter, value};
use crate::{BridgeError, config::SimulatedConfig};
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, Keyframe, SimulatedArm};

pub(super) fn checked(config: &SimulatedConfig, period_s: f64) -> Result<SimulatedArm, BridgeError> {
    let keyframes = config
        .keyframes
        .iter()
        .map(|key| Keyframe { time_s: key.time_s, position_m: DVec3::from_array(key.position_m) })
        .collect();
    let path =
        HandPath::new(keyframes, config.period_s).map_err(|error| value("device.keyframes", error.to_string()))?;
    let spec = ArmSpec {
        mass_kg: config.mass_kg,
        damping_n_s_per_m: config.damping_n_s_per_m,
        hand_stiffness_n_per_m: config.hand_stiffness_n_per_m,
        hand_damping_n_s_per_m: config.hand_damping_n_s_per_m,
    };
    SimulatedArm::new(spec, path, period_s).map_err(|error| parameter("device", &error))
}
