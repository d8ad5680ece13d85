//! The other end of a connection: its numbers for senders and types, and its messages by their names.
use super::{
    payload,
    wire::{self, Header, Malformed, Outgoing, Received, Time},
};
use std::ops::Range;

/// Types of messages that have a meaning here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)] // as [`Kind::name`] has it
pub enum Kind {
    Ping,
    Pong,
    Pose,
    Velocity,
    ButtonChange,
    ButtonStates,
    Force,
    ForceField,
    ForceError,
}

impl Kind {
    /// All of them: each one's place is its number in what we send.
    pub const ALL: [Self; 9] = [
        Self::Ping,
        Self::Pong,
        Self::Pose,
        Self::Velocity,
        Self::ButtonChange,
        Self::ButtonStates,
        Self::Force,
        Self::ForceField,
        Self::ForceError,
    ];

    /// Its name on the wire.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Ping => "vrpn_Base ping_message",
            Self::Pong => "vrpn_Base pong_message",
            Self::Pose => "vrpn_Tracker Pos_Quat",
            Self::Velocity => "vrpn_Tracker Velocity",
            Self::ButtonChange => "vrpn_Button Change",
            Self::ButtonStates => "vrpn_Button States",
            Self::Force => "vrpn_ForceDevice Force",
            Self::ForceField => "vrpn_ForceDevice Force_Field",
            Self::ForceError => "vrpn_ForceDevice Force_Error",
        }
    }

    /// The header of a message of ours.
    pub fn header(self, sender: usize, time: Time) -> Header {
        Header { time, sender: sender as i32, kind: self as i32 }
    }
}

/// Tells the other end our names of senders and types.
pub fn describe(senders: &[String], out: &mut Outgoing) {
    let time = Time::now();
    let named = |kind, id: usize, name: &str, out: &mut Outgoing| {
        out.message(Header { time, sender: id as i32, kind }, |into| payload::write_name(name, into));
    };
    for (id, name) in senders.iter().enumerate() {
        named(wire::SENDER_DESCRIPTION, id, name, out);
    }
    for kind in Kind::ALL {
        named(wire::TYPE_DESCRIPTION, kind as usize, kind.name(), out);
    }
}

/// A message that concerns us.
#[derive(Debug, Clone)]
pub struct Told {
    /// Place of its sender among our names.
    pub sender: usize,
    /// Its type.
    pub kind: Kind,
    /// When it was made, by the clock of its sender.
    pub time: Time,
    payload: Range<usize>,
}

/// The other end.
#[derive(Debug)]
pub struct Peer {
    /// Its bytes.
    pub received: Received,
    names: Vec<String>,
    /// For each of its numbers, the place among our names.
    senders: Vec<Option<usize>>,
    /// For each of its numbers, the place among [`Kind::ALL`].
    kinds: Vec<Option<usize>>,
}

impl Peer {
    /// Of whom messages of senders with these names concern us.
    pub fn new(names: Vec<String>) -> Self {
        let unknown = vec![None; wire::MOST_IDS];
        Self { received: Received::default(), names, senders: unknown.clone(), kinds: unknown }
    }

    /// The next message that is whole and concerns us; descriptions before it are taken.
    ///
    /// # Errors
    /// [`Malformed`].
    pub fn next_told(&mut self) -> Result<Option<Told>, Malformed> {
        while let Some((header, payload)) = self.received.next_message()? {
            let (sender, kind) = (header.sender, header.kind);
            if matches!(kind, wire::SENDER_DESCRIPTION | wire::TYPE_DESCRIPTION) {
                self.learn(&header, payload)?;
            } else if let (Some(sender), Some(kind)) = (known(&self.senders, sender), known(&self.kinds, kind)) {
                return Ok(Some(Told { sender, kind: Kind::ALL[kind], time: header.time, payload }));
            }
        }
        Ok(None)
    }

    /// The payload of the last message.
    pub fn payload(&self, told: &Told) -> &[u8] {
        self.received.payload(told.payload.clone())
    }

    /// Whether it has named this one of our names.
    pub fn has(&self, name: usize) -> bool {
        self.senders.contains(&Some(name))
    }

    fn learn(&mut self, header: &Header, payload: Range<usize>) -> Result<(), Malformed> {
        let name = payload::parse_name(self.received.payload(payload)).ok_or(Malformed)?;
        let (table, place) = if header.kind == wire::SENDER_DESCRIPTION {
            (&mut self.senders, self.names.iter().position(|known| known.as_bytes() == name))
        } else {
            (&mut self.kinds, Kind::ALL.iter().position(|known| known.name().as_bytes() == name))
        };
        let id = usize::try_from(header.sender).map_err(|_| Malformed)?;
        *table.get_mut(id).ok_or(Malformed)? = place;
        Ok(())
    }
}

fn known(table: &[Option<usize>], number: i32) -> Option<usize> {
    *table.get(usize::try_from(number).ok()?)?
}

#[cfg(test)]
mod tests {
    use super::*;

    fn feed(peer: &mut Peer, bytes: &[u8]) {
        peer.received.room()[..bytes.len()].copy_from_slice(bytes);
        peer.received.came(bytes.len());
    }

    #[test]
    fn messages_are_known_by_names_whatever_their_numbers() {
        assert!(Kind::ALL.iter().enumerate().all(|(place, kind)| *kind as usize == place));
        let mut peer = Peer::new(vec!["Arm".into(), "Grip".into()]);
        let mut out = Outgoing::default();
        let header = |sender, kind| Header { time: Time::default(), sender, kind };
        // Not described yet, so it means nothing.
        out.message(header(17, 1999), |_| ());
        out.message(header(17, wire::SENDER_DESCRIPTION), |into| payload::write_name("Grip", into));
        out.message(header(1999, wire::TYPE_DESCRIPTION), |into| payload::write_name("vrpn_Button Change", into));
        out.message(header(3, wire::TYPE_DESCRIPTION), |into| payload::write_name("vrpn_Text", into));
        out.message(header(9999, wire::UDP_DESCRIPTION), |into| into.extend_from_slice(b"127.0.0.1\0"));
        out.message(header(17, 3), |_| ());
        out.message(header(17, 1999), |into| payload::write_change(1, true, into));
        feed(&mut peer, out.bytes());
        let told = peer.next_told().unwrap().unwrap();
        assert_eq!((told.sender, told.kind), (1, Kind::ButtonChange));
        assert_eq!(payload::parse_change(peer.payload(&told)), Some((1, true)));
        assert!(peer.next_told().unwrap().is_none() && peer.has(1) && !peer.has(0));
    }

    #[test]
    fn a_number_no_name_can_have_is_malformed() {
        for id in [-1, 2000] {
            let (mut peer, mut out) = (Peer::new(Vec::new()), Outgoing::default());
            let header = Header { time: Time::default(), sender: id, kind: wire::SENDER_DESCRIPTION };
            out.message(header, |into| payload::write_name("x", into));
            feed(&mut peer, out.bytes());
            assert_eq!(peer.next_told().unwrap_err(), Malformed);
        }
    }
}
