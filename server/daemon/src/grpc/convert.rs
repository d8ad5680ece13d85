//! The one border between wire and daemon: what comes in is checked here or refused, what goes out is built here.
use crate::{
    session::ActiveSession,
    sim::{
        exchange::{DeviceInput, ToolOutput, ToolView},
        inject::Injection,
    },
    stream::hub::Layers,
};
use glam::{DMat3, DQuat, DVec3};
use palpate_physics::{
    Quarantine,
    contact::{LocalContactModel, LocalTorqueModel},
};
use palpate_proto::{
    PROTOCOL_VERSION,
    v1::{self, DeviceFaultCode},
};
use tonic::Status;

/// Longest device name (bytes).
pub const MAX_DEVICE_NAME_BYTES: usize = 64;
/// Most forces in one request.
pub const MAX_FORCES: usize = 4096;
/// Most ticks in one request.
pub const MAX_STEP_TICKS: u32 = 1_000_000;
/// Highest rate a viewer may ask for (Hz).
pub const MAX_WATCH_RATE_HZ: f64 = 240.0;
/// Longest scene text (bytes).
pub const MAX_TOML_BYTES: usize = 1024 * 1024;
/// A tool centre farther from the origin than this (m) is no measurement.
pub const MAX_COORDINATE_M: f64 = 1e3;
/// A tool faster than this (m/s) is no measurement.
pub const MAX_SPEED_M_PER_S: f64 = 1e3;
/// A tool that turns faster than this (rad/s) is no measurement.
pub const MAX_TURN_RAD_PER_S: f64 = 1e4;
/// A larger force on a handle (N) is no measurement.
pub const MAX_MEASURED_FORCE_N: f64 = 1e5;
/// Largest injected force on a vertex (N).
pub const MAX_INJECTED_FORCE_N: f64 = 1e3;
/// Longest time an injected force acts (ticks): a day and more at 1 kHz.
pub const MAX_INJECTED_TICKS: u32 = 100_000_000;
/// How far a quaternion's norm may be from 1.
pub const QUATERNION_TOLERANCE: f64 = 1e-3;

/// A sample that was dropped, and why.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// Which rule it broke.
    pub code: DeviceFaultCode,
    /// For people.
    pub message: String,
}

fn rejected(code: DeviceFaultCode, message: impl Into<String>) -> Rejected {
    Rejected { code, message: message.into() }
}

fn vec3(v: v1::Vec3) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}

/// A vector on the wire.
pub fn wire_vec3(v: DVec3) -> v1::Vec3 {
    v1::Vec3 { x: v.x, y: v.y, z: v.z }
}

/// A rotation on the wire.
pub fn wire_quaternion(q: DQuat) -> v1::Quaternion {
    v1::Quaternion { w: q.w, x: q.x, y: q.y, z: q.z }
}

/// Checks a sample against the last accepted sequence number.
///
/// # Errors
/// [`Rejected`]: the sample is to be dropped.
pub fn device_sample(
    sample: &v1::DeviceSample,
    last_sequence: Option<u64>,
    attachment: u64,
    arrived_ns: u64,
) -> Result<DeviceInput, Rejected> {
    let missing = |field| rejected(DeviceFaultCode::MissingField, format!("the sample has no {field}"));
    let pose = sample.pose.as_ref().ok_or_else(|| missing("pose"))?;
    let position_m = vec3(pose.position_m.ok_or_else(|| missing("pose.position_m"))?);
    let orientation = pose.orientation.ok_or_else(|| missing("pose.orientation"))?;
    let twist = sample.twist.as_ref().ok_or_else(|| missing("twist"))?;
    let velocity_m_per_s = vec3(twist.linear_m_per_s.ok_or_else(|| missing("twist.linear_m_per_s"))?);
    let angular = vec3(twist.angular_rad_per_s.ok_or_else(|| missing("twist.angular_rad_per_s"))?);
    finite("pose.position_m", position_m, MAX_COORDINATE_M, "m")?;
    finite("twist.linear_m_per_s", velocity_m_per_s, MAX_SPEED_M_PER_S, "m/s")?;
    finite("twist.angular_rad_per_s", angular, MAX_TURN_RAD_PER_S, "rad/s")?;
    finite("measured_force_n", vec3(sample.measured_force_n.unwrap_or_default()), MAX_MEASURED_FORCE_N, "N")?;
    unit(orientation)?;
    if let Some(last) = last_sequence.filter(|last| sample.sequence <= *last) {
        let message = format!("sequence {} is not larger than the last accepted one, {last}", sample.sequence);
        return Err(rejected(DeviceFaultCode::OldSequence, message));
    }
    Ok(DeviceInput {
        attachment,
        sequence: sample.sequence,
        device_time_ns: sample.device_time_ns,
        arrived_ns,
        position_m,
        velocity_m_per_s,
        orientation: DQuat::from_xyzw(orientation.x, orientation.y, orientation.z, orientation.w).normalize(),
        angular_velocity_rad_per_s: angular,
        buttons: sample.buttons,
    })
}

