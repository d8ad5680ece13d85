//! An Inverse service's messages: JSON, one state of all devices for each command.
use super::Dialect;
use crate::device::Fault;
use glam::{DQuat, DVec3};
use serde::Deserialize;
use serde_json::{Value, json};

/// No arm on a table reaches so far (m).
const FARTHEST_M: f64 = 10.0;
/// Nor moves so fast (m/s).
const FASTEST_M_PER_S: f64 = 100.0;
/// A rotation's quaternion is as long as 1, give or take so much.
const UNIT_WITHIN: f64 = 0.1;

/// What a message says of the arm that was asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Where the tool is (m, the service's axes).
    pub position_m: DVec3,
    /// How it moves (m/s).
    pub velocity_m_per_s: DVec3,
    /// The grip, if there is one.
    pub grip: Option<Grip>,
}

/// What a grip says. It is an extra: nothing it says loses the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grip {
    /// Its orientation, if it tells a rotation.
    pub orientation: Option<DQuat>,
    /// Bit 0 is button a, bit 1 b, bit 2 c; the one button of a grip on a cable is bit 0.
    pub buttons: u32,
}

/// An arm of the first message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Found {
    /// Its name.
    pub device_id: String,
    /// It knows where it is; so does one that does not say.
    pub is_calibrated: bool,
}

#[derive(Deserialize)]
struct Message {
    inverse3: Vec<Device>,
    #[serde(default)]
    wireless_verse_grip: Vec<Device>,
    #[serde(default)]
    verse_grip: Vec<Device>,
}

/// State and status are looked into where they are asked for: those of others do not matter.
#[derive(Deserialize)]
struct Device {
    #[serde(rename = "device_id")]
    name: String,
    #[serde(default)]
    state: Value,
    #[serde(default)]
    status: Value,
}

#[derive(Deserialize)]
struct Cursor {
    cursor_position: Vector,
    cursor_velocity: Vector,
}

#[derive(Clone, Copy, Deserialize)]
struct Vector {
    x: f64,
    y: f64,
    z: f64,
}

#[derive(Deserialize)]
struct Quaternion {
    w: f64,
    x: f64,
    y: f64,
    z: f64,
}

/// The arms that a first message tells of.
///
/// # Errors
/// [`Fault::Garbled`].
pub fn arms(message: &[u8]) -> Result<Vec<Found>, Fault> {
    let message: Message = serde_json::from_slice(message).map_err(|_| Fault::Garbled)?;
    let found = |device: Device| Found {
        is_calibrated: device.status["calibrated"].as_bool().unwrap_or(true),
        device_id: device.name,
    };
    Ok(message.inverse3.into_iter().map(found).collect())
}

/// What a message says of the arm `arm`, and of the grip `grip`; with an empty name, of the first grip there is.
///
/// # Errors
/// [`Fault::Garbled`], or [`Fault::Disconnected`] when the service no longer has the arm.
pub fn state(message: &[u8], arm: &str, grip: &str) -> Result<State, Fault> {
    let message: Message = serde_json::from_slice(message).map_err(|_| Fault::Garbled)?;
    let device = message.inverse3.iter().find(|device| device.name == arm).ok_or(Fault::Disconnected)?;
    let cursor = Cursor::deserialize(&device.state).map_err(|_| Fault::Garbled)?;
    let grips = || message.wireless_verse_grip.iter().chain(&message.verse_grip);
    Ok(State {
        position_m: within(cursor.cursor_position, FARTHEST_M)?,
        velocity_m_per_s: within(cursor.cursor_velocity, FASTEST_M_PER_S)?,
        grip: grips().find(|device| grip.is_empty() || device.name == grip).map(read_grip),
    })
}

fn within(v: Vector, most: f64) -> Result<DVec3, Fault> {
    let v = DVec3::new(v.x, v.y, v.z);
    if v.abs().max_element() <= most { Ok(v) } else { Err(Fault::Garbled) }
}

fn read_grip(device: &Device) -> Grip {
    let orientation = Quaternion::deserialize(&device.state["orientation"]).ok().and_then(|q| {
        let q = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
        ((q.length() - 1.0).abs() <= UNIT_WITHIN).then(|| q.normalize())
    });
    let pressed = |button: &Value| u32::from(button.as_bool().unwrap_or(false));
    let buttons = &device.state["buttons"];
    let of_one = pressed(&device.state["button"]);
    let of_three = ["a", "b", "c"].iter().enumerate().map(|(bit, name)| pressed(&buttons[name]) << bit).sum::<u32>();
    Grip { orientation, buttons: of_one | of_three }
}

