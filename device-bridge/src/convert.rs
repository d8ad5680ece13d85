//! The one border between wire types and ours. Nothing that is not finite, complete and of the right shape passes.
use crate::{device::Reading, settings::UplinkSettings};
use glam::{DMat3, DQuat, DVec3};
use palpate_control::{Fault, ForceLimits, Link, LocalModel, LocalTorque, TorqueLimits};
use palpate_proto::{PROTOCOL_VERSION, v1};
use thiserror::Error;

/// Why a message was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Rejection {
    /// A field that must be there is not.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// A number is NaN or infinite.
    #[error("{0} is not finite")]
    NotFinite(&'static str),
    /// A number has no sense, such as a negative limit or a matrix of eight values.
    #[error("{0} is out of range")]
    OutOfRange(&'static str),
    /// The daemon speaks a later version of the protocol.
    #[error(
        "the daemon speaks version {version} of the protocol and this bridge version {PROTOCOL_VERSION}: update palpate-bridge"
    )]
    Newer {
        /// The daemon's.
        version: u32,
    },
}

/// What the daemon granted.
#[derive(Debug, Clone, PartialEq)]
pub struct Welcome {
    /// Session.
    pub session_id: String,
    /// Tool.
    pub tool_name: String,
    /// Tick of the daemon (s).
    pub tick_period_s: f64,
    /// The daemon's limits.
    pub limits: ForceLimits,
    /// Stiffness (N/m) of the coupling between arm and tool, which its force has at most; 0: it has none.
    pub coupling_n_per_m: f64,
    /// The same of torque.
    pub torque_limits: TorqueLimits,
}

/// A checked command.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    /// When the pose that it answers was read (ns, this machine's monotonic clock): from here its age counts, so that every
    /// delay on the way up, in the daemon and on the way down makes it older.
    pub answers_ns: u64,
    /// Tick that computed it.
    pub tick: u64,
    /// Force on the arm (N).
    pub force_n: DVec3,
    /// Contact model, `None` out of contact.
    pub local_model: Option<LocalModel>,
    /// Its torque.
    pub local_torque: Option<LocalTorque>,
    /// Age of the model when the command was made (s).
    pub model_age_s: f64,
    /// Limits that the daemon applies to this arm.
    pub limits: ForceLimits,
    /// Torque on the arm (N m), and the daemon's limits of it.
    pub torque: (DVec3, TorqueLimits),
}

/// A measurement on its way up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Strictly increasing.
    pub sequence: u64,
    /// When the arm was read (ns).
    pub device_time_ns: u64,
    /// What was read.
    pub reading: Reading,
    /// What becomes of the force.
    pub link: Link,
}

/// The first message up.
pub fn hello(settings: &UplinkSettings) -> v1::DeviceUp {
    let (max_force_n, servo_rate_hz) = settings.hello;
    let hello = v1::DeviceHello {
        device_name: settings.device_name.clone(),
        tool_name: settings.tool.clone(),
        max_force_n,
        servo_rate_hz,
        max_torque_nm: settings.max_torque_nm,
        // A sample for every round of the servo; how old one may be is the daemon's to say.
        sample_rate_hz: servo_rate_hz,
        pose_valid_for_s: 0.0,
        protocol_version: PROTOCOL_VERSION,
    };
    v1::DeviceUp { message: Some(v1::device_up::Message::Hello(hello)) }
}

fn safety_state(link: Link) -> v1::SafetyState {
    match link {
        Link::Waiting => v1::SafetyState::Standby,
        Link::Fresh | Link::Extrapolating => v1::SafetyState::Operating,
        // One that was asked for is no fault.
        Link::Ramping(_) | Link::Latched(Fault::Requested) => v1::SafetyState::ProtectiveStop,
        Link::Latched(_) => v1::SafetyState::FaultLatched,
    }
}

/// Every later message up.
pub fn sample(sample: &Sample) -> v1::DeviceUp {
    let motion = &sample.reading.motion;
    let q = motion.orientation;
    let pose = v1::Pose {
        position_m: Some(to_wire(motion.position_m)),
        orientation: Some(v1::Quaternion { w: q.w, x: q.x, y: q.y, z: q.z }),
    };
    let twist = v1::Twist {
        linear_m_per_s: Some(to_wire(motion.velocity_m_per_s)),
        angular_rad_per_s: Some(to_wire(motion.angular_velocity_rad_per_s)),
    };
    let message = v1::DeviceSample {
        sequence: sample.sequence,
        device_time_ns: sample.device_time_ns,
        safety_state: safety_state(sample.link).into(),
        pose: Some(pose),
        twist: Some(twist),
        buttons: sample.reading.buttons,
        measured_force_n: sample.reading.measured_force_n.map(to_wire),
    };
    v1::DeviceUp { message: Some(v1::device_up::Message::Sample(message)) }
}

