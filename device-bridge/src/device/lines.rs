//! Lines of text on a serial line.
use super::Fault;

/// The longest line that is one.
const LONGEST_LINE: usize = 96;

/// Puts bytes together to lines. What comes before the first end of a line is a part of one, and left out.
#[derive(Debug, Clone)]
pub struct Lines {
    bytes: [u8; LONGEST_LINE],
    length: usize,
    is_in_step: bool,
    is_over: bool,
}

impl Default for Lines {
    fn default() -> Self {
        Self { bytes: [0; LONGEST_LINE], length: 0, is_in_step: false, is_over: false }
    }
}

impl Lines {
    /// The next byte; a line that it ends, without its end (`\n`, `\r\n` or `\r`). An empty one is none.
    ///
    /// # Errors
    /// [`Fault::Garbled`] when a line is too long to be one.
    pub fn take(&mut self, byte: u8) -> Result<Option<&[u8]>, Fault> {
        if std::mem::take(&mut self.is_over) {
            self.length = 0;
        }
        if byte != b'\n' && byte != b'\r' {
            *self.bytes.get_mut(self.length).ok_or(Fault::Garbled)? = byte;
            self.length += 1;
            return Ok(None);
        }
        self.is_over = true;
        let was_in_step = std::mem::replace(&mut self.is_in_step, true);
        Ok((was_in_step && self.length > 0).then_some(&self.bytes[..self.length]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn lines_of(text: &[u8]) -> Vec<Vec<u8>> {
        let mut lines = Lines::default();
        text.iter().filter_map(|&byte| lines.take(byte).unwrap().map(<[u8]>::to_vec)).collect()
    }

    #[test]
    fn lines_end_in_either_way_and_the_first_part_is_none() {
        assert_eq!(lines_of(b"34 5\n1 2\r\n\n3\r4\n5"), [b"1 2".to_vec(), b"3".to_vec(), b"4".to_vec()]);
        let mut lines = Lines::default();
        assert!((0..LONGEST_LINE).all(|_| lines.take(b'1') == Ok(None)));
        assert_eq!(lines.take(b'1'), Err(Fault::Garbled));
    }

    proptest! {
        #[test]
        fn any_bytes_are_lines_or_garbled(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut lines = Lines::default();
            for byte in bytes {
                if let Ok(Some(line)) = lines.take(byte) {
                    prop_assert!(!line.is_empty() && line.len() <= LONGEST_LINE);
                }
            }
        }
    }
}
