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

    /// Where the item taken last begins.
    pub(super) fn place(&self) -> Place {
        match self.encoding {
            Encoding::Ascii => Place::Line(line_number(&self.data[..self.mark])),
            _ => Place::Byte(self.mark),
        }
    }

    /// An error at the item taken last.
    pub(super) fn fail(&self, problem: Problem) -> FileError {
        FileError::new(self.path, self.place(), problem)
    }

    /// Goes back by `bytes`, at most to the beginning.
    pub(super) fn go_back(&mut self, bytes: usize) {
        self.at = self.at.saturating_sub(bytes);
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

    /// The rest of the line, without its end (LF, CR LF or CR); `None` at the end of the file.
    pub(super) fn line(&mut self) -> Option<&'a [u8]> {
        if self.rest().is_empty() {
            return None;
        }
        self.mark = self.at;
        let length = self.rest().iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(self.rest().len());
        let line = &self.rest()[..length];
        self.advance(length);
        self.advance(if self.rest().starts_with(b"\r\n") { 2 } else { 1 });
        Some(line)
    }

    /// Whether the end of the file was reached without an end of its last line.
    pub(super) fn is_last_line_open(&self) -> bool {
        self.rest().is_empty() && !matches!(self.data.last(), Some(b'\n' | b'\r'))
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

    /// A number that the mesh does not depend on, or the word, such as `-nan(ind)`, that stands in its place.
    ///
    /// What begins with a letter and is not NaN or infinite is a keyword: fewer numbers are there than announced.
    pub(super) fn optional_real(&mut self, scalar: Scalar, wanted: &str) -> Result<Result<f64, &'a [u8]>, FileError> {
        if self.encoding != Encoding::Ascii {
            return Ok(Ok(self.binary(scalar, wanted)?.real()));
        }
        let word = self.word().ok_or_else(|| self.truncated(wanted))?;
        if let Some(value) = std::str::from_utf8(word).ok().and_then(|text| text.parse().ok()) {
            return Ok(Ok(value));
        }
        let begins = |letters: &[u8]| word.get(..3).is_some_and(|start| start.eq_ignore_ascii_case(letters));
        let like_a_number = matches!(word, [b'0'..=b'9' | b'+' | b'-' | b'.' | b'#' | b'*', ..]);
        if like_a_number || begins(b"nan") || begins(b"inf") { Ok(Err(word)) } else { Err(self.expected(wanted, word)) }
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

/// The number, from 1, of the line that begins or goes on behind `before`.
pub(super) fn line_number(before: &[u8]) -> usize {
    let ends = |pair: &[u8]| pair[0] == b'\n' || (pair[0] == b'\r' && pair[1] != b'\n');
    let last = matches!(before.last(), Some(b'\n' | b'\r'));
    1 + before.windows(2).filter(|pair| ends(pair)).count() + usize::from(last)
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