fn finite(field: &str, v: DVec3, largest: f64, unit: &str) -> Result<(), Rejected> {
    if !v.is_finite() {
        return Err(rejected(DeviceFaultCode::NonFinite, format!("{field} = {v} is not finite")));
    }
    if v.abs().max_element() > largest {
        let message = format!("{field} = {v} is beyond {largest} {unit}: no arm measures that; check its units");
        return Err(rejected(DeviceFaultCode::OutOfRange, message));
    }
    Ok(())
}

fn unit(q: v1::Quaternion) -> Result<(), Rejected> {
    let norm = (q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z).sqrt();
    if !norm.is_finite() {
        return Err(rejected(DeviceFaultCode::NonFinite, "pose.orientation is not finite"));
    }
    if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
        let message = format!("pose.orientation has norm {norm}, not 1: send a unit quaternion (w, x, y, z)");
        return Err(rejected(DeviceFaultCode::BadOrientation, message));
    }
    Ok(())
}

/// The first message of a device.
///
/// # Errors
/// `INVALID_ARGUMENT`.
pub fn device_hello(message: Option<v1::DeviceUp>) -> Result<v1::DeviceHello, Status> {
    let Some(v1::device_up::Message::Hello(hello)) = message.and_then(|up| up.message) else {
        return Err(Status::invalid_argument("the first message must carry `hello`"));
    };
    if hello.device_name.len() > MAX_DEVICE_NAME_BYTES {
        let bytes = hello.device_name.len();
        return Err(Status::invalid_argument(format!(
            "device_name has {bytes} bytes; at most {MAX_DEVICE_NAME_BYTES}"
        )));
    }
    for (name, text) in [("device_name", &hello.device_name), ("tool_name", &hello.tool_name)] {
        if text.chars().any(char::is_control) {
            let shown: String = text.chars().take(64).flat_map(char::escape_debug).collect();
            return Err(Status::invalid_argument(format!("hello.{name} holds a control character: \"{shown}\"")));
        }
    }
    for (name, value) in [("max_force_n", hello.max_force_n), ("servo_rate_hz", hello.servo_rate_hz)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Status::invalid_argument(format!("hello.{name} = {value} must be finite and larger than 0")));
        }
    }
    if !(hello.max_torque_nm.is_finite() && hello.max_torque_nm >= 0.0) {
        let value = hello.max_torque_nm;
        return Err(Status::invalid_argument(format!("hello.max_torque_nm = {value} must be finite and not negative")));
    }
    if hello.protocol_version > PROTOCOL_VERSION {
        let theirs = hello.protocol_version;
        return Err(Status::failed_precondition(format!(
            "this device speaks version {theirs} of the protocol and this daemon version {PROTOCOL_VERSION}: update palpated"
        )));
    }
    let patience = [
        ("sample_rate_hz", hello.sample_rate_hz, SAMPLE_RATES_HZ, "the usual one, 1000"),
        ("pose_valid_for_s", hello.pose_valid_for_s, POSE_VALID_FOR_S, "as the daemon has it"),
    ];
    for (name, value, (least, most), usual) in patience {
        if value != 0.0 && !(least..=most).contains(&value) {
            let rule = format!("hello.{name} = {value} must be 0 ({usual}), or {least} to {most}");
            return Err(Status::invalid_argument(rule));
        }
    }
    Ok(hello)
}

