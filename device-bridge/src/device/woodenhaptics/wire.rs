//! A WoodenHaptics' lines: seven whole numbers of 16 bits, as text.
use crate::device::Fault;
use std::io::Write as _;

/// Numbers in a line, either way.
pub const NUMBERS: usize = 7;
/// No line is longer: each number has a sign, five digits and a space.
pub const LONGEST: usize = NUMBERS * 7 + 1;

/// Reads a line: six encoders and a word of information, or three currents, a command and its three attributes.
///
/// # Errors
/// [`Fault::Garbled`].
pub fn parse(line: &[u8]) -> Result<[i16; NUMBERS], Fault> {
    let mut numbers = [0; NUMBERS];
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    for number in &mut numbers {
        let word = words.next().and_then(|word| std::str::from_utf8(word).ok()).ok_or(Fault::Garbled)?;
        // The word of information has no sign: 40000 and −25536 are the same 16 bits.
        *number = word.parse().or_else(|_| word.parse::<u16>().map(u16::cast_signed)).map_err(|_| Fault::Garbled)?;
    }
    if words.next().is_some() { Err(Fault::Garbled) } else { Ok(numbers) }
}

/// Writes a line, with its end.
pub fn write(numbers: [i16; NUMBERS], into: &mut Vec<u8>) {
    into.clear();
    for (index, number) in numbers.into_iter().enumerate() {
        let end = if index + 1 == NUMBERS { '\n' } else { ' ' };
        // Writing into a Vec cannot fail.
        let _ = write!(into, "{number}{end}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lines_of_seven_numbers_and_no_others() {
        assert_eq!(parse(b" 1 -2  3\t4 5 6 40000 "), Ok([1, -2, 3, 4, 5, 6, -25536]));
        for wrong in ["", "1 2 3 4 5 6", "1 2 3 4 5 6 7 8", "1 2 3 4 5 6 x", "1 2 3 4 5 6 70000", "1 2 3 4 5 6.0 7"] {
            assert_eq!(parse(wrong.as_bytes()), Err(Fault::Garbled), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_can_be_read_and_is_short(numbers in any::<[i16; NUMBERS]>()) {
            let mut line = Vec::new();
            write(numbers, &mut line);
            prop_assert!(line.len() <= LONGEST);
            prop_assert_eq!(parse(line.strip_suffix(b"\n").unwrap()), Ok(numbers));
        }

        #[test]
        fn any_bytes_are_a_line_or_garbled(bytes in prop::collection::vec(any::<u8>(), 0..100)) {
            let _ = parse(&bytes);
        }
    }
}
