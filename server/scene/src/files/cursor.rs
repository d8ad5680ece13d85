//! A position in a file's bytes, from which text and binary numbers are taken; it knows where it is when they are wrong.
use super::error::{FileError, Place, Problem};
use std::path::Path;

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Little,
    Big,
}

/// The number types of the binary formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Scalar {
    /// Size in bytes.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(super) fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

#[derive(Debug, Clone)]
pub(super) struct Cursor<'a> {
    path: &'a Path,
    data: &'a [u8],
    at: usize,
    /// Where the item taken last begins: errors point there.
    mark: usize,
    pub(super) encoding: Encoding,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(path: &'a Path, data: &'a [u8]) -> Self {
        Self { path, data, at: 0, mark: 0, encoding: Encoding::Ascii }
    }

    pub(super) fn rest(&self) -> &'a [u8] {
        &self.data[self.at..]
    }

    /// Moves on by `bytes`, at most to the end.
    pub(super) fn advance(&mut self, bytes: usize) {
        self.at = self.data.len().min(self.at.saturating_add(bytes));
    }

    /// An error at the item taken last.
    pub(super) fn fail(&self, problem: Problem) -> FileError {
        let place = match self.encoding {
            Encoding::Ascii => Place::Line(self.data[..self.mark].split(|&b| b == b'\n').count()),
            _ => Place::Byte(self.mark),
        };
        FileError::new(self.path, place, problem)
    }

    pub(super) fn truncated(&self, wanted: &str) -> FileError {
        let mut end = self.clone();
        end.mark = self.data.len();
        end.fail(Problem::Truncated { wanted: wanted.to_string() })
    }

    pub(super) fn expected(&self, wanted: &str, found: &[u8]) -> FileError {
        self.fail(Problem::Expected { wanted: wanted.to_string(), found: shown(found) })
    }

    pub(super) fn skip_space(&mut self) {
        self.at += self.rest().iter().take_while(|b| b.is_ascii_whitespace()).count();
    }

    /// The next word, or `None` at the end of the file.
    pub(super) fn word(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        self.mark = self.at;
        let length = self.rest().iter().take_while(|b| !b.is_ascii_whitespace()).count();
        let word = &self.rest()[..length];
        self.at += length;
        (length > 0).then_some(word)
    }

    /// The next word as text.
    pub(super) fn text(&mut self, wanted: &str) -> Result<&'a str, FileError> {
        let word = self.word().ok_or_else(|| self.truncated(wanted))?;
        std::str::from_utf8(word).map_err(|_| self.expected(wanted, word))
    }

    /// The rest of the line, without its end; `None` at the end of the file.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        if self.rest().is_empty() {
            return None;
        }
        self.mark = self.at;
        let length = self.rest().iter().position(|&b| b == b'\n').unwrap_or(self.rest().len());
        let line = &self.rest()[..length];
        self.advance(length + 1);
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }

    /// Parses the next word, whatever the encoding of the numbers.
    pub(super) fn parse<T: std::str::FromStr>(&mut self, wanted: &str) -> Result<T, FileError> {
        let word = self.text(wanted)?;
        word.parse().map_err(|_| self.expected(wanted, word.as_bytes()))
    }

    /// The next `length` bytes.
    pub(super) fn take(&mut self, length: usize, wanted: &str) -> Result<&'a [u8], FileError> {
        self.mark = self.at;
        let Some(bytes) = self.rest().get(..length) else { return Err(self.truncated(wanted)) };
        self.at += length;
        Ok(bytes)
    }

    /// The next number as an integer.
    pub(super) fn int(&mut self, scalar: Scalar, wanted: &str) -> Result<i64, FileError> {
        if self.encoding == Encoding::Ascii {
            return self.parse(wanted);
        }
        let value = self.binary(scalar, wanted)?;
        value.integer().ok_or_else(|| self.expected(wanted, format!("{value:?}").as_bytes()))
    }

    /// The next number as a real one.
    pub(super) fn real(&mut self, scalar: Scalar, wanted: &str) -> Result<f64, FileError> {
        if self.encoding == Encoding::Ascii {
            return self.parse(wanted);
        }
        Ok(self.binary(scalar, wanted)?.real())
    }

    fn binary(&mut self, scalar: Scalar, wanted: &str) -> Result<Number, FileError> {
        let bytes = self.take(scalar.size(), wanted)?;
        Ok(Number::decode(bytes, scalar, self.encoding == Encoding::Big))
    }

    /// Checks that `count` items of at least `bytes_each` fit into the rest of the file, before any memory is set aside.
    pub(super) fn check_count(&self, count: i64, bytes_each: usize, what: &str) -> Result<usize, FileError> {
        // The last number of a text needs no space behind it.
        let room = self.rest().len();
        match usize::try_from(count) {
            Ok(n) if n.checked_mul(bytes_each).is_some_and(|bytes| bytes <= room + 1) => Ok(n),
            _ => Err(self.fail(Problem::Count { what: what.to_string(), count: count.into(), room })),
        }
    }
}

/// A decoded binary number.
#[derive(Debug, Clone, Copy)]
pub(super) enum Number {
    Integer(i128),
    Real(f64),
}

impl Number {
    /// Decodes `bytes`, which are as many as the scalar's size.
    pub(super) fn decode(bytes: &[u8], scalar: Scalar, big_endian: bool) -> Self {
        // Unsigned value first, most significant byte last, then the sign from the top bit.
        let fold = |value: u64, &byte: &u8| value << 8 | u64::from(byte);
        let raw = if big_endian { bytes.iter().fold(0, fold) } else { bytes.iter().rev().fold(0, fold) };
        match scalar {
            Scalar::I8 => Self::Integer((raw as i8).into()),
            Scalar::I16 => Self::Integer((raw as i16).into()),
            Scalar::I32 => Self::Integer((raw as i32).into()),
            Scalar::I64 => Self::Integer((raw as i64).into()),
            Scalar::U8 | Scalar::U16 | Scalar::U32 | Scalar::U64 => Self::Integer(raw.into()),
            Scalar::F32 => Self::Real(f32::from_bits(raw as u32).into()),
            Scalar::F64 => Self::Real(f64::from_bits(raw)),
        }
    }

    /// The value, when it is an integer that fits.
    pub(super) fn integer(self) -> Option<i64> {
        match self {
            Self::Integer(value) => i64::try_from(value).ok(),
            Self::Real(value) => (value.fract() == 0.0 && value.abs() < 9e15).then_some(value as i64),
        }
    }

    pub(super) fn real(self) -> f64 {
        match self {
            Self::Integer(value) => value as f64,
            Self::Real(value) => value,
        }
    }
}

/// Bytes as a message shows them: printable and short.
pub(super) fn shown(bytes: &[u8]) -> String {
    const LONGEST: usize = 80;
    let text: String =
        String::from_utf8_lossy(&bytes[..bytes.len().min(LONGEST)]).chars().flat_map(char::escape_debug).collect();
    if bytes.len() > LONGEST { format!("{text}…") } else { text }
}

/// Where `needle`, which is not empty, first occurs.
pub(super) fn find(data: &[u8], needle: &[u8]) -> Option<usize> {
    let mut at = 0;
    loop {
        at += data[at..].iter().position(|b| Some(b) == needle.first())?;
        if data[at..].starts_with(needle) {
            return Some(at);
        }
        at += 1;
    }
}