/// How often a device may say that it sends (Hz).
const SAMPLE_RATES_HZ: (f64, f64) = (10.0, 1e5);
/// How long it may let a pose be used (s).
const POSE_VALID_FOR_S: (f64, f64) = (1e-3, 0.5);

/// The rate (Hz) and what is wanted beside numbers.
///
/// # Errors
/// `INVALID_ARGUMENT`.
pub fn watch_request(request: &v1::WatchRequest, display_rate_hz: f64) -> Result<(f64, Layers), Status> {
    let rate = request.max_rate_hz;
    if !(0.0..=MAX_WATCH_RATE_HZ).contains(&rate) {
        let rule = format!("max_rate_hz = {rate} must be 0 (the daemon's display rate) to {MAX_WATCH_RATE_HZ}");
        return Err(Status::invalid_argument(rule));
    }
    let vertices = match v1::LevelOfDetail::try_from(request.level_of_detail) {
        Ok(v1::LevelOfDetail::Unspecified | v1::LevelOfDetail::Full) => true,
        Ok(v1::LevelOfDetail::Numbers) => false,
        Err(_) => {
            let level = request.level_of_detail;
            return Err(Status::invalid_argument(format!("level_of_detail {level} is unknown; 0 to 2 are known")));
        }
    };
    if request.refined_surface && !vertices {
        let rule =
            "refined_surface is of vertices, which LEVEL_OF_DETAIL_NUMBERS leaves out: ask for LEVEL_OF_DETAIL_FULL";
        return Err(Status::invalid_argument(rule));
    }
    // Below one update in 1000 s a rate is a mistake of units, and its interval would overflow.
    Ok((
        if rate == 0.0 { display_rate_hz } else { rate.max(1e-3) },
        Layers { vertices, particles: request.active_particles, refined: request.refined_surface },
    ))
}

/// Forces on surface vertices become forces on nodes.
///
/// # Errors
/// `INVALID_ARGUMENT`, naming the force.
pub fn injections(
    session: &ActiveSession,
    forces: &[v1::InjectedForce],
    is_bounded: bool,
) -> Result<Vec<Injection>, Status> {
    if forces.len() > MAX_FORCES {
        return Err(Status::invalid_argument(format!("{} forces in one request; at most {MAX_FORCES}", forces.len())));
    }
    let nodes = &session.model.surface().nodes;
    let refuse = |index: usize, what: String| Status::invalid_argument(format!("forces[{index}]: {what}"));
    let convert = |(index, force): (usize, &v1::InjectedForce)| {
        let vertex = force.surface_vertex;
        let node = *nodes.get(vertex as usize).ok_or_else(|| {
            refuse(index, format!("surface_vertex {vertex} is out of range: there are {}", nodes.len()))
        })?;
        let force_n = vec3(force.force_n.ok_or_else(|| refuse(index, "force_n is missing".into()))?);
        if !force_n.is_finite() {
            return Err(refuse(index, format!("force_n = {force_n} is not finite")));
        }
        if force_n.length() > MAX_INJECTED_FORCE_N {
            return Err(refuse(
                index,
                format!("force_n = {force_n} is larger than the limit, {MAX_INJECTED_FORCE_N} N"),
            ));
        }
        if force.tick_count == 0 {
            return Err(refuse(index, "tick_count must be at least 1".into()));
        }
        if force.tick_count > MAX_INJECTED_TICKS {
            return Err(refuse(index, format!("tick_count = {} is more than {MAX_INJECTED_TICKS}", force.tick_count)));
        }
        Ok(Injection { node, force_n, from_tick: force.from_tick, tick_count: force.tick_count, is_bounded })
    };
    forces.iter().enumerate().map(convert).collect()
}

/// Ticks to step.
///
/// # Errors
/// `INVALID_ARGUMENT`.
pub fn step_ticks(ticks: u32) -> Result<u32, Status> {
    if (1..=MAX_STEP_TICKS).contains(&ticks) {
        return Ok(ticks);
    }
    Err(Status::invalid_argument(format!("ticks = {ticks} must be 1 to {MAX_STEP_TICKS}")))
}

