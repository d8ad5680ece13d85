//! A moment as VRPN messages: what one program is told, given what it was told before.
use super::moment::Moment;
use crate::device::vrpn::{
    payload::{self, ForceField, Pose, Velocity},
    peer::{self, Kind},
    wire::{Outgoing, Time},
};

/// As many as a reading has room for.
const BUTTONS: u32 = u32::BITS;
/// Our only name's number.
const ARM: usize = 0;
/// The arm's only sensor.
const SENSOR: i32 = 0;

/// What a program knows.
#[derive(Debug, Default)]
pub(super) struct Report {
    buttons: u32,
    is_in_contact: bool,
}

impl Report {
    /// Our name, and all buttons.
    pub(super) fn greet(&mut self, name: &str, newest: Option<&Moment>, out: &mut Outgoing) {
        peer::describe(&[name.to_owned()], out);
        self.buttons = newest.map_or(0, |moment| moment.reading.buttons);
        self.tell_buttons(Time::now(), out);
    }

    /// A moment, whose arm was read then.
    pub(super) fn tell(&mut self, moment: &Moment, time: Time, out: &mut Outgoing) {
        let Moment { reading, force_n, contact, .. } = moment;
        let motion = &reading.motion;
        let pose = Pose { sensor: SENSOR, position_m: motion.position_m, orientation: motion.orientation };
        out.message(Kind::Pose.header(ARM, time), |into| pose.write(into));
        let velocity = Velocity {
            sensor: SENSOR,
            velocity_m_per_s: motion.velocity_m_per_s,
            angular_velocity_rad_per_s: motion.angular_velocity_rad_per_s,
        };
        out.message(Kind::Velocity.header(ARM, time), |into| velocity.write(into));
        let changed = self.buttons ^ reading.buttons;
        for button in (0..BUTTONS).filter(|button| changed >> button & 1 == 1) {
            let is_pressed = reading.buttons >> button & 1 == 1;
            let header = Kind::ButtonChange.header(ARM, time);
            out.message(header, |into| payload::write_change(button.cast_signed(), is_pressed, into));
        }
        self.buttons = reading.buttons;
        out.message(Kind::Force.header(ARM, time), |into| payload::write_force(*force_n, into));
        // A field that ends is told once, as a field of nothing.
        let field = contact.map_or(ForceField::NONE, |model| ForceField {
            origin_m: model.point_m,
            force_n: model.force_n,
            jacobian_n_per_m: model.stiffness_n_per_m,
            radius_m: model.validity_radius_m,
        });
        if contact.is_some() || std::mem::take(&mut self.is_in_contact) {
            out.message(Kind::ForceField.header(ARM, time), |into| field.write(into));
        }
        self.is_in_contact = contact.is_some();
    }

    /// The answer to a ping; who pings is new, and does not know the buttons.
    pub(super) fn answer(&self, out: &mut Outgoing) {
        let time = Time::now();
        out.message(Kind::Pong.header(ARM, time), |_| ());
        self.tell_buttons(time, out);
    }

    fn tell_buttons(&self, time: Time, out: &mut Outgoing) {
        let header = Kind::ButtonStates.header(ARM, time);
        out.message(header, |into| payload::write_states(self.buttons, BUTTONS, into));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{Witness, vrpn::peer::Peer};
    use glam::{DMat3, DVec3};
    use palpate_control::LocalModel;

    fn kinds(peer: &mut Peer, out: &mut Outgoing) -> Vec<Kind> {
        let bytes = out.bytes();
        peer.received.room()[..bytes.len()].copy_from_slice(bytes);
        peer.received.came(bytes.len());
        out.clear();
        std::iter::from_fn(|| peer.next_told().unwrap()).map(|told| told.kind).collect()
    }

    #[test]
    fn buttons_are_told_when_they_change_and_a_contact_that_ends_is_told_once() {
        let mut moment = Moment {
            number: 1,
            read_ns: 0,
            reading: Witness::at_rest(),
            force_n: DVec3::Z,
            contact: Some(LocalModel {
                point_m: DVec3::X,
                normal: DVec3::Z,
                force_n: DVec3::Z,
                stiffness_n_per_m: DMat3::IDENTITY,
                validity_radius_m: 0.01,
                max_force_n: 3.0,
            }),
        };
        let (mut report, mut out) = (Report::default(), Outgoing::default());
        let mut peer = Peer::new(vec!["Palpate0".into()]);
        report.greet("Palpate0", Some(&moment), &mut out);
        assert_eq!(kinds(&mut peer, &mut out), [Kind::ButtonStates]);
        let mut told = |moment: &Moment| {
            report.tell(moment, Time::default(), &mut out);
            kinds(&mut peer, &mut out)
        };
        let always = [Kind::Pose, Kind::Velocity, Kind::Force];
        assert_eq!(told(&moment), [Kind::Pose, Kind::Velocity, Kind::Force, Kind::ForceField]);
        moment.contact = None;
        moment.reading.buttons = 5;
        let changes = [Kind::ButtonChange, Kind::ButtonChange];
        assert_eq!(told(&moment), [&always[..2], &changes, &[Kind::Force, Kind::ForceField]].concat());
        assert_eq!(told(&moment), always);
        report.answer(&mut out);
        assert_eq!(kinds(&mut peer, &mut out), [Kind::Pong, Kind::ButtonStates]);
    }
}
