//! What the keys of a WoodenHaptics mean.
use super::{
    super::{seconds, value},
    LENGTHS_M, within,
};
use crate::{
    BridgeError,
    config::WoodenHapticsConfig,
    device::woodenhaptics::{Settings, kinematics::Kinematics},
};
use glam::DVec3;
use std::ops::RangeInclusive;

const COUNTS_PER_TURN: RangeInclusive<f64> = 4.0..=1e6;
const TORQUE_CONSTANTS_NM_PER_A: RangeInclusive<f64> = 1e-4..=10.0;
/// As thousandths of an ampere they are numbers of 16 bits.
const CURRENTS_A: RangeInclusive<f64> = 1e-3..=30.0;

/// A WoodenHaptics' constants, checked.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn checked(config: &WoodenHapticsConfig) -> Result<Settings, BridgeError> {
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
    Ok(Settings {
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