/// The daemon's answer to the hello.
///
/// # Errors
/// [`Rejection`] when a limit is missing or has no sense.
pub fn welcome(wire: &v1::DeviceWelcome) -> Result<Welcome, Rejection> {
    let limits = wire.limits.as_ref().ok_or(Rejection::Missing("welcome.limits"))?;
    if wire.protocol_version > PROTOCOL_VERSION {
        return Err(Rejection::Newer { version: wire.protocol_version });
    }
    Ok(Welcome {
        session_id: wire.session_id.clone(),
        tool_name: wire.tool_name.clone(),
        tick_period_s: positive("welcome.tick_period_s", wire.tick_period_s)?,
        limits: ForceLimits {
            max_force_n: positive("welcome.limits.max_force_n", limits.max_force_n)?,
            max_force_rate_n_per_s: positive("welcome.limits.max_force_rate_n_per_s", limits.max_force_rate_n_per_s)?,
        },
        coupling_n_per_m: not_negative("welcome.limits.coupling_stiffness_n_per_m", limits.coupling_stiffness_n_per_m)?,
        torque_limits: torque_limits(limits)?,
    })
}

/// A command, received at `received_ns`; `None` before the daemon has had a first pose to answer.
///
/// # Errors
/// [`Rejection`] for the whole command when any part of it is bad: half a command is no command. So is one that answers a pose
/// which was not read yet.
pub fn command(wire: &v1::DeviceCommand, welcome: &Welcome, received_ns: u64) -> Result<Option<Command>, Rejection> {
    let wrench = wire.wrench.as_ref().ok_or(Rejection::Missing("wrench"))?;
    let force_n = vector("wrench.force_n", wrench.force_n.as_ref())?;
    let torque_nm = vector("wrench.torque_nm", wrench.torque_nm.as_ref().or(Some(&v1::Vec3::default())))?;
    let local_model = wire.local_model.as_ref().map(local_model).transpose()?;
    let torque = wire.local_model.as_ref().and_then(|model| model.torque.as_ref());
    let local_torque = torque.map(local_torque).transpose()?;
    if wire.sample_sequence == 0 {
        return Ok(None);
    }
    if wire.echo_device_time_ns > received_ns {
        return Err(Rejection::OutOfRange("echo_device_time_ns"));
    }
    let model_ticks = wire.local_model.as_ref().map_or(0, |model| wire.tick.saturating_sub(model.tick));
    Ok(Some(Command {
        answers_ns: wire.echo_device_time_ns,
        tick: wire.tick,
        force_n,
        local_model,
        local_torque,
        model_age_s: model_ticks as f64 * welcome.tick_period_s,
        limits: welcome.limits,
        torque: (torque_nm, welcome.torque_limits),
    }))
}

/// A daemon that says nothing of torque sends none.
fn torque_limits(wire: &v1::DeviceLimits) -> Result<TorqueLimits, Rejection> {
    if wire.max_torque_nm == 0.0 {
        return Ok(TorqueLimits::NONE);
    }
    Ok(TorqueLimits {
        max_torque_nm: positive("welcome.limits.max_torque_nm", wire.max_torque_nm)?,
        max_torque_rate_nm_per_s: positive("welcome.limits.max_torque_rate_nm_per_s", wire.max_torque_rate_nm_per_s)?,
    })
}

fn local_model(wire: &v1::LocalContactModel) -> Result<LocalModel, Rejection> {
    let model = LocalModel {
        point_m: vector("local_model.point_m", wire.point_m.as_ref())?,
        normal: vector("local_model.normal", wire.normal.as_ref())?,
        force_n: vector("local_model.force_n", wire.force_n.as_ref())?,
        stiffness_n_per_m: matrix("local_model.stiffness_n_per_m", wire.stiffness_n_per_m.as_ref())?,
        validity_radius_m: positive("local_model.validity_radius_m", wire.validity_radius_m)?,
        max_force_n: positive("local_model.max_force_n", wire.max_force_n)?,
    };
    model.accept().ok_or(Rejection::OutOfRange("local_model.normal"))
}