/// A command: this force (N, the service's axes) on the arm.
pub fn command(dialect: Dialect, arm: &str, force_n: DVec3) -> String {
    let DVec3 { x, y, z } = force_n;
    let force = match dialect {
        Dialect::Values => json!({ "values": { "x": x, "y": y, "z": z } }),
        Dialect::Vector => json!({ "vector": { "x": x, "y": y, "z": z }, "execute": true }),
    };
    json!({ "inverse3": [{ "device_id": arm, "commands": { "set_cursor_force": force } }] }).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::f64::consts::FRAC_1_SQRT_2;

    /// As the service's documentation shows it, with two arms.
    const FIRST: &str = r#"{"session_id": 7, "inverse3": [
        {"device_id": "04BA", "config": {"type": "inverse3"}, "state": {"cursor_position": null}, "status": {"calibrated": false}},
        {"device_id": "049D", "state": {"cursor_position": {"x": 0.078, "y": -0.148, "z": 0.143},
            "cursor_velocity": {"x": -0.012, "y": 1e-3, "z": 0}, "mode": "idle"}, "status": {"calibrated": true, "ready": true}}],
      "verse_grip": [{"device_id": "61548", "state": {"button": true, "hall": 0, "orientation": {"x": 0, "y": 0, "z": 0, "w": -1}}}],
      "wireless_verse_grip": [{"device_id": "2", "state": {"buttons": {"a": false, "b": true, "c": true}, "hall": 3,
            "orientation": {"x": 0.7071, "y": 0, "z": 0, "w": 0.7071}, "battery_level": 0.9}}]}"#;

    fn spoilt(from: &str, to: &str) -> Result<State, Fault> {
        assert!(FIRST.contains(from), "{from}");
        state(FIRST.replace(from, to).as_bytes(), "049D", "")
    }

    #[test]
    fn an_arm_and_its_grip_are_found_among_others() {
        let found = |device_id: &str, is_calibrated| Found { device_id: device_id.into(), is_calibrated };
        assert_eq!(arms(FIRST.as_bytes()), Ok(vec![found("04BA", false), found("049D", true)]));
        let told = state(FIRST.as_bytes(), "049D", "").unwrap();
        assert_eq!(told.position_m, DVec3::new(0.078, -0.148, 0.143));
        assert_eq!(told.velocity_m_per_s, DVec3::new(-0.012, 0.001, 0.0));
        let grip = told.grip.unwrap();
        assert_eq!(grip.buttons, 0b110);
        let turned = DQuat::from_xyzw(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2);
        assert!(grip.orientation.unwrap().angle_between(turned) < 1e-7);
        let wired = state(FIRST.as_bytes(), "049D", "61548").unwrap().grip.unwrap();
        assert_eq!((wired.buttons, wired.orientation.unwrap().w), (1, -1.0));
        assert_eq!(state(FIRST.as_bytes(), "049D", "none").unwrap().grip, None);
    }

    #[test]
    fn what_lacks_a_part_or_is_out_of_all_reach_is_garbled() {
        for (from, to) in [
            ("\"cursor_velocity\"", "\"velocity\""),
            ("0.078", "\"0.078\""),
            ("0.078", "null"),
            ("0.078", "NaN"),
            ("0.078", "1e999"),
            ("0.078", "1e300"),
            ("1e-3", "-101"),
            ("{\"session_id\"", "[\"session_id\""),
            ("\"inverse3\": [", "\"inverse4\": ["),
        ] {
            assert_eq!(spoilt(from, to), Err(Fault::Garbled), "{to}");
        }
        assert_eq!(spoilt("049D", "0000"), Err(Fault::Disconnected), "the service lost it");
    }

    #[test]
    fn whatever_a_grip_says_the_arm_is_not_lost() {
        for to in ["{\"x\": 0, \"y\": 0, \"z\": 0, \"w\": 0}", "null", "{\"w\": 1e300, \"x\": 1, \"y\": 1, \"z\": 1}"] {
            let grip = spoilt("{\"x\": 0.7071, \"y\": 0, \"z\": 0, \"w\": 0.7071}", to).unwrap().grip.unwrap();
            assert_eq!((grip.orientation, grip.buttons), (None, 0b110), "{to}");
        }
        assert_eq!(spoilt("{\"a\": false, \"b\": true, \"c\": true}", "7").unwrap().grip.unwrap().buttons, 0);
    }

    #[test]
    fn either_dialect_says_the_force_and_a_name_is_quoted() {
        let read =
            |dialect| serde_json::from_str::<Value>(&command(dialect, "0\"4", DVec3::new(1.0, -2.5, 1e-7))).unwrap();
        let vector = json!({ "x": 1.0, "y": -2.5, "z": 1e-7 });
        let [old, new] = [Dialect::Values, Dialect::Vector].map(|dialect| read(dialect)["inverse3"][0].clone());
        assert_eq!(old["commands"], json!({ "set_cursor_force": { "values": vector } }));
        assert_eq!(new["commands"], json!({ "set_cursor_force": { "vector": vector, "execute": true } }));
        assert_eq!((&old["device_id"], &new["device_id"]), (&json!("0\"4"), &json!("0\"4")));
    }

    proptest! {
        #[test]
        fn any_bytes_are_a_state_or_none(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let _ = (arms(&bytes), state(&bytes, "049D", ""));
        }

        /// Bytes put into the place of others of a good message: what passes is finite and within reach.
        #[test]
        fn a_spoilt_message_tells_nothing_wild(
            splice in prop::collection::vec(any::<u8>(), 0..20), at in 0..FIRST.len(), cut in 0..20_usize,
        ) {
            let mut bytes = FIRST.as_bytes().to_vec();
            bytes.splice(at..(at + cut).min(bytes.len()), splice);
            if let Ok(told) = state(&bytes, "049D", "") {
                prop_assert!(told.position_m.length() < 18.0 && told.velocity_m_per_s.length() < 180.0);
                let orientation = told.grip.and_then(|grip| grip.orientation);
                prop_assert!(orientation.is_none_or(DQuat::is_normalized));
            }
        }
    }
}
