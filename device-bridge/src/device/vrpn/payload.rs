//! What messages say: the payloads of VRPN's trackers, buttons and force devices. Numbers are big-endian; quaternions are x, y, z, w.
use glam::{DMat3, DQuat, DVec3};

/// A tracker's pose: `vrpn_Tracker Pos_Quat`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Which of its sensors.
    pub sensor: i32,
    /// Place (m).
    pub position_m: DVec3,
    /// Its turn, of length 1.
    pub orientation: DQuat,
}

impl Pose {
    /// `None` for what is none.
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut numbers = Numbers(exactly(payload, 64)?);
        let sensor = numbers.i32()?;
        numbers.i32()?;
        Some(Self { sensor, position_m: numbers.vector()?, orientation: numbers.rotation()? })
    }

    /// Its bytes.
    pub fn write(&self, into: &mut Vec<u8>) {
        write_sensor(self.sensor, into);
        write_f64s(&self.position_m.to_array(), into);
        write_f64s(&self.orientation.to_array(), into);
    }
}

/// A tracker's velocity: `vrpn_Tracker Velocity`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Velocity {
    /// Which of its sensors.
    pub sensor: i32,
    /// Of its place (m/s).
    pub velocity_m_per_s: DVec3,
    /// Of its turn (rad/s): on the wire, how far it turns in some time.
    pub angular_velocity_rad_per_s: DVec3,
}

impl Velocity {
    /// Turns are told over this time (s): none goes round.
    const TURNED_IN_S: f64 = 1e-3;

    /// `None` for what is none.
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut numbers = Numbers(exactly(payload, 72)?);
        let sensor = numbers.i32()?;
        numbers.i32()?;
        let velocity_m_per_s = numbers.vector()?;
        let (turned, in_s) = (numbers.rotation(), numbers.f64()?);
        // A server that does not tell turns may send anything here, and often zeros.
        let rate = turned.filter(|_| in_s > 0.0).map_or(DVec3::ZERO, |turned| short_way(turned) / in_s);
        let angular_velocity_rad_per_s = if rate.is_finite() { rate } else { DVec3::ZERO };
        Some(Self { sensor, velocity_m_per_s, angular_velocity_rad_per_s })
    }

    /// Its bytes.
    pub fn write(&self, into: &mut Vec<u8>) {
        write_sensor(self.sensor, into);
        write_f64s(&self.velocity_m_per_s.to_array(), into);
        let turned = DQuat::from_scaled_axis(self.angular_velocity_rad_per_s * Self::TURNED_IN_S);
        write_f64s(&turned.to_array(), into);
        write_f64s(&[Self::TURNED_IN_S], into);
    }
}

/// The turn as an axis times its angle (rad), at most π.
fn short_way(turned: DQuat) -> DVec3 {
    let turned = if turned.w < 0.0 { -turned } else { turned };
    // 2 atan2(|v|, w) v/|v|, and 2 v where |v| is 0.
    let v = turned.xyz();
    let length = v.length();
    if length < 1e-12 { 2.0 * v } else { v * (2.0 * length.atan2(turned.w) / length) }
}

/// A button that changed, and whether it is pressed now: `vrpn_Button Change`. `None` for what is none.
pub fn parse_change(payload: &[u8]) -> Option<(i32, bool)> {
    let mut numbers = Numbers(exactly(payload, 8)?);
    Some((numbers.i32()?, numbers.i32()? != 0))
}

/// Its bytes.
pub fn write_change(button: i32, is_pressed: bool, into: &mut Vec<u8>) {
    write_i32(button, into);
    write_i32(is_pressed.into(), into);
}

/// All buttons, bit i for button i, of which there may be more: `vrpn_Button States`. `None` for what is none.
pub fn parse_states(payload: &[u8]) -> Option<u32> {
    let mut numbers = Numbers(payload);
    let count = usize::try_from(numbers.i32()?).ok()?;
    if payload.len() != count.checked_add(1)?.checked_mul(4)? {
        return None;
    }
    (0..count.min(32)).try_fold(0, |bits, button| Some(bits | u32::from(numbers.i32()? != 0) << button))
}