fn local_torque(wire: &v1::LocalTorqueModel) -> Result<LocalTorque, Rejection> {
    let turned = wire.orientation.as_ref().ok_or(Rejection::Missing("local_model.torque.orientation"))?;
    let model = LocalTorque {
        orientation: DQuat::from_xyzw(turned.x, turned.y, turned.z, turned.w),
        torque_nm: vector("local_model.torque.torque_nm", wire.torque_nm.as_ref())?,
        stiffness_nm_per_rad: matrix("local_model.torque.stiffness_nm_per_rad", wire.stiffness_nm_per_rad.as_ref())?,
        validity_angle_rad: positive("local_model.torque.validity_angle_rad", wire.validity_angle_rad)?,
        max_torque_nm: positive("local_model.torque.max_torque_nm", wire.max_torque_nm)?,
    };
    model.accept().ok_or(Rejection::OutOfRange("local_model.torque.orientation"))
}

fn matrix(name: &'static str, wire: Option<&v1::Mat3>) -> Result<DMat3, Rejection> {
    let columns = &wire.ok_or(Rejection::Missing(name))?.column_major;
    let columns: &[f64; 9] = columns.as_slice().try_into().map_err(|_| Rejection::OutOfRange(name))?;
    let matrix = DMat3::from_cols_array(columns);
    if matrix.is_finite() { Ok(matrix) } else { Err(Rejection::NotFinite(name)) }
}

fn vector(name: &'static str, wire: Option<&v1::Vec3>) -> Result<DVec3, Rejection> {
    let v = wire.ok_or(Rejection::Missing(name))?;
    let v = DVec3::new(v.x, v.y, v.z);
    if v.is_finite() { Ok(v) } else { Err(Rejection::NotFinite(name)) }
}

fn positive(name: &'static str, value: f64) -> Result<f64, Rejection> {
    if value == 0.0 { Err(Rejection::OutOfRange(name)) } else { not_negative(name, value) }
}

fn not_negative(name: &'static str, value: f64) -> Result<f64, Rejection> {
    if !value.is_finite() {
        Err(Rejection::NotFinite(name))
    } else if value < 0.0 {
        Err(Rejection::OutOfRange(name))
    } else {
        Ok(value)
    }
}

