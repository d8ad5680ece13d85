//! What VRPN's servers send to the driver, and its clients to the bridge's own server.
use glam::DVec3;
use palpate_bridge::device::{
    Fault,
    vrpn::{
        heard::{Heard, Senders},
        payload::{self, ForceField, Pose, Velocity},
        peer::{Kind, Peer, Told},
        wire::{self, COOKIE_BYTES, Header, LONGEST_PAYLOAD, Malformed, Outgoing, Received},
    },
};

/// Puts as much of the bytes into the room as has room there; what is left.
fn put<'a>(bytes: &'a [u8], received: &mut Received) -> &'a [u8] {
    let room = received.room();
    assert!((1..=2 * LONGEST_PAYLOAD).contains(&room.len()), "room for {} bytes", room.len());
    let (now, later) = bytes.split_at(room.len().min(bytes.len()));
    room[..now.len()].copy_from_slice(now);
    received.came(now.len());
    later
}

type Message = (Header, Vec<u8>);

/// Messages that come in pieces of so many bytes, until one is malformed.
fn messages(bytes: &[u8], piece: usize) -> (Vec<Message>, Result<(), Malformed>) {
    let (mut received, mut found) = (Received::default(), Vec::new());
    for mut rest in bytes.chunks(piece) {
        while !rest.is_empty() {
            rest = put(rest, &mut received);
            loop {
                match received.next_message() {
                    Ok(Some((header, at))) => found.push((header, received.payload(at).to_vec())),
                    Ok(None) => break,
                    Err(malformed) => return (found, Err(malformed)),
                }
            }
        }
    }
    (found, Ok(()))
}

/// Messages are the same however they are cut, and the same when they are sent again.
pub fn vrpn_wire(bytes: &[u8]) -> bool {
    let whole = messages(bytes, bytes.len().max(1));
    for piece in [1, 7, 1000] {
        assert_eq!(messages(bytes, piece), whole, "in pieces of {piece}");
    }
    let mut out = Outgoing::default();
    for (header, payload) in &whole.0 {
        out.message(*header, |into| into.extend_from_slice(payload));
    }
    let is_some = !whole.0.is_empty();
    assert_eq!(messages(out.bytes(), 999), (whole.0, Ok(())));
    if let Some(cookie) = bytes.first_chunk::<COOKIE_BYTES>() {
        let mut received = Received::default();
        put(cookie, &mut received);
        assert_eq!((received.cookie(), received.cookie()), (Some(*cookie), None));
        let _ = wire::is_cookie(cookie);
    }
    is_some
}

fn written(write: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(&mut bytes);
    bytes
}

/// What a payload says is finite, and the same when it is written and read again.
pub fn vrpn_payload(bytes: &[u8]) -> bool {
    if let Some(pose) = Pose::parse(bytes) {
        assert!(pose.position_m.is_finite() && (pose.orientation.length() - 1.0).abs() < 1e-9, "{pose:?}");
        let again = Pose::parse(&written(|into| pose.write(into)));
        assert!(again.is_some_and(|again| again.position_m == pose.position_m
            && again.sensor == pose.sensor
            && again.orientation.abs_diff_eq(pose.orientation, 1e-12)));
    }
    if let Some(velocity) = Velocity::parse(bytes) {
        assert!(velocity.velocity_m_per_s.is_finite() && velocity.angular_velocity_rad_per_s.is_finite());
        let again = Velocity::parse(&written(|into| velocity.write(into)));
        assert!(again.is_some_and(|again| again.velocity_m_per_s == velocity.velocity_m_per_s), "{velocity:?}");
    }
    if let Some((button, is_pressed)) = payload::parse_change(bytes) {
        let again = written(|into| payload::write_change(button, is_pressed, into));
        assert_eq!(payload::parse_change(&again), Some((button, is_pressed)));
    }
    if let Some(buttons) = payload::parse_states(bytes) {
        let again = written(|into| payload::write_states(buttons, u32::BITS, into));
        assert_eq!(payload::parse_states(&again), Some(buttons));
    }
    if let Some(force_n) = payload::parse_force(bytes) {
        assert!(force_n.is_finite());
        assert_eq!(payload::parse_force(&written(|into| payload::write_force(force_n, into))), Some(force_n));
    }
    if let Some(field) = ForceField::parse(bytes) {
        assert!(field.force_at_n(DVec3::new(0.1, -0.2, 0.3)).is_finite(), "{field:?}");
        assert_eq!(ForceField::parse(&written(|into| field.write(into))), Some(field));
    }
    if let Some(name) = payload::parse_name(bytes)
        && let Ok(name) = std::str::from_utf8(name)
    {
        let again = written(|into| payload::write_name(name, into));
        assert_eq!(payload::parse_name(&again), Some(name.as_bytes()));
    }
    let _ = payload::parse_error(bytes);
    Pose::parse(bytes).is_some()
}

