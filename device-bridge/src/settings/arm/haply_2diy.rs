//! What the keys of a 2diy mean.
use super::{
    super::{seconds, value},
    LENGTHS_M, within,
};
use crate::{
    BridgeError,
    config::Haply2diyConfig,
    device::haply_2diy::{Settings, kinematics::Kinematics, wire::Axis},
};
use glam::DVec2;
use std::ops::RangeInclusive;

const BASES_M: RangeInclusive<f64> = 0.0..=1.0;
const PORTS: RangeInclusive<u8> = 1..=4;
const ANGLES_DEG: RangeInclusive<f64> = -360.0..=360.0;
const COUNTS_PER_TURN: RangeInclusive<f64> = 4.0..=1e6;
const TORQUES_NM: RangeInclusive<f64> = 1e-4..=10.0;

/// A 2diy's constants, checked.
///
/// # Errors
/// [`BridgeError`] naming the key.
pub fn checked(config: &Haply2diyConfig) -> Result<Settings, BridgeError> {
    within("device.base_m", &[config.base_m], BASES_M)?;
    within("device.link_lengths_m", &config.link_lengths_m, LENGTHS_M)?;
    within("device.centre_m", &config.centre_m, -LENGTHS_M.end()..=*LENGTHS_M.end())?;
    within("device.home_deg", &config.home_deg, ANGLES_DEG)?;
    within("device.counts_per_turn", &config.counts_per_turn, COUNTS_PER_TURN)?;
    within("device.max_torque_nm", &[config.max_torque_nm], TORQUES_NM)?;
    let [first, second] = config.ports;
    if first == second || !config.ports.iter().all(|port| PORTS.contains(port)) {
        return Err(value("device.ports", "two different ports from 1 to 4, please".to_owned()));
    }
    let kinematics = Kinematics {
        base_m: config.base_m,
        links_m: config.link_lengths_m,
        centre_m: DVec2::from_array(config.centre_m),
    };
    if kinematics.angles_rad(DVec2::ZERO).is_none() {
        return Err(value("device.centre_m", "is out of reach of link_lengths_m".to_owned()));
    }
    let axis = |motor: usize| Axis {
        port: config.ports[motor],
        counter_clockwise: config.counter_clockwise[motor],
        offset_deg: config.home_deg[motor],
        counts_per_turn: config.counts_per_turn[motor],
    };
    Ok(Settings {
        port: config.port.clone(),
        baud: config.baud,
        device_id: config.device_id,
        kinematics,
        axes: [axis(0), axis(1)],
        reversed: config.reversed,
        max_torque_nm: config.max_torque_nm,
        silence: seconds("device.silence_s", config.silence_s)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_names_the_key() {
        let refused = |change: fn(&mut Haply2diyConfig)| {
            let mut config = Haply2diyConfig::default();
            change(&mut config);
            checked(&config).unwrap_err().to_string()
        };
        assert!(refused(|c| c.base_m = -0.01).starts_with("device.base_m: -0.01 is out of range"));
        assert!(refused(|c| c.link_lengths_m[1] = 0.0).starts_with("device.link_lengths_m: 0 is out"));
        assert!(refused(|c| c.centre_m = [0.0, 0.5]).starts_with("device.centre_m: is out of reach"));
        assert!(refused(|c| c.ports = [1, 1]).starts_with("device.ports: two different"));
        assert!(refused(|c| c.ports = [0, 1]).starts_with("device.ports: two different"));
        assert!(refused(|c| c.home_deg[0] = f64::NAN).starts_with("device.home_deg: NaN is out"));
        assert!(refused(|c| c.counts_per_turn[0] = 0.0).starts_with("device.counts_per_turn: 0 is out"));
        assert!(refused(|c| c.max_torque_nm = 0.0).starts_with("device.max_torque_nm: 0 is out"));
        assert!(refused(|c| c.silence_s = -1.0).starts_with("device.silence_s: -1 is no time"));
    }
}
