//! The attributes behind the geometry of a legacy file. Only the cell array that tells groups is kept.
use super::cells::Groups;
use super::legacy::next_line;
use crate::files::cursor::{Cursor, Encoding, Scalar};
use crate::files::error::{FileError, Problem};

/// The number type by its name.
pub(super) fn scalar(cursor: &Cursor, name: &str) -> Result<Scalar, FileError> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "char" => Scalar::I8,
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
        "bit" | "string" | "variant" | "utf8_string" => {
            let what = format!("arrays of type {name} are not read");
            let instead = "save the mesh without this array, or as VTU".to_string();
            return Err(cursor.fail(Problem::Unsupported { what, instead }));
        }
        _ => return Err(cursor.expected("a number type of VTK (char … double)", name.as_bytes())),
    })
}

/// The arrays behind `CELL_DATA count` or `POINT_DATA count`; those of cells are offered to `groups`.
pub(super) fn read(cursor: &mut Cursor, count: &str, mut groups: Option<&mut Groups>) -> Result<(), FileError> {
    let tuples = number(cursor, count)?;
    loop {
        let mut ahead = cursor.clone();
        let Some(words) = next_line(&mut ahead)? else { return Ok(()) };
        if matches!(words.as_slice(), ["CELL_DATA" | "POINT_DATA", _]) {
            return Ok(());
        }
        *cursor = ahead;
        match *words.as_slice() {
            ["SCALARS", name, kind] => scalars(cursor, name, kind, "1", tuples, groups.as_deref_mut())?,
            ["SCALARS", name, kind, components] => {
                scalars(cursor, name, kind, components, tuples, groups.as_deref_mut())?;
            }
            ["VECTORS" | "NORMALS", _, kind] => array(cursor, kind, tuples, 3, None)?,
            ["TENSORS", _, kind] => array(cursor, kind, tuples, 9, None)?,
            ["TENSORS6", _, kind] => array(cursor, kind, tuples, 6, None)?,
            ["TEXTURE_COORDINATES", _, components, kind] => {
                let components = number(cursor, components)?;
                array(cursor, kind, tuples, components, None)?;
            }
            ["GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS", _, kind] => array(cursor, kind, tuples, 1, None)?,
            ["COLOR_SCALARS", _, components] => {
                let components = number(cursor, components)?;
                array(cursor, "unsigned_char", tuples, components, None)?;
            }
            ["LOOKUP_TABLE", _, size] => {
                let size = number(cursor, size)?;
                array(cursor, "unsigned_char", size, 4, None)?;
            }
            ["FIELD", _, count] => field(cursor, count, groups.as_deref_mut())?,
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
    groups: Option<&mut Groups>,
) -> Result<(), FileError> {
    let components = number(cursor, components)?;
    // The data may begin right behind: blanks must not be passed in search of the line.
    if cursor.rest().starts_with(b"LOOKUP_TABLE") {
        cursor.line();
    }
    array(cursor, kind, tuples, components, groups.map(|groups| (name, groups)))
}

/// `count` arrays, each behind `name components tuples type`.
pub(super) fn field(cursor: &mut Cursor, count: &str, mut groups: Option<&mut Groups>) -> Result<(), FileError> {
    let count: i64 = count.parse().map_err(|_| cursor.expected("a count", count.as_bytes()))?;
    let mut left = cursor.check_count(count, 8, "arrays")?;
    while left > 0 {
        let words = next_line(cursor)?.ok_or_else(|| cursor.truncated("an array of a FIELD"))?;
        match *words.as_slice() {
            ["METADATA", ..] => metadata(cursor),
            [name, components, tuples, kind] => {
                let [components, tuples] = [number(cursor, components)?, number(cursor, tuples)?];
                array(cursor, kind, tuples, components, groups.as_deref_mut().map(|groups| (name, groups)))?;
                left -= 1;
            }
            _ => return Err(cursor.expected("`name components tuples type`", words.join(" ").as_bytes())),
        }
    }
    Ok(())
}

fn array(
    cursor: &mut Cursor,
    kind: &str,
    tuples: usize,
    components: usize,
    groups: Option<(&str, &mut Groups)>,
) -> Result<(), FileError> {
    let scalar = scalar(cursor, kind)?;
    let ascii = cursor.encoding == Encoding::Ascii;
    let count = i64::try_from(tuples.saturating_mul(components)).unwrap_or(i64::MAX);
    let count = cursor.check_count(count, if ascii { 2 } else { scalar.size() }, "values of an array")?;
    match groups.filter(|(name, groups)| groups.wants(name, components)) {
        None if ascii => (0..count).try_for_each(|_| cursor.real(scalar, "a value of an array").map(drop)),
        None => cursor.take(count * scalar.size(), "an array").map(drop),
        Some((name, groups)) => {
            let values: Result<Vec<f64>, _> = (0..count).map(|_| cursor.real(scalar, "a value of an array")).collect();
            groups.offer(name, &values?);
            Ok(())
        }
    }
}

/// Passes a block of metadata, which ends with an empty line.
pub(super) fn metadata(cursor: &mut Cursor) {
    while cursor.line().is_some_and(|line| !line.trim_ascii().is_empty()) {}
}