/// All that a driver knows after these bytes.
#[derive(Debug, PartialEq)]
struct Known {
    end: Result<(), Fault>,
    pose: Option<Pose>,
    velocity: Option<Velocity>,
    force_n: Option<DVec3>,
    /// Buttons, pings, names.
    bits: (u32, u32, [bool; 3]),
}

fn driver(bytes: &[u8], piece: usize) -> Known {
    let senders = Senders { tracker: 0, sensor: 1, button: Some(1), force: Some(2) };
    let mut peer = Peer::new(["Arm", "Grip", "Motors"].map(str::to_owned).to_vec());
    let mut heard = Heard::new(senders);
    let end = told(bytes, piece, &mut peer, |told, payload| heard.take(told.sender, told.kind, told.time, payload));
    let names = std::array::from_fn(|name| peer.has(name));
    let (pose, velocity, force_n) = (heard.new_pose(), heard.velocity(), heard.force_n());
    Known { end, pose, velocity, force_n, bits: (heard.buttons(), heard.take_pings(), names) }
}

/// Pings that the bridge's own server is to answer, to a program that speaks so.
fn server(bytes: &[u8], piece: usize) -> (usize, Result<(), Fault>) {
    let (mut peer, mut pings) = (Peer::new(vec!["Arm".to_owned()]), 0);
    let end = told(bytes, piece, &mut peer, |told, _| {
        pings += usize::from(told.kind == Kind::Ping);
        Ok(())
    });
    (pings, end)
}

fn told(
    bytes: &[u8],
    piece: usize,
    peer: &mut Peer,
    mut take: impl FnMut(&Told, &[u8]) -> Result<(), Fault>,
) -> Result<(), Fault> {
    for mut rest in bytes.chunks(piece) {
        while !rest.is_empty() {
            rest = put(rest, &mut peer.received);
            while let Some(told) = peer.next_told().map_err(|_| Fault::Garbled)? {
                take(&told, peer.payload(&told))?;
            }
        }
    }
    Ok(())
}

/// A peer is understood in the same way however its messages are cut; numbers are finite, and bytes alone lose an arm by two faults only.
pub fn vrpn_peer(bytes: &[u8]) -> bool {
    let whole = driver(bytes, bytes.len().max(1));
    for piece in [1, 17] {
        assert_eq!(driver(bytes, piece), whole, "in pieces of {piece}");
    }
    assert!(matches!(whole.end, Ok(()) | Err(Fault::Garbled | Fault::Refused)), "{whole:?}");
    assert!(whole.pose.is_none_or(|pose| pose.position_m.is_finite() && pose.orientation.is_finite()), "{whole:?}");
    assert!(whole.velocity.is_none_or(|v| v.velocity_m_per_s.is_finite() && v.angular_velocity_rad_per_s.is_finite()));
    assert!(whole.force_n.is_none_or(DVec3::is_finite), "{whole:?}");
    assert_eq!(server(bytes, 5), server(bytes, bytes.len().max(1)));
    whole.pose.is_some() && whole.velocity.is_some() && whole.force_n.is_some()
}