/// A tool for viewers.
pub fn tool_state(view: &ToolView) -> v1::ToolState {
    v1::ToolState {
        device_position_m: Some(wire_vec3(view.device_position_m)),
        proxy_position_m: Some(wire_vec3(view.proxy_position_m)),
        contact_force_n: Some(wire_vec3(view.contact_force_n)),
        device_force_n: Some(wire_vec3(view.device_force_n)),
        contacts: view.contacts,
        device_orientation: Some(wire_quaternion(view.device_orientation)),
        proxy_orientation: Some(wire_quaternion(view.proxy_orientation)),
        contact_torque_nm: Some(wire_vec3(view.contact_torque_nm)),
        device_torque_nm: Some(wire_vec3(view.device_torque_nm)),
    }
}

/// A quarantine for people; empty: none.
pub fn quarantine(what: Option<Quarantine>) -> String {
    what.map_or_else(String::new, |what| {
        format!("{what}; the last good state is held, forces are zero until Reset or Restore (`palpate-view reset`)")
    })
}

/// A force for an arm.
pub fn device_command(output: &ToolOutput) -> v1::DeviceCommand {
    v1::DeviceCommand {
        tick: output.tick,
        wrench: Some(v1::Wrench {
            force_n: Some(wire_vec3(output.force_n)),
            torque_nm: Some(wire_vec3(output.torque_nm)),
        }),
        sample_sequence: output.sample_sequence,
        echo_device_time_ns: output.echo_device_time_ns,
        local_model: output.local_model.as_ref().map(|model| local_model(model, output)),
        proxy_position_m: Some(wire_vec3(output.proxy_position_m)),
        proxy_orientation: Some(wire_quaternion(output.proxy_orientation)),
        sample_waited_ns: output.sample_waited_ns,
    }
}

fn local_model(model: &LocalContactModel, output: &ToolOutput) -> v1::LocalContactModel {
    let stiffness: &DMat3 = &model.stiffness_n_per_m;
    v1::LocalContactModel {
        point_m: Some(wire_vec3(model.point_m)),
        normal: Some(wire_vec3(model.normal)),
        force_n: Some(wire_vec3(model.force_n)),
        stiffness_n_per_m: Some(v1::Mat3 { column_major: stiffness.to_cols_array().to_vec() }),
        validity_radius_m: model.validity_radius_m,
        tick: output.tick,
        max_force_n: output.model_max_force_n,
        torque: model.torque.as_ref().map(|torque| local_torque(torque, output)),
    }
}