/// The bytes of so many buttons.
pub fn write_states(buttons: u32, count: u32, into: &mut Vec<u8>) {
    let count = count.min(u32::BITS);
    write_i32(count.cast_signed(), into);
    for button in 0..count {
        write_i32((buttons >> button & 1).cast_signed(), into);
    }
}

/// A force (N): `vrpn_ForceDevice Force`. `None` for what is none.
pub fn parse_force(payload: &[u8]) -> Option<DVec3> {
    Numbers(exactly(payload, 24)?).vector()
}

/// Its bytes.
pub fn write_force(force_n: DVec3, into: &mut Vec<u8>) {
    write_f64s(&force_n.to_array(), into);
}

/// An error of a force device: `vrpn_ForceDevice Force_Error`; whether it is one. `None` for what is none.
pub fn parse_error(payload: &[u8]) -> Option<bool> {
    /// Out of range, duty cycle, force or heat, and everything else are 0 to 3.
    const NO_ERROR: i32 = 4;
    Some(Numbers(exactly(payload, 4)?).i32()? != NO_ERROR)
}

/// The bytes of an error by too large a force, or heat.
pub fn write_error(into: &mut Vec<u8>) {
    write_i32(2, into);
}

/// A field of force, in a ball: `vrpn_ForceDevice Force_Field`, in single precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceField {
    /// Its middle (m).
    pub origin_m: DVec3,
    /// Force there (N).
    pub force_n: DVec3,
    /// `∂F/∂x` (N/m), row by row on the wire.
    pub jacobian_n_per_m: DMat3,
    /// Farther away there is no force (m).
    pub radius_m: f64,
}

impl ForceField {
    /// No force anywhere.
    pub const NONE: Self =
        Self { origin_m: DVec3::ZERO, force_n: DVec3::ZERO, jacobian_n_per_m: DMat3::ZERO, radius_m: 0.0 };

    /// `F = F₀ + J (x − x₀)` within the radius, nothing beyond (N).
    pub fn force_at_n(&self, position_m: DVec3) -> DVec3 {
        let away_m = position_m - self.origin_m;
        if away_m.length() > self.radius_m { DVec3::ZERO } else { self.force_n + self.jacobian_n_per_m * away_m }
    }

    /// `None` for what is none.
    pub fn parse(payload: &[u8]) -> Option<Self> {
        let mut numbers = Numbers(exactly(payload, 64)?);
        let mut vector = || {
            let v = DVec3::new(numbers.f32()?, numbers.f32()?, numbers.f32()?);
            v.is_finite().then_some(v)
        };
        let (origin_m, force_n) = (vector()?, vector()?);
        let jacobian_n_per_m = DMat3::from_cols(vector()?, vector()?, vector()?).transpose();
        let radius_m = numbers.f32().filter(|radius_m| radius_m.is_finite())?;
        Some(Self { origin_m, force_n, jacobian_n_per_m, radius_m })
    }

    /// Its bytes.
    pub fn write(&self, into: &mut Vec<u8>) {
        let rows = self.jacobian_n_per_m.transpose().to_cols_array();
        let vectors = [self.origin_m.to_array(), self.force_n.to_array()];
        for number in vectors.as_flattened().iter().chain(&rows).chain([&self.radius_m]) {
            into.extend_from_slice(&(*number as f32).to_be_bytes());
        }
    }
}

/// The name in a description. `None` for what is none.
pub fn parse_name(payload: &[u8]) -> Option<&[u8]> {
    let length = usize::try_from(Numbers(payload).i32()?).ok()?;
    let name = payload.get(4..)?.get(..length)?;
    // It is counted with the 0 behind it, which not all send.
    name.split(|byte| *byte == 0).next()
}

/// Its bytes.
pub fn write_name(name: &str, into: &mut Vec<u8>) {
    // Names are short: that is checked where they come from.
    write_i32(name.len() as i32 + 1, into);
    into.extend_from_slice(name.as_bytes());
    into.push(0);
}

