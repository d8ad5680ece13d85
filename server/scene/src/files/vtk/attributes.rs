//! The attributes behind the geometry of a legacy file. Only the cell array that tells groups is kept.
use super::cells::Groups;
use super::legacy::next_line;
use crate::files::builder::Builder;
use crate::files::cursor::{Cursor, Encoding, Scalar, shown};
use crate::files::error::FileError;

/// The number type by its name.
pub(super) fn scalar(cursor: &Cursor, name: &str) -> Result<Scalar, FileError> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "char" | "signed_char" => Scalar::I8,
        "unsigned_char" => Scalar::U8,
        "short" => Scalar::I16,
        "unsigned_short" => Scalar::U16,
        // Legacy files store vtkIdType in 32 bits.
        "int" | "vtkidtype" => Scalar::I32,
        "unsigned_int" => Scalar::U32,
        "long" | "long_long" | "vtktypeint64" => Scalar::I64,
        "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Scalar::U64,
        "float" => Scalar::F32,
        "double" => Scalar::F64,
        _ => return Err(cursor.expected("a number type of VTK (char … double)", name.as_bytes())),
    })
}

/// What is kept of the arrays: the groups, if they are of cells; the builder tells what could not be read.
pub(super) struct Keep<'a> {
    pub(super) groups: Option<&'a mut Groups>,
    pub(super) builder: &'a mut Builder,
}

/// The arrays behind `CELL_DATA count` or `POINT_DATA count`.
pub(super) fn read(cursor: &mut Cursor, count: &str, keep: &mut Keep) -> Result<(), FileError> {
    let tuples = number(cursor, count)?;
    loop {
        let mut ahead = cursor.clone();
        let Some(words) = next_line(&mut ahead)? else { return Ok(()) };
        if matches!(words.as_slice(), ["CELL_DATA" | "POINT_DATA", _]) {
            return Ok(());
        }
        *cursor = ahead;
        match *words.as_slice() {
            ["SCALARS", name, kind] => scalars(cursor, name, kind, "1", tuples, keep)?,
            ["SCALARS", name, kind, components] => {
                scalars(cursor, name, kind, components, tuples, keep)?;
            }
            ["VECTORS" | "NORMALS", name, kind] => unused(cursor, name, kind, tuples, 3, keep)?,
            ["TENSORS", name, kind] => unused(cursor, name, kind, tuples, 9, keep)?,
            ["TENSORS6", name, kind] => unused(cursor, name, kind, tuples, 6, keep)?,
            ["TEXTURE_COORDINATES", name, components, kind] => {
                let components = number(cursor, components)?;
                unused(cursor, name, kind, tuples, components, keep)?;
            }
            ["GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS", name, kind] => unused(cursor, name, kind, tuples, 1, keep)?,
            ["COLOR_SCALARS", name, components] => {
                let components = number(cursor, components)?;
                unused(cursor, name, "unsigned_char", tuples, components, keep)?;
            }
            ["LOOKUP_TABLE", name, size] => {
                let size = number(cursor, size)?;
                unused(cursor, name, "unsigned_char", size, 4, keep)?;
            }
            ["FIELD", _, count] => field(cursor, count, keep)?,
            ["METADATA", ..] => metadata(cursor),
            _ => return Err(cursor.expected("an attribute of VTK's legacy format", words.join(" ").as_bytes())),
        }
    }
}

fn number(cursor: &Cursor, word: &str) -> Result<usize, FileError> {
    word.parse().map_err(|_| cursor.expected("a count", word.as_bytes()))
}

fn scalars(
    cursor: &mut Cursor,
    name: &str,
    kind: &str,
    components: &str,
    tuples: usize,
    keep: &mut Keep,
) -> Result<(), FileError> {
    let components = number(cursor, components)?;
    // The data may begin right behind: blanks must not be passed in search of the line.
    if cursor.rest().starts_with(b"LOOKUP_TABLE") {
        cursor.line();
    }
    array(cursor, name, kind, tuples, components, keep)
}

/// `count` arrays, each behind `name components tuples type`.
pub(super) fn field(cursor: &mut Cursor, count: &str, keep: &mut Keep) -> Result<(), FileError> {
    let count: i64 = count.parse().map_err(|_| cursor.expected("a count", count.as_bytes()))?;
    let mut left = cursor.check_count(count, 8, "arrays")?;
    while left > 0 {
        let words = next_line(cursor)?.ok_or_else(|| cursor.truncated("an array of a FIELD"))?;
        match *words.as_slice() {
            ["METADATA", ..] => metadata(cursor),
            [name, components, tuples, kind] => {
                let [components, tuples] = [number(cursor, components)?, number(cursor, tuples)?];
                array(cursor, name, kind, tuples, components, keep)?;
                left -= 1;
            }
            _ => return Err(cursor.expected("`name components tuples type`", words.join(" ").as_bytes())),
        }
    }
    Ok(())
}

