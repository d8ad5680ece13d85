//! What a VRPN server has told of an arm: messages in, the arm's newest state out. No socket, no clock.
use super::{
    payload::{self, Pose, Velocity},
    peer::Kind,
    wire::Time,
};
use crate::device::Fault;
use glam::DVec3;

/// After so many poses without a velocity the server is taken for one that sends none (any more).
const POSES_A_VELOCITY_LASTS: u32 = 4;

/// Whose messages count: places among the names of [`super::peer::Peer`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Senders {
    /// The tracker's name.
    pub tracker: usize,
    /// The tracker's sensor.
    pub sensor: i32,
    /// The buttons' name, if there are any.
    pub button: Option<usize>,
    /// The force device's name, if there is one.
    pub force: Option<usize>,
}

/// The newest of everything.
#[derive(Debug, Clone)]
pub struct Heard {
    senders: Senders,
    pose: Option<Pose>,
    velocity: Option<Velocity>,
    /// Since the velocity.
    poses: u32,
    is_new: bool,
    /// When the pose was made, by the server's clock.
    pose_time: Time,
    buttons: u32,
    force_n: Option<DVec3>,
    /// Names under which an answer is asked for, bit i for name i.
    pings: u32,
}

impl Heard {
    /// Nothing yet.
    pub fn new(senders: Senders) -> Self {
        let (pose, velocity, force_n) = (None, None, None);
        let pose_time = Time::default();
        Self { senders, pose, velocity, poses: 0, is_new: false, pose_time, buttons: 0, force_n, pings: 0 }
    }

    /// A message, which was made at `time` by the server's clock.
    ///
    /// # Errors
    /// [`Fault::Garbled`] when it does not say what its type promises, [`Fault::Refused`] when the force device has failed.
    pub fn take(&mut self, sender: usize, kind: Kind, time: Time, bytes: &[u8]) -> Result<(), Fault> {
        let Senders { tracker, sensor, button, force } = self.senders;
        let garbled = Fault::Garbled;
        match kind {
            Kind::Ping => self.pings |= 1_u32.checked_shl(sender as u32).unwrap_or(0),
            Kind::Pose if sender == tracker => {
                let pose = Pose::parse(bytes).ok_or(garbled)?;
                if pose.sensor == sensor {
                    self.pose = Some(pose);
                    self.is_new = true;
                    self.pose_time = time;
                    self.poses = self.poses.saturating_add(1);
                }
            }
            Kind::Velocity if sender == tracker => {
                let velocity = Velocity::parse(bytes).ok_or(garbled)?;
                if velocity.sensor == sensor {
                    self.velocity = Some(velocity);
                    self.poses = 0;
                }
            }
            Kind::ButtonChange if Some(sender) == button => {
                let (place, is_pressed) = payload::parse_change(bytes).ok_or(garbled)?;
                let bit = u32::try_from(place).ok().and_then(|place| 1_u32.checked_shl(place)).unwrap_or(0);
                self.buttons = if is_pressed { self.buttons | bit } else { self.buttons & !bit };
            }
            Kind::ButtonStates if Some(sender) == button => {
                self.buttons = payload::parse_states(bytes).ok_or(garbled)?;
            }
            Kind::Force if Some(sender) == force => {
                self.force_n = Some(payload::parse_force(bytes).ok_or(garbled)?);
            }
            Kind::ForceError if Some(sender) == force && payload::parse_error(bytes).ok_or(garbled)? => {
                return Err(Fault::Refused);
            }
            _ => {}
        }
        Ok(())
    }

    /// The newest pose, if one came since this was last asked.
    pub fn new_pose(&mut self) -> Option<Pose> {
        self.pose.filter(|_| std::mem::take(&mut self.is_new))
    }

    /// When the newest pose was made, by the server's clock.
    pub fn pose_time(&self) -> Time {
        self.pose_time
    }

    /// The velocity that goes with the pose, as long as the server sends some.
    pub fn velocity(&self) -> Option<Velocity> {
        self.velocity.filter(|_| self.poses < POSES_A_VELOCITY_LASTS)
    }

    /// Bit i is button i.
    pub fn buttons(&self) -> u32 {
        self.buttons
    }

    /// What the force device reported last (N).
    pub fn force_n(&self) -> Option<DVec3> {
        self.force_n
    }

    /// Names under which an answer is asked for, bit i for name i; they are answered now.
    pub fn take_pings(&mut self) -> u32 {
        std::mem::take(&mut self.pings)
    }
}

#[cfg(test)]
mod tests {
    use super::{super::peer::Peer, super::wire::Outgoing, *};
    use crate::device::vrpn::peer;
    use glam::DQuat;
    use proptest::prelude::*;

    const SENDERS: Senders = Senders { tracker: 0, sensor: 1, button: Some(1), force: Some(2) };

    fn names() -> Vec<String> {
        ["Arm", "Grip", "Motors"].map(str::to_owned).to_vec()
    }

    fn told(heard: &mut Heard, sender: usize, kind: Kind, write: impl FnOnce(&mut Vec<u8>)) -> Result<(), Fault> {
        let mut bytes = Vec::new();
        write(&mut bytes);
        heard.take(sender, kind, Time::default(), &bytes)
    }

    fn pose(sensor: i32, x: f64) -> Pose {
        Pose { sensor, position_m: DVec3::X * x, orientation: DQuat::IDENTITY }
    }

