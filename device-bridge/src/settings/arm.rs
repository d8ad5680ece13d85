//! What the keys of each arm mean.
use super::{parameter, seconds, value};
use crate::{
    BridgeError, Config,
    config::{DeviceConfig, HapticMasterConfig, LimitsConfig, SimulatedConfig, WoodenHapticsConfig},
    device::{
        hapticmaster::{Dialect, start::StartSettings},
        woodenhaptics::{self, kinematics::Kinematics},
    },
};
use glam::DVec3;
use palpate_control::{ArmSpec, HandPath, Keyframe, SimulatedArm};
use std::ops::RangeInclusive;

/// What a HapticMASTER can be made to feel like (kg).
const INERTIAS_KG: RangeInclusive<f64> = 2.0..=100.0;
/// Lengths, diameters and gears of an arm on a table.
const LENGTHS_M: RangeInclusive<f64> = 1e-3..=2.0;
const COUNTS_PER_TURN: RangeInclusive<f64> = 4.0..=1e6;
const TORQUE_CONSTANTS_NM_PER_A: RangeInclusive<f64> = 1e-4..=10.0;
/// As thousandths of an ampere they are numbers of 16 bits.
const CURRENTS_A: RangeInclusive<f64> = 1e-3..=30.0;

/// Which arm.
#[derive(Debug, Clone)]
pub enum ArmSettings {
    /// The simulated one.
    Simulated(SimulatedArm),
    /// A HapticMASTER.
    HapticMaster(StartSettings),
    /// A WoodenHaptics.
    WoodenHaptics(woodenhaptics::Settings),
}

/// The arm of a configuration, checked.
pub(super) fn checked(config: &Config, period_s: f64) -> Result<ArmSettings, BridgeError> {
    match &config.device {
        DeviceConfig::Simulated(simulated) => Ok(ArmSettings::Simulated(simulated_arm(simulated, period_s)?)),
        DeviceConfig::Hapticmaster(arm) => Ok(ArmSettings::HapticMaster(hapticmaster(arm, &config.limits)?)),
        DeviceConfig::Woodenhaptics(arm) => Ok(ArmSettings::WoodenHaptics(woodenhaptics(arm)?)),
    }
}

fn simulated_arm(config: &SimulatedConfig, period_s: f64) -> Result<SimulatedArm, BridgeError> {
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

fn hapticmaster(config: &HapticMasterConfig, limits: &LimitsConfig) -> Result<StartSettings, BridgeError> {
    within("device.inertia_kg", &[config.inertia_kg], INERTIAS_KG)?;
    Ok(StartSettings {
        address: config.address.clone(),
        dialect: if config.apart { Dialect::Apart } else { Dialect::Mixed },
        inertia_kg: config.inertia_kg,
        max_force_n: limits.max_force_n,
        homing: seconds("device.homing_s", config.homing_s)?,
        silence: seconds("device.silence_s", config.silence_s)?,
    })
}

/// A WoodenHaptics' constants, checked.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn woodenhaptics(config: &WoodenHapticsConfig) -> Result<woodenhaptics::Settings, BridgeError> {
    within("device.link_lengths_m", &config.link_lengths_m, LENGTHS_M)?;
    within("device.capstan_diameters_m", &config.capstan_diameters_m, LENGTHS_M)?;
    within("device.body_diameters_m", &config.body_diameters_m, LENGTHS_M)?;
    within("device.centre_m", &config.centre_m, -LENGTHS_M.end()..=*LENGTHS_M.end())?;
    within("device.counts_per_turn", &[config.counts_per_turn], COUNTS_PER_TURN)?;
    within("device.torque_constant_nm_per_a", &[config.torque_constant_nm_per_a], TORQUE_CONSTANTS_NM_PER_A)?;
    within("device.max_current_a", &[config.max_current_a], CURRENTS_A)?;
    let kinematics = Kinematics { links_m: config.link_lengths_m, centre_m: DVec3::from_array(config.centre_m) };
    if kinematics.angles_rad(DVec3::ZERO).is_none() {
        return Err(value("device.centre_m", "is out of reach of link_lengths_m".to_owned()));
    }
    Ok(woodenhaptics::Settings {
        port: config.port.clone(),
        baud: config.baud,
        kinematics,
        gear_ratios: DVec3::from_array(config.body_diameters_m) / DVec3::from_array(config.capstan_diameters_m),
        counts_per_turn: config.counts_per_turn,
        home_counts: config.home_counts,
        reversed: config.reversed,
        torque_constant_nm_per_a: config.torque_constant_nm_per_a,
        max_current_a: config.max_current_a,
        silence: seconds("device.silence_s", config.silence_s)?,
    })
}

fn within(key: &str, values: &[f64], range: RangeInclusive<f64>) -> Result<(), BridgeError> {
    match values.iter().find(|value| !range.contains(value)) {
        Some(wrong) => Err(value(key, format!("{wrong} is out of range: use {} to {}", range.start(), range.end()))),
        None => Ok(()),
    }
}
