//! The arrays of a VTK XML file: text, base64 or raw bytes, compressed or not.
use super::base64;
use crate::files::cursor::{Number, Scalar, line_number, shown};
use crate::files::error::{FileError, Place, Problem};
use std::borrow::Cow;
use std::path::Path;

/// How the whole file stores its arrays.
pub(super) struct Storage<'a> {
    pub(super) path: &'a Path,
    pub(super) data: &'a [u8],
    pub(super) big_endian: bool,
    /// Type of the lengths before binary data.
    pub(super) header: Scalar,
    pub(super) compressor: String,
    /// Where the appended data begin, and whether they are base64.
    pub(super) appended: Option<(usize, bool)>,
}

/// Where an array has its values.
pub(super) enum Source {
    Ascii(String),
    Inline(String),
    Appended(usize),
}

/// A `DataArray` element.
pub(super) struct DataArray {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    pub(super) components: usize,
    pub(super) source: Source,
    /// Where its element is in the file.
    pub(super) at: usize,
}

/// The first so many bytes of an array's binary data.
type Fetch<'a> = dyn Fn(usize) -> Result<Cow<'a, [u8]>, FileError> + 'a;

impl Storage<'_> {
    /// An error at byte `at`: the line, where what stands before it is text.
    pub(super) fn fail(&self, at: usize, problem: Problem) -> FileError {
        let before = &self.data[..at.min(self.data.len())];
        let place = match self.appended {
            Some((start, false)) if at >= start => Place::Byte(at),
            _ => Place::Line(line_number(before)),
        };
        FileError::new(self.path, place, problem)
    }

    /// The values as integers.
    pub(super) fn integers(&self, array: &DataArray) -> Result<Vec<i64>, FileError> {
        self.numbers(array, "an integer", Number::integer)
    }

    /// The values as real numbers.
    pub(super) fn reals(&self, array: &DataArray) -> Result<Vec<f64>, FileError> {
        self.numbers(array, "a number", |number| Some(number.real()))
    }

    fn numbers<T>(
        &self,
        array: &DataArray,
        wanted: &str,
        convert: impl Fn(Number) -> Option<T>,
    ) -> Result<Vec<T>, FileError> {
        let wrong = |found: String| {
            let wanted = format!("{wanted} in array `{}`", shown(array.name.as_bytes()));
            self.fail(array.at, Problem::Expected { wanted, found })
        };
        if let Source::Ascii(text) = &array.source {
            let whole = array.scalar.is_integer();
            let parse = |word: &str| {
                if whole { word.parse().ok().map(Number::Integer) } else { word.parse().ok().map(Number::Real) }
            };
            let value = |word| parse(word).and_then(&convert).ok_or_else(|| wrong(shown(word.as_bytes())));
            return text.split_ascii_whitespace().map(value).collect();
        }
        let bytes = self.bytes(array)?;
        let size = array.scalar.size();
        if bytes.len() % size != 0 {
            return Err(wrong(format!("{} bytes, which is no multiple of {size}", bytes.len())));
        }
        let decode = |piece| Number::decode(piece, array.scalar, self.big_endian);
        bytes
            .chunks_exact(size)
            .map(|piece| convert(decode(piece)).ok_or_else(|| wrong(format!("{piece:?}"))))
            .collect()
    }

    fn bytes(&self, array: &DataArray) -> Result<Vec<u8>, FileError> {
        let (at, base64, text): (usize, bool, &[u8]) = match (&array.source, self.appended) {
            (Source::Ascii(text) | Source::Inline(text), _) => (array.at, true, text.as_bytes()),
            (Source::Appended(offset), Some((start, base64))) => {
                let at = start.saturating_add(*offset);
                let Some(rest) = self.data.get(at..) else {
                    return Err(self.fail(array.at, truncated(array)));
                };
                (at, base64, rest)
            }
            (Source::Appended(_), None) => {
                let wanted = "the element AppendedData".to_string();
                return Err(self.fail(self.data.len(), Problem::Truncated { wanted }));
            }
        };
        // What follows the array in an appended section may end the base64; only a lack of bytes is an error.
        let fetch = move |count: usize| -> Result<Cow<[u8]>, FileError> {
            let bytes = if base64 {
                Cow::Owned(match base64::decode(text, count) {
                    Ok(bytes) => bytes,
                    Err(place) => {
                        let found = shown(&text[place..]);
                        let wanted = format!("base64 in array `{}`", array.name);
                        return Err(self.fail(at, Problem::Expected { wanted, found }));
                    }
                })
            } else {
                Cow::Borrowed(text.get(..count).unwrap_or_default())
            };
            if bytes.len() < count { Err(self.fail(at, truncated(array))) } else { Ok(bytes) }
        };
        if self.compressor.is_empty() { self.plain(&fetch) } else { self.inflate(array, at, &fetch) }
    }

    /// `length`, then so many bytes.
    fn plain(&self, fetch: &Fetch) -> Result<Vec<u8>, FileError> {
        let header = self.header.size();
        let length = self.lengths(&fetch(header)?)[0];
        Ok(fetch(header.saturating_add(length))?[header..].to_vec())
    }

    /// `blocks, block-size, last-size, compressed-sizes…`, then the blocks. A last size of 0 is a full block.
    fn inflate(&self, array: &DataArray, at: usize, fetch: &Fetch) -> Result<Vec<u8>, FileError> {
        if self.compressor != "vtkZLibDataCompressor" {
            let what = format!("data compressed by {} are not read", shown(self.compressor.as_bytes()));
            let instead = "write it without compression, or with zlib".to_string();
            return Err(self.fail(0, Problem::Unsupported { what, instead }));
        }
        let size = self.header.size();
        let blocks = self.lengths(&fetch(size)?)[0];
        if blocks == 0 {
            return Ok(Vec::new());
        }
        let header = blocks.saturating_add(3).saturating_mul(size);
        let lengths = self.lengths(&fetch(header)?);
        let (block_size, last_size) = (lengths[1], lengths[2]);
        let compressed = lengths[3..].iter().fold(header, |sum, &length| sum.saturating_add(length));
        let stored = fetch(compressed)?;
        let mut rest = &stored[header..];
        let mut bytes = Vec::new();
        for (block, &length) in lengths[3..].iter().enumerate() {
            let (piece, behind) = rest.split_at(length);
            rest = behind;
            let full = if block + 1 == blocks && last_size > 0 { last_size } else { block_size };
            match miniz_oxide::inflate::decompress_to_vec_zlib_with_limit(piece, full) {
                Ok(inflated) if inflated.len() == full => bytes.extend(inflated),
                _ => {
                    let what = format!("block {block} of array `{}` is damaged: zlib cannot expand it", array.name);
                    return Err(self.fail(at, Problem::Inconsistent { what }));
                }
            }
        }
        Ok(bytes)
    }

    fn lengths(&self, bytes: &[u8]) -> Vec<usize> {
        let length = |piece| Number::decode(piece, self.header, self.big_endian).integer();
        let clamped = |piece| length(piece).and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX);
        bytes.chunks_exact(self.header.size()).map(clamped).collect()
    }
}

fn truncated(array: &DataArray) -> Problem {
    Problem::Truncated { wanted: format!("the data of array `{}`", shown(array.name.as_bytes())) }
}