    #[test]
    fn only_the_sensor_and_the_senders_that_were_named_count() {
        let mut heard = Heard::new(SENDERS);
        told(&mut heard, 0, Kind::Pose, |into| pose(0, 1.0).write(into)).unwrap();
        told(&mut heard, 1, Kind::Pose, |into| pose(1, 1.0).write(into)).unwrap();
        told(&mut heard, 0, Kind::ButtonStates, |into| payload::write_states(1, 1, into)).unwrap();
        assert_eq!((heard.new_pose(), heard.buttons()), (None, 0));
        told(&mut heard, 0, Kind::Pose, |into| pose(1, 1.0).write(into)).unwrap();
        told(&mut heard, 0, Kind::Pose, |into| pose(1, 2.0).write(into)).unwrap();
        assert_eq!((heard.new_pose(), heard.new_pose()), (Some(pose(1, 2.0)), None));
    }

    #[test]
    fn buttons_change_one_by_one_and_all_at_once() {
        let mut heard = Heard::new(SENDERS);
        for (button, is_pressed, bits) in [(2, true, 4), (0, true, 5), (40, true, 5), (-1, true, 5), (2, false, 1)] {
            told(&mut heard, 1, Kind::ButtonChange, |into| payload::write_change(button, is_pressed, into)).unwrap();
            assert_eq!(heard.buttons(), bits);
        }
        told(&mut heard, 1, Kind::ButtonStates, |into| payload::write_states(6, 3, into)).unwrap();
        assert_eq!(heard.buttons(), 6);
    }

    #[test]
    fn a_velocity_lasts_for_some_poses_and_no_longer() {
        let mut heard = Heard::new(SENDERS);
        let velocity = Velocity { sensor: 1, velocity_m_per_s: DVec3::X, angular_velocity_rad_per_s: DVec3::ZERO };
        told(&mut heard, 0, Kind::Velocity, |into| velocity.write(into)).unwrap();
        let lasted = (0..9).map(|_| {
            told(&mut heard, 0, Kind::Pose, |into| pose(1, 0.0).write(into)).unwrap();
            heard.velocity().is_some()
        });
        assert_eq!(lasted.filter(|lasted| *lasted).count(), 3);
    }

    #[test]
    fn errors_of_the_force_device_and_strange_payloads_are_faults_and_pings_are_remembered() {
        let mut heard = Heard::new(SENDERS);
        assert_eq!(told(&mut heard, 2, Kind::ForceError, payload::write_error), Err(Fault::Refused));
        assert_eq!(told(&mut heard, 2, Kind::ForceError, |into| into.extend([0, 0, 0, 4])), Ok(()));
        for (sender, kind) in [(0, Kind::Pose), (0, Kind::Velocity), (1, Kind::ButtonStates), (2, Kind::Force)] {
            assert_eq!(told(&mut heard, sender, kind, |into| into.push(0)), Err(Fault::Garbled));
        }
        told(&mut heard, 1, Kind::Ping, |_| ()).unwrap();
        told(&mut heard, 99, Kind::Ping, |_| ()).unwrap();
        assert_eq!((heard.take_pings(), heard.take_pings()), (2, 0));
    }

    /// Everything a driver does with bytes.
    fn receive(peer: &mut Peer, heard: &mut Heard, bytes: &[u8]) -> Result<(), Fault> {
        peer.received.room()[..bytes.len()].copy_from_slice(bytes);
        peer.received.came(bytes.len());
        while let Some(told) = peer.next_told().map_err(|_| Fault::Garbled)? {
            heard.take(told.sender, told.kind, told.time, peer.payload(&told))?;
        }
        Ok(())
    }

    /// A second of a server's messages, more or less.
    fn traffic() -> Vec<u8> {
        let mut out = Outgoing::default();
        peer::describe(&names(), &mut out);
        for n in 0..20 {
            let mut message = |sender, kind: Kind, write: &dyn Fn(&mut Vec<u8>)| {
                out.message(kind.header(sender, Time::default()), write);
            };
            message(0, Kind::Pose, &|into| pose(1, f64::from(n)).write(into));
            message(2, Kind::Force, &|into| payload::write_force(DVec3::X, into));
            message(1, Kind::ButtonChange, &|into| payload::write_change(n, true, into));
            message(0, Kind::Ping, &|_| ());
        }
        out.bytes().to_vec()
    }

    /// A million bytes without meaning; whoever is lost by them begins anew.
    #[test]
    fn a_million_random_bytes_end_in_garbled_or_in_nothing() {
        let (mut state, mut ends) = (1_u64, 0);
        let (mut peer, mut heard) = (Peer::new(names()), Heard::new(SENDERS));
        for _ in 0..20_000 {
            let bytes: [u8; 50] = std::array::from_fn(|_| {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 56) as u8
            });
            if receive(&mut peer, &mut heard, &bytes).is_err() {
                ends += 1;
                (peer, heard) = (Peer::new(names()), Heard::new(SENDERS));
            }
        }
        assert!(ends > 10_000, "{ends}");
        assert_eq!((heard.new_pose(), heard.force_n()), (None, None));
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]
        #[test]
        fn random_bytes_in_valid_traffic_do_no_harm(
            at in 0_usize..5000,
            bytes in prop::collection::vec(any::<u8>(), 1..60),
            overwrites: bool,
            parts in 1_usize..500,
        ) {
            let mut traffic = traffic();
            let at = at % traffic.len();
            let end = if overwrites { traffic.len().min(at + bytes.len()) } else { at };
            traffic.splice(at..end, bytes);
            let (mut peer, mut heard) = (Peer::new(names()), Heard::new(SENDERS));
            let _ = traffic.chunks(parts).try_for_each(|part| receive(&mut peer, &mut heard, part));
            prop_assert!(heard.new_pose().is_none_or(|pose| pose.position_m.is_finite()));
            prop_assert!(heard.force_n().is_none_or(DVec3::is_finite));
        }
    }
}