fn to_wire(v: DVec3) -> v1::Vec3 {
    v1::Vec3 { x: v.x, y: v.y, z: v.z }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn welcomed() -> Welcome {
        Welcome {
            session_id: "s".into(),
            tool_name: "t".into(),
            tick_period_s: 1e-3,
            limits: ForceLimits { max_force_n: 3.0, max_force_rate_n_per_s: 1000.0 },
            coupling_n_per_m: 300.0,
            torque_limits: TorqueLimits { max_torque_nm: 0.1, max_torque_rate_nm_per_s: 20.0 },
        }
    }

    fn good() -> v1::DeviceCommand {
        let vec = |x, y, z| Some(v1::Vec3 { x, y, z });
        v1::DeviceCommand {
            tick: 17,
            wrench: Some(v1::Wrench { force_n: vec(0.0, 0.0, 1.0), torque_nm: vec(0.0, 0.02, 0.0) }),
            sample_sequence: 5,
            echo_device_time_ns: 7,
            local_model: Some(v1::LocalContactModel {
                point_m: vec(0.1, 0.0, 0.0),
                normal: vec(0.0, 0.0, 1.0),
                force_n: vec(0.0, 0.0, 1.0),
                stiffness_n_per_m: Some(v1::Mat3 {
                    column_major: vec![-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -400.0],
                }),
                validity_radius_m: 1e-3,
                tick: 14,
                max_force_n: 3.0,
                torque: Some(v1::LocalTorqueModel {
                    orientation: Some(v1::Quaternion { w: 1.0, x: 0.0, y: 0.0, z: 0.0 }),
                    torque_nm: vec(0.0, 0.02, 0.0),
                    stiffness_nm_per_rad: Some(v1::Mat3 { column_major: vec![-0.1; 9] }),
                    validity_angle_rad: 0.1,
                    max_torque_nm: 0.1,
                }),
            }),
            proxy_position_m: vec(0.1, 0.0, 0.0),
            proxy_orientation: None,
            sample_waited_ns: Some(300_000),
        }
    }

    #[test]
    fn a_good_command_passes_whole() {
        let command = command(&good(), &welcomed(), 99).unwrap().unwrap();
        assert_eq!((command.answers_ns, command.tick, command.force_n), (7, 17, DVec3::Z));
        assert_eq!(command.torque, (DVec3::Y * 0.02, welcomed().torque_limits));
        assert!((command.model_age_s - 3e-3).abs() < 1e-15);
        let model = command.local_model.unwrap();
        assert_eq!(model.stiffness_n_per_m.z_axis, DVec3::new(0.0, 0.0, -400.0));
        let torque = command.local_torque.unwrap();
        assert_eq!((torque.torque_nm, torque.orientation), (DVec3::Y * 0.02, DQuat::IDENTITY));
    }

    #[test]
    fn a_command_without_a_pose_is_none_and_one_from_the_future_is_refused() {
        let unasked = v1::DeviceCommand { sample_sequence: 0, echo_device_time_ns: 0, ..good() };
        assert_eq!(command(&unasked, &welcomed(), 99), Ok(None));
        assert_eq!(command(&good(), &welcomed(), 6), Err(Rejection::OutOfRange("echo_device_time_ns")));
    }

    #[test]
    fn every_bad_part_refuses_the_command_and_is_named() {
        type Spoil = fn(&mut v1::DeviceCommand);
        fn torque(command: &mut v1::DeviceCommand) -> &mut v1::LocalTorqueModel {
            command.local_model.as_mut().unwrap().torque.as_mut().unwrap()
        }
        let cases: [(Spoil, &str); 14] = [
            (|c| c.wrench = None, "wrench is missing"),
            (|c| c.wrench.as_mut().unwrap().force_n = None, "wrench.force_n is missing"),
            (|c| c.wrench.as_mut().unwrap().force_n.as_mut().unwrap().y = f64::NAN, "wrench.force_n is not finite"),
            (
                |c| c.wrench.as_mut().unwrap().torque_nm.as_mut().unwrap().x = f64::INFINITY,
                "wrench.torque_nm is not finite",
            ),
            (
                |c| c.local_model.as_mut().unwrap().normal.as_mut().unwrap().z = 0.5,
                "local_model.normal is out of range",
            ),
            (|c| c.local_model.as_mut().unwrap().point_m = None, "local_model.point_m is missing"),
            (
                |c| c.local_model.as_mut().unwrap().validity_radius_m = 0.0,
                "local_model.validity_radius_m is out of range",
            ),
            (|c| c.local_model.as_mut().unwrap().max_force_n = 0.0, "local_model.max_force_n is out of range"),
            (|c| c.local_model.as_mut().unwrap().stiffness_n_per_m = None, "local_model.stiffness_n_per_m is missing"),
            (
                |c| {
                    c.local_model.as_mut().unwrap().stiffness_n_per_m.as_mut().unwrap().column_major.pop();
                },
                "local_model.stiffness_n_per_m is out of range",
            ),
            (
                |c| c.local_model.as_mut().unwrap().stiffness_n_per_m.as_mut().unwrap().column_major[4] = f64::NAN,
                "local_model.stiffness_n_per_m is not finite",
            ),
            (|c| torque(c).torque_nm = None, "local_model.torque.torque_nm is missing"),
            (|c| torque(c).max_torque_nm = f64::NAN, "local_model.torque.max_torque_nm is not finite"),
            (|c| torque(c).orientation.as_mut().unwrap().x = 2.0, "local_model.torque.orientation is out of range"),
        ];
        for (spoil, message) in cases {
            let mut wire = good();
            spoil(&mut wire);
            assert_eq!(command(&wire, &welcomed(), 99).unwrap_err().to_string(), message);
        }
    }

    #[test]
    fn a_welcome_needs_sensible_limits() {
        let limits = v1::DeviceLimits { max_force_n: 3.0, max_force_rate_n_per_s: f64::NAN, ..Default::default() };
        let wire = v1::DeviceWelcome { tick_period_s: 1e-3, limits: Some(limits), ..Default::default() };
        assert_eq!(welcome(&wire), Err(Rejection::NotFinite("welcome.limits.max_force_rate_n_per_s")));
        let wire = v1::DeviceWelcome { tick_period_s: 1e-3, ..Default::default() };
        assert_eq!(welcome(&wire), Err(Rejection::Missing("welcome.limits")));
    }
}