fn array(
    cursor: &mut Cursor,
    name: &str,
    kind: &str,
    tuples: usize,
    components: usize,
    keep: &mut Keep,
) -> Result<(), FileError> {
    let wanted = keep.groups.as_ref().is_some_and(|groups| groups.wants(name, components));
    let is_number = !NO_NUMBERS.contains(&kind.to_ascii_lowercase().as_str());
    let Some(groups) = keep.groups.as_deref_mut().filter(|_| wanted && is_number) else {
        return unused(cursor, name, kind, tuples, components, keep);
    };
    let scalar = scalar(cursor, kind)?;
    let least = if cursor.encoding == Encoding::Ascii { 2 } else { scalar.size() };
    let count = cursor.check_count(values(tuples, components), least, "values of an array")?;
    let mut found = Vec::with_capacity(count);
    for _ in 0..count {
        found.push(value(cursor, name, scalar, keep.builder)?);
    }
    groups.offer(name, &found);
    Ok(())
}

/// A value, NaN where a word tells of none.
fn value(cursor: &mut Cursor, name: &str, scalar: Scalar, builder: &mut Builder) -> Result<f64, FileError> {
    Ok(cursor.optional_real(scalar, "a value of an array")?.unwrap_or_else(|word| {
        builder.leave_out(name, || format!("has `{}`{}", shown(word), cursor.place()));
        f64::NAN
    }))
}

fn values(tuples: usize, components: usize) -> i64 {
    i64::try_from(tuples.saturating_mul(components)).unwrap_or(i64::MAX)
}

/// Types whose values are no numbers, or none of whole bytes.
const NO_NUMBERS: [&str; 4] = ["bit", "string", "utf8_string", "variant"];

/// What may begin behind an array of strings.
const BEHIND_ARRAYS: [&[u8]; 8] =
    [b"POINTS ", b"CELLS ", b"CELL_DATA ", b"POINT_DATA ", b"FIELD ", b"SCALARS ", b"VECTORS ", b"LOOKUP_TABLE "];

/// Passes an array that nothing uses: whatever its values are, they are no reason to refuse the mesh.
fn unused(
    cursor: &mut Cursor,
    name: &str,
    kind: &str,
    tuples: usize,
    components: usize,
    keep: &mut Keep,
) -> Result<(), FileError> {
    let ascii = cursor.encoding == Encoding::Ascii;
    let count = values(tuples, components);
    let of_type = || format!("of type {}", shown(kind.as_bytes()));
    match kind.to_ascii_lowercase().as_str() {
        "bit" if !ascii => {
            // Eight values a byte.
            cursor.take(usize::try_from(count).unwrap_or(usize::MAX).div_ceil(8), "an array")?;
            keep.builder.leave_out(name, of_type);
        }
        "string" | "utf8_string" if !ascii => {
            for _ in 0..cursor.check_count(count, 1, "strings")? {
                let length = string_length(cursor)?;
                cursor.take(length, "a string")?;
            }
            keep.builder.leave_out(name, of_type);
        }
        // A line each; variants in binary files too.
        "string" | "utf8_string" | "variant" => {
            for _ in 0..cursor.check_count(count, 1, "lines of text")? {
                let line = cursor.line().ok_or_else(|| cursor.truncated("a line of text"))?;
                // Blanks in strings are written as %20: fewer strings are there than announced.
                if BEHIND_ARRAYS.iter().any(|keyword| line.starts_with(keyword)) {
                    return Err(cursor.expected("a line of text in an array", line));
                }
            }
            keep.builder.leave_out(name, of_type);
        }
        kind => {
            let scalar = if kind == "bit" { Scalar::U8 } else { scalar(cursor, kind)? };
            if kind == "bit" {
                keep.builder.leave_out(name, of_type);
            }
            let count = cursor.check_count(count, if ascii { 2 } else { scalar.size() }, "values of an array")?;
            if !ascii {
                return cursor.take(count * scalar.size(), "an array").map(drop);
            }
            for _ in 0..count {
                value(cursor, name, scalar, keep.builder)?;
            }
        }
    }
    Ok(())
}

/// The length before a string of a binary file: the two highest bits tell of how many bytes it is.
fn string_length(cursor: &mut Cursor) -> Result<usize, FileError> {
    const WANTED: &str = "the length of a string";
    let &[first] = cursor.take(1, WANTED)? else { return Err(cursor.truncated(WANTED)) };
    let more = match first >> 6 {
        3 => 0,
        2 => 1,
        1 => 3,
        _ => 7,
    };
    let length = cursor.take(more, WANTED)?.iter().fold(u64::from(first & 0x3f), |n, &b| n << 8 | u64::from(b));
    Ok(usize::try_from(length).unwrap_or(usize::MAX))
}

/// Passes a block of metadata, which ends with an empty line.
pub(super) fn metadata(cursor: &mut Cursor) {
    while cursor.line().is_some_and(|line| !line.trim_ascii().is_empty()) {}
}
