//! A Falcon's frames while its firmware runs, the same in both directions: `<`, three numbers of 16 bits, a byte of flags, a byte that nobody knows, `>`.
//!
//! Numbers are four letters each, the lowest four bits first, `A` for 0 to `P` for 15. Flags, and the unknown byte, are `A` and what they say.
use crate::device::Fault;

/// Length of a frame.
pub const FRAME: usize = 16;
/// To the arm: look for its home. It stays set: public programs that do so keep their zero.
pub const HOMING: u8 = 0x01;
/// To the arm: its lights.
pub const GREEN: u8 = 0x02;
/// To the arm: its lights.
pub const BLUE: u8 = 0x04;
/// To the arm: its lights.
pub const RED: u8 = 0x08;
/// From the arm: its four buttons.
pub const BUTTONS: u8 = 0x0f;
/// From the arm: that its three legs know their home.
pub const HOMED: u8 = 0x70;
/// No flag is above.
const MOST_FLAGS: u8 = 0x7f;
/// How much may come before the first frame.
const MOST_BEFORE: usize = 256;

/// What a frame says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Frame {
    /// To the arm: torques; from it: counts.
    pub numbers: [i16; 3],
    /// To the arm: homing and lights; from it: buttons and homed legs.
    pub flags: u8,
}

impl Frame {
    /// Its bytes.
    pub fn bytes(&self) -> [u8; FRAME] {
        let mut bytes = [b'A'; FRAME];
        (bytes[0], bytes[FRAME - 1]) = (b'<', b'>');
        for (letters, number) in bytes[1..13].chunks_exact_mut(4).zip(self.numbers) {
            for (place, letter) in letters.iter_mut().enumerate() {
                *letter = b'A' + (number.cast_unsigned() >> (4 * place) & 0xf) as u8;
            }
        }
        bytes[13] += self.flags.min(MOST_FLAGS);
        bytes
    }

    /// From its bytes.
    ///
    /// # Errors
    /// [`Fault::Garbled`].
    pub fn parse(bytes: &[u8; FRAME]) -> Result<Self, Fault> {
        let [b'<', letters @ .., flags, _, b'>'] = bytes else { return Err(Fault::Garbled) };
        let mut numbers = [0; 3];
        for (number, letters) in numbers.iter_mut().zip(letters.chunks_exact(4)) {
            let mut bits = 0_u16;
            for &letter in letters.iter().rev() {
                let value = letter.checked_sub(b'A').filter(|value| *value < 16).ok_or(Fault::Garbled)?;
                bits = bits << 4 | u16::from(value);
            }
            *number = bits.cast_signed();
        }
        let flags = flags.checked_sub(b'A').filter(|flags| *flags <= MOST_FLAGS).ok_or(Fault::Garbled)?;
        Ok(Self { numbers, flags })
    }
}

/// Puts bytes together to frames. What comes before the first one is left out; from then on each begins where the last ended.
#[derive(Debug, Clone, Default)]
pub struct Frames {
    bytes: [u8; FRAME],
    length: usize,
    is_in_step: bool,
    before: usize,
}

impl Frames {
    /// The next byte; a frame that it ends.
    ///
    /// # Errors
    /// [`Fault::Garbled`] when something else comes, or too much before the first frame.
    pub fn take(&mut self, byte: u8) -> Result<Option<Frame>, Fault> {
        if !self.is_in_step {
            self.before += 1;
            if self.before > MOST_BEFORE {
                return Err(Fault::Garbled);
            }
            // A frame has a `<` where it begins, and nowhere else, but perhaps as its unknown byte.
            if byte == b'<' && self.length != FRAME - 2 {
                self.length = 0;
            }
        }
        if self.length == 0 && byte != b'<' {
            return if self.is_in_step { Err(Fault::Garbled) } else { Ok(None) };
        }
        self.bytes[self.length] = byte;
        self.length = (self.length + 1) % FRAME;
        if self.length > 0 {
            return Ok(None);
        }
        match Frame::parse(&self.bytes) {
            Ok(frame) => {
                self.is_in_step = true;
                Ok(Some(frame))
            }
            Err(_) if !self.is_in_step => Ok(None),
            Err(fault) => Err(fault),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn frames_of(bytes: &[u8]) -> Result<Vec<Frame>, Fault> {
        let mut frames = Frames::default();
        bytes.iter().filter_map(|&byte| frames.take(byte).transpose()).collect()
    }

    #[test]
    fn a_frame_is_as_published() {
        let frame = Frame { numbers: [1, -2, 0x1234], flags: HOMING | GREEN };
        assert_eq!(&frame.bytes(), b"<BAAAOPPPEDCBDA>");
        // All legs are homed, and the second button is pressed: the flags are no letter any more.
        let mut bytes = frame.bytes();
        (bytes[13], bytes[14]) = (b'A' + (HOMED | 2), 0xff);
        assert_eq!(Frame::parse(&bytes).unwrap().flags, 0x72);
        for (place, wrong) in [(0, b'>'), (1, b'Q'), (4, b'@'), (13, b'@'), (13, 0xc1), (15, b'<')] {
            let mut bytes = frame.bytes();
            bytes[place] = wrong;
            assert_eq!(Frame::parse(&bytes), Err(Fault::Garbled), "{place}");
        }
    }

    #[test]
    fn what_comes_before_the_first_frame_is_left_out_and_nothing_later() {
        let frame = Frame { numbers: [7, 8, 9], flags: 1 };
        let bytes = frame.bytes();
        assert_eq!(frames_of(&[&bytes[9..], &bytes, &bytes].concat()), Ok(vec![frame, frame]));
        assert_eq!(frames_of(&[&bytes[..9], &bytes].concat()), Ok(vec![frame]));
        assert_eq!(frames_of(&[&bytes, &bytes[1..]].concat()), Err(Fault::Garbled));
        assert_eq!(frames_of(&[&bytes, &bytes[..9], &bytes].concat()), Err(Fault::Garbled));
        assert_eq!(frames_of(&[0; MOST_BEFORE]), Ok(vec![]));
        assert_eq!(frames_of(&[0; MOST_BEFORE + 1]), Err(Fault::Garbled));
        assert_eq!(frames_of(&[b'<'; 1000]), Err(Fault::Garbled));
        // An unknown byte that looks like a beginning.
        let mut odd = bytes;
        odd[14] = b'<';
        assert_eq!(frames_of(&odd), Ok(vec![frame]));
    }

    proptest! {
        #[test]
        fn what_is_written_can_be_read(numbers in any::<[i16; 3]>(), flags in 0..=MOST_FLAGS) {
            let frame = Frame { numbers, flags };
            prop_assert_eq!(Frame::parse(&frame.bytes()), Ok(frame));
        }

        #[test]
        fn any_bytes_are_frames_or_garbled(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut frames = Frames::default();
            for byte in bytes {
                let _ = frames.take(byte);
            }
        }
    }
}
