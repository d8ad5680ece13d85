//! A 2diy board's bytes: messages of fixed length, whose numbers are floats of 32 bits, little-endian. Nothing marks where a message begins.
use crate::device::Fault;

/// First byte of a message that makes the board forget its parameters.
pub const RESET: u8 = 0;
/// First byte of a message with its parameters.
pub const PARAMETERS: u8 = 1;
/// First byte of a message with torques, which alone is answered.
pub const TORQUES: u8 = 2;
/// Length of a message with torques for two motors: type, id, two floats.
pub const REQUEST: usize = 10;
/// Length of its answer: id, two floats.
pub const REPLY: usize = 9;
/// Length of a message with the parameters of two motors and their encoders.
pub const SETUP: usize = 26;
/// An angle beyond it (degrees) is none: the arms turn by less than once.
const MOST_DEG: f64 = 720.0;

/// What the board is told of a motor and the encoder on its port.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Axis {
    /// Port, 1 to 4.
    pub port: u8,
    /// Both count the way of the clock backwards.
    pub counter_clockwise: bool,
    /// What the encoder is to say (degrees) where it is now.
    pub offset_deg: f64,
    /// Its counts for a turn.
    pub counts_per_turn: f64,
}

/// The message with the parameters of two axes, in the order of their ports.
pub fn setup(id: u8, axes: [Axis; 2]) -> [u8; SETUP] {
    let mask = axes.iter().fold(0, |mask, axis| mask | 1 << (axis.port - 1));
    let [first, second] = axes.map(|axis| u8::from(axis.counter_clockwise));
    let mut message = [0; SETUP];
    // Motors and which way they turn, encoders and which way they count, no sensors, no pulses.
    message[..10].copy_from_slice(&[PARAMETERS, id, mask, first, second, mask, first, second, 0, 0]);
    let numbers = axes.map(|axis| [axis.offset_deg, axis.counts_per_turn]);
    for (bytes, number) in message[10..].chunks_exact_mut(4).zip(numbers.as_flattened()) {
        bytes.copy_from_slice(&(*number as f32).to_le_bytes());
    }
    message
}

/// The message with the torques (N m) of two motors, in the order of their ports.
pub fn request(id: u8, torques_nm: [f32; 2]) -> [u8; REQUEST] {
    let [[a, b, c, d], [e, f, g, h]] = torques_nm.map(f32::to_le_bytes);
    [TORQUES, id, a, b, c, d, e, f, g, h]
}

/// The answer with the angles (degrees) of two encoders.
pub fn reply(id: u8, angles_deg: [f32; 2]) -> [u8; REPLY] {
    let [[a, b, c, d], [e, f, g, h]] = angles_deg.map(f32::to_le_bytes);
    [id, a, b, c, d, e, f, g, h]
}

/// Two floats.
pub fn numbers(bytes: [u8; 8]) -> [f64; 2] {
    let [a, b, c, d, e, f, g, h] = bytes;
    [[a, b, c, d], [e, f, g, h]].map(|bytes| f32::from_le_bytes(bytes).into())
}

/// Puts the bytes of answers together. One goes on where the last ended, so a byte too many or too few is found at the next id.
#[derive(Debug, Clone)]
pub struct Replies {
    id: u8,
    bytes: [u8; REPLY],
    length: usize,
}

impl Replies {
    /// Answers to requests with this id.
    pub fn new(id: u8) -> Self {
        Self { id, bytes: [0; REPLY], length: 0 }
    }

    /// The next byte; the angles (degrees) of an answer that it ends.
    ///
    /// # Errors
    /// [`Fault::Garbled`] when an answer has another id, or angles that are none.
    pub fn take(&mut self, byte: u8) -> Result<Option<[f64; 2]>, Fault> {
        self.bytes[self.length] = byte;
        self.length = (self.length + 1) % REPLY;
        if self.length > 0 {
            return Ok(None);
        }
        let [id, angles @ ..] = self.bytes;
        let angles_deg = numbers(angles);
        let are_angles = angles_deg.iter().all(|angle| angle.abs() <= MOST_DEG);
        if id == self.id && are_angles { Ok(Some(angles_deg)) } else { Err(Fault::Garbled) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn replies_of(bytes: &[u8]) -> Result<Vec<[f64; 2]>, Fault> {
        let mut replies = Replies::new(5);
        bytes.iter().filter_map(|&byte| replies.take(byte).transpose()).collect()
    }

    #[test]
    fn messages_are_as_published() {
        let axis = |port, offset_deg| Axis { port, counter_clockwise: true, offset_deg, counts_per_turn: 4880.0 };
        let message = setup(5, [axis(1, 12.0), axis(2, 168.0)]);
        assert_eq!(message[..10], [1, 5, 0b11, 1, 1, 0b11, 1, 1, 0, 0]);
        assert_eq!(message[10..14], 12.0_f32.to_le_bytes());
        assert_eq!(message[14..18], 4880.0_f32.to_le_bytes());
        assert_eq!(message[18..22], 168.0_f32.to_le_bytes());
        assert_eq!(setup(7, [axis(2, 0.0), axis(4, 0.0)])[..3], [1, 7, 0b1010]);
        assert_eq!(request(5, [1.0, -2.0]), [2, 5, 0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0]);
    }

    #[test]
    fn answers_follow_each_other_and_what_is_out_of_step_is_found() {
        let bytes = [reply(5, [12.0, 168.0]), reply(5, [-1.5, 0.0])].concat();
        assert_eq!(replies_of(&bytes), Ok(vec![[12.0, 168.0], [-1.5, 0.0]]));
        assert_eq!(replies_of(&bytes[..17]), Ok(vec![[12.0, 168.0]]));
        assert_eq!(replies_of(&bytes[1..]), Err(Fault::Garbled));
        assert_eq!(replies_of(&[&bytes[..9], &bytes[..8], &bytes].concat()), Err(Fault::Garbled));
        for wrong in [f32::NAN, f32::INFINITY, -721.0] {
            assert_eq!(replies_of(&reply(5, [0.0, wrong])), Err(Fault::Garbled));
        }
        assert_eq!(replies_of(&reply(6, [0.0, 0.0])), Err(Fault::Garbled));
    }

    proptest! {
        #[test]
        fn any_bytes_are_angles_or_garbled(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut replies = Replies::new(bytes.first().copied().unwrap_or(5));
            for byte in bytes {
                if let Ok(Some(angles)) = replies.take(byte) {
                    prop_assert!(angles.iter().all(|angle| angle.is_finite()));
                }
            }
        }
    }
}