fn exactly(payload: &[u8], bytes: usize) -> Option<&[u8]> {
    (payload.len() == bytes).then_some(payload)
}

fn write_i32(number: i32, into: &mut Vec<u8>) {
    into.extend_from_slice(&number.to_be_bytes());
}

fn write_f64s(numbers: &[f64], into: &mut Vec<u8>) {
    for number in numbers {
        into.extend_from_slice(&number.to_be_bytes());
    }
}

/// A sensor's number, filled up to where numbers of 8 bytes lie.
fn write_sensor(sensor: i32, into: &mut Vec<u8>) {
    write_i32(sensor, into);
    write_i32(0, into);
}

/// Takes numbers off the front.
struct Numbers<'a>(&'a [u8]);

impl Numbers<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*first)
    }

    fn i32(&mut self) -> Option<i32> {
        self.take().map(i32::from_be_bytes)
    }

    fn f32(&mut self) -> Option<f64> {
        self.take().map(f32::from_be_bytes).map(f64::from)
    }

    fn f64(&mut self) -> Option<f64> {
        self.take().map(f64::from_be_bytes)
    }

    fn vector(&mut self) -> Option<DVec3> {
        let v = DVec3::new(self.f64()?, self.f64()?, self.f64()?);
        v.is_finite().then_some(v)
    }

    fn rotation(&mut self) -> Option<DQuat> {
        let q = DQuat::from_xyzw(self.f64()?, self.f64()?, self.f64()?, self.f64()?);
        // Trackers round; what is far from length 1 is none.
        (q.is_finite() && (q.length() - 1.0).abs() < 0.1).then(|| q.normalize())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(write: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
        let mut bytes = Vec::new();
        write(&mut bytes);
        bytes
    }

    #[test]
    fn payloads_have_the_lengths_and_the_order_of_the_protocol() {
        let orientation = DQuat::from_xyzw(0.5, -0.5, 0.5, 0.5);
        let pose = written(|into| Pose { sensor: 7, position_m: DVec3::X, orientation }.write(into));
        assert_eq!((pose.len(), pose[3]), (64, 7));
        assert_eq!(pose[8..16], 1.0_f64.to_be_bytes());
        // x, y, z, w: of these only y is negative.
        let signs: Vec<bool> = pose[32..].chunks(8).map(|number| number[0] >= 0x80).collect();
        assert_eq!(signs, [false, true, false, false]);
        assert_eq!(written(|into| write_change(2, true, into)), [0, 0, 0, 2, 0, 0, 0, 1]);
        assert_eq!(written(|into| write_states(2, 2, into)), [0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 1]);
        assert_eq!(written(|into| write_name("ab", into)), [0, 0, 0, 3, b'a', b'b', 0]);
        let jacobian_n_per_m = DMat3::from_cols(DVec3::X, DVec3::new(5.0, 0.0, 0.0), DVec3::ZERO);
        let field = ForceField { jacobian_n_per_m, ..ForceField::NONE };
        let bytes = written(|into| field.write(into));
        // ∂Fx/∂y is the second number of the first row.
        assert_eq!((bytes.len(), &bytes[28..32]), (64, &5.0_f32.to_be_bytes()[..]));
    }

    #[test]
    fn a_field_is_linear_within_its_radius_and_nothing_beyond() {
        let jacobian_n_per_m = DMat3::from_cols(DVec3::new(-1.0, 2.0, 0.0), DVec3::ZERO, DVec3::ZERO);
        let field = ForceField { origin_m: DVec3::Y, force_n: DVec3::Z, jacobian_n_per_m, radius_m: 0.5 };
        assert_eq!(field.force_at_n(DVec3::new(0.5, 1.0, 0.0)), DVec3::new(-0.5, 1.0, 1.0));
        assert_eq!(field.force_at_n(DVec3::new(0.51, 1.0, 0.0)), DVec3::ZERO);
    }

    #[test]
    fn what_is_no_number_or_no_turn_is_refused_and_a_velocity_needs_none() {
        let pose = |position_m, orientation| written(|into| Pose { sensor: 0, position_m, orientation }.write(into));
        assert!(Pose::parse(&pose(DVec3::ZERO, DQuat::IDENTITY * 1.01)).is_some());
        assert_eq!(Pose::parse(&pose(DVec3::NAN, DQuat::IDENTITY)), None);
        for wrong in [DQuat::IDENTITY * 0.0, DQuat::IDENTITY * 2.0, DQuat::IDENTITY * f64::NAN] {
            assert_eq!(Pose::parse(&pose(DVec3::ZERO, wrong)), None);
        }
        let velocity = Velocity { sensor: 0, velocity_m_per_s: DVec3::X, angular_velocity_rad_per_s: DVec3::Z };
        let mut bytes = written(|into| velocity.write(into));
        bytes[32..].fill(0);
        let untold = Velocity { angular_velocity_rad_per_s: DVec3::ZERO, ..velocity };
        assert_eq!(Velocity::parse(&bytes), Some(untold));
        assert_eq!(parse_states(&[0, 0, 0, 1]), None);
        assert_eq!(parse_states(&[0xff; 8]), None);
        assert_eq!(parse_states(&written(|into| write_states(0x8000_0001, 99, into))), Some(0x8000_0001));
    }

    fn near(v: [f64; 3]) -> DVec3 {
        DVec3::from_array(v)
    }

    proptest! {
        #[test]
        fn what_is_written_can_be_read(
            a in prop::array::uniform3(-9.0..9.0_f64),
            b in prop::array::uniform3(-99.0..99.0_f64),
            sensor in any::<i32>(),
            buttons in any::<u32>(),
            name in "[ -~]{0,99}",
        ) {
            let pose = Pose { sensor, position_m: near(a), orientation: DQuat::from_scaled_axis(near(b)) };
            let found = Pose::parse(&written(|into| pose.write(into))).unwrap();
            prop_assert!(found.sensor == sensor && found.position_m == pose.position_m);
            prop_assert!(found.orientation.angle_between(pose.orientation) < 1e-7);
            let velocity = Velocity { sensor, velocity_m_per_s: near(a), angular_velocity_rad_per_s: near(b) };
            let found = Velocity::parse(&written(|into| velocity.write(into))).unwrap();
            prop_assert!(found.velocity_m_per_s == near(a));
            prop_assert!(found.angular_velocity_rad_per_s.distance(near(b)) < 1e-9);
            let jacobian_n_per_m = DMat3::from_cols(near(a), near(b), near(a));
            let field = ForceField { origin_m: near(a), force_n: near(b), jacobian_n_per_m, radius_m: a[0] };
            let found = ForceField::parse(&written(|into| field.write(into))).unwrap();
            prop_assert!(found.origin_m.distance(near(a)) < 1e-5 && found.force_n.distance(near(b)) < 1e-4);
            prop_assert!((found.jacobian_n_per_m - jacobian_n_per_m).to_cols_array().iter().all(|d| d.abs() < 1e-4));
            prop_assert_eq!(parse_force(&written(|into| write_force(near(b), into))), Some(near(b)));
            prop_assert_eq!(parse_states(&written(|into| write_states(buttons, 32, into))), Some(buttons));
            prop_assert_eq!(parse_change(&written(|into| write_change(sensor, true, into))), Some((sensor, true)));
            let bytes = written(|into| write_name(&name, into));
            prop_assert_eq!(parse_name(&bytes), Some(name.as_bytes()));
        }

        #[test]
        fn any_bytes_are_payloads_or_none(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            let _ = (parse_change(&bytes), parse_states(&bytes), parse_force(&bytes), parse_error(&bytes), parse_name(&bytes));
            for length in [64, 72] {
                let bytes = &bytes[..bytes.len().min(length)];
                let _ = (Pose::parse(bytes), ForceField::parse(bytes));
                if let Some(velocity) = Velocity::parse(bytes) {
                    prop_assert!(velocity.angular_velocity_rad_per_s.is_finite());
                }
            }
        }
    }
}