fn local_torque(model: &LocalTorqueModel, output: &ToolOutput) -> v1::LocalTorqueModel {
    let stiffness: &DMat3 = &model.stiffness_nm_per_rad;
    v1::LocalTorqueModel {
        orientation: Some(wire_quaternion(model.orientation)),
        torque_nm: Some(wire_vec3(model.torque_nm)),
        stiffness_nm_per_rad: Some(v1::Mat3 { column_major: stiffness.to_cols_array().to_vec() }),
        validity_angle_rad: model.validity_angle_rad,
        max_torque_nm: output.model_max_torque_nm,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample() -> v1::DeviceSample {
        v1::DeviceSample {
            sequence: 5,
            pose: Some(v1::Pose {
                position_m: Some(v1::Vec3 { x: 0.1, y: 0.2, z: 0.3 }),
                orientation: Some(v1::Quaternion { w: 1.0, ..Default::default() }),
            }),
            twist: Some(v1::Twist {
                linear_m_per_s: Some(v1::Vec3::default()),
                angular_rad_per_s: Some(v1::Vec3::default()),
            }),
            ..Default::default()
        }
    }

    fn code(sample: &v1::DeviceSample, last: Option<u64>) -> Option<DeviceFaultCode> {
        device_sample(sample, last, 1, 0).err().map(|rejected| rejected.code)
    }

    fn changed(change: impl FnOnce(&mut v1::DeviceSample)) -> v1::DeviceSample {
        let mut changed = sample();
        change(&mut changed);
        changed
    }

    #[test]
    fn every_rule_has_its_own_answer() {
        let nan = Some(v1::Vec3 { x: f64::NAN, ..Default::default() });
        let far = Some(v1::Vec3 { z: -2e3, ..Default::default() });
        let fast = Some(v1::Vec3 { y: 2e4, ..Default::default() });
        let huge = Some(v1::Vec3 { y: -1e300, ..Default::default() });
        assert_eq!(code(&sample(), Some(4)), None);
        let cases = [
            (changed(|s| s.pose = None), DeviceFaultCode::MissingField),
            (changed(|s| s.twist = None), DeviceFaultCode::MissingField),
            (changed(|s| s.pose.as_mut().unwrap().position_m = None), DeviceFaultCode::MissingField),
            (changed(|s| s.pose.as_mut().unwrap().position_m = nan), DeviceFaultCode::NonFinite),
            (changed(|s| s.pose.as_mut().unwrap().position_m = far), DeviceFaultCode::OutOfRange),
            (changed(|s| s.twist.as_mut().unwrap().angular_rad_per_s = nan), DeviceFaultCode::NonFinite),
            (changed(|s| s.twist.as_mut().unwrap().angular_rad_per_s = None), DeviceFaultCode::MissingField),
            (changed(|s| s.twist.as_mut().unwrap().angular_rad_per_s = fast), DeviceFaultCode::OutOfRange),
            (changed(|s| s.measured_force_n = nan), DeviceFaultCode::NonFinite),
            (changed(|s| s.measured_force_n = huge), DeviceFaultCode::OutOfRange),
            (
                changed(|s| s.pose.as_mut().unwrap().orientation = Some(v1::Quaternion::default())),
                DeviceFaultCode::BadOrientation,
            ),
            (changed(|s| s.sequence = 4), DeviceFaultCode::OldSequence),
            (changed(|s| s.sequence = 3), DeviceFaultCode::OldSequence),
        ];
        for (bad, expected) in cases {
            assert_eq!(code(&bad, Some(4)), Some(expected), "{bad:?}");
        }
    }

    proptest! {
        #[test]
        fn whatever_is_accepted_is_finite_and_near(numbers in prop::collection::vec(any::<f64>(), 13), sequence: u64) {
            let v = |i: usize| Some(v1::Vec3 { x: numbers[i], y: numbers[i + 1], z: numbers[i + 2] });
            let q = v1::Quaternion { w: numbers[9], x: numbers[10], y: numbers[11], z: numbers[12] };
            let sample = v1::DeviceSample {
                sequence,
                pose: Some(v1::Pose { position_m: v(0), orientation: Some(q) }),
                twist: Some(v1::Twist { linear_m_per_s: v(3), angular_rad_per_s: v(6) }),
                ..Default::default()
            };
            if let Ok(input) = device_sample(&sample, None, 1, 0) {
                prop_assert!(input.position_m.abs().max_element() <= MAX_COORDINATE_M);
                prop_assert!(input.velocity_m_per_s.abs().max_element() <= MAX_SPEED_M_PER_S);
                prop_assert!(input.angular_velocity_rad_per_s.abs().max_element() <= MAX_TURN_RAD_PER_S);
                prop_assert!((input.orientation.length() - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn rates_and_levels_out_of_range_are_refused() {
        for rate in [f64::NAN, -1.0, 241.0, f64::INFINITY] {
            let request = v1::WatchRequest { max_rate_hz: rate, ..Default::default() };
            assert!(watch_request(&request, 60.0).is_err(), "{rate}");
        }
        let request = |level_of_detail| v1::WatchRequest { level_of_detail, ..Default::default() };
        assert_eq!(watch_request(&request(2), 60.0).unwrap(), (60.0, Layers::default()));
        let particles = v1::WatchRequest { active_particles: true, ..request(2) };
        assert_eq!(watch_request(&particles, 60.0).unwrap().1, Layers { particles: true, ..Layers::default() });
        let refined = |level| v1::WatchRequest { refined_surface: true, ..request(level) };
        assert!(watch_request(&refined(2), 60.0).is_err());
        assert_eq!(
            watch_request(&refined(1), 60.0).unwrap().1,
            Layers { vertices: true, particles: false, refined: true }
        );
        assert!(watch_request(&request(7), 60.0).is_err());
    }
}
