//! The numbers of a `DataItem`: in its text, or in a raw file beside.
use super::document::Document;
use crate::files::cursor::{Number, Scalar, shown};
use crate::files::error::{FileError, Problem};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};

/// The numbers as real ones.
pub(super) fn reals(document: &Document, item: usize) -> Result<Vec<f64>, FileError> {
    numbers(document, item, "a number", |number| Some(number.real()))
}

/// The numbers as integers.
pub(super) fn integers(document: &Document, item: usize) -> Result<Vec<i64>, FileError> {
    numbers(document, item, "an integer", Number::integer)
}

fn numbers<T>(
    document: &Document,
    item: usize,
    wanted: &str,
    convert: impl Fn(Number) -> Option<T>,
) -> Result<Vec<T>, FileError> {
    let element = document.element(item);
    if let Some(kind) = element.attribute(&["ItemType"]).filter(|kind| !kind.eq_ignore_ascii_case("uniform")) {
        let what = format!("a DataItem of type `{}` is not read", shown(kind.as_bytes()));
        return Err(document.fail(item, Problem::Unsupported { what, instead: CONVERT.to_string() }));
    }
    let count = count(document, item)?;
    let format = element.attribute(&["Format"]).unwrap_or("XML");
    match format.to_ascii_lowercase().as_str() {
        "xml" => text(document, item, count, wanted, convert),
        "binary" => raw(document, item, count, wanted, convert),
        "hdf" | "hdf5" => {
            let file = element.text.trim().split(':').next().unwrap_or_default();
            let what = format!("its numbers are in the HDF5 file `{}`, which is not read", shown(file.as_bytes()));
            Err(document.fail(item, Problem::Unsupported { what, instead: WITHOUT_HDF5.to_string() }))
        }
        _ => {
            let what = format!("a DataItem of format `{}` is not read", shown(format.as_bytes()));
            Err(document.fail(item, Problem::Unsupported { what, instead: CONVERT.to_string() }))
        }
    }
}

const CONVERT: &str = "write the numbers into the XML (Format=\"XML\"), or save the mesh as VTU";
const WITHOUT_HDF5: &str = "put the numbers into the XML: a file of meshio's by `meshio ascii FILE.xdmf`, which \
     rewrites it; from dolfinx by XDMFFile(…, encoding=XDMFFile.Encoding.ASCII); or save the mesh as VTU, from ParaView \
     or by `meshio convert FILE.xdmf FILE.vtu`";

/// The product of the `Dimensions`.
fn count(document: &Document, item: usize) -> Result<usize, FileError> {
    let dimensions = document.element(item).attribute(&["Dimensions"]).unwrap_or_default();
    let product = dimensions.split_ascii_whitespace().map(|word| word.parse::<usize>().ok());
    let product = product.reduce(|a, b| a?.checked_mul(b?)).flatten();
    product.ok_or_else(|| {
        let wanted = "the Dimensions of a DataItem, whole numbers".to_string();
        document.fail(item, Problem::Expected { wanted, found: shown(dimensions.as_bytes()) })
    })
}

fn scalar(document: &Document, item: usize) -> Result<Scalar, FileError> {
    let element = document.element(item);
    let kind = element.attribute(&["NumberType", "DataType"]).unwrap_or("Float").to_ascii_lowercase();
    let precision = element.attribute(&["Precision"]).unwrap_or(match kind.as_str() {
        "char" | "uchar" => "1",
        "short" | "ushort" => "2",
        _ => "4",
    });
    Ok(match (kind.as_str(), precision.trim()) {
        ("float", "4") => Scalar::F32,
        ("float", "8") => Scalar::F64,
        ("int" | "char", "1") => Scalar::I8,
        ("uint" | "uchar", "1") => Scalar::U8,
        ("int" | "short", "2") => Scalar::I16,
        ("uint" | "ushort", "2") => Scalar::U16,
        ("int", "4") => Scalar::I32,
        ("uint", "4") => Scalar::U32,
        ("int", "8") => Scalar::I64,
        ("uint", "8") => Scalar::U64,
        _ => {
            let wanted = "a NumberType of XDMF (Float, Int, UInt, Char …) with a Precision that it has".to_string();
            let found = shown(format!("{kind} of {precision} bytes").as_bytes());
            return Err(document.fail(item, Problem::Expected { wanted, found }));
        }
    })
}

fn text<T>(
    document: &Document,
    item: usize,
    count: usize,
    wanted: &str,
    convert: impl Fn(Number) -> Option<T>,
) -> Result<Vec<T>, FileError> {
    let words = &document.element(item).text;
    // A number and the blank behind it; the last has none.
    if count.checked_mul(2).is_none_or(|bytes| bytes > words.len() + 1) {
        let problem = Problem::Count { what: "numbers".to_string(), count: count as i128, room: words.len() };
        return Err(document.fail(item, problem));
    }
    let mut found = Vec::with_capacity(count);
    for word in words.split_ascii_whitespace() {
        let integer = word.parse().ok().map(Number::Integer);
        let number = integer.or_else(|| word.parse().ok().map(Number::Real)).and_then(&convert);
        found.push(number.ok_or_else(|| {
            let wanted = format!("{wanted} in a DataItem");
            document.fail(item, Problem::Expected { wanted, found: shown(word.as_bytes()) })
        })?);
    }
    if found.len() == count {
        return Ok(found);
    }
    let what = format!("a DataItem announces {count} numbers and has {}", found.len());
    Err(document.fail(item, Problem::Inconsistent { what }))
}

fn raw<T>(
    document: &Document,
    item: usize,
    count: usize,
    wanted: &str,
    convert: impl Fn(Number) -> Option<T>,
) -> Result<Vec<T>, FileError> {
    let element = document.element(item);
    let wrong = |wanted: &str, found: &str| {
        document.fail(item, Problem::Expected { wanted: wanted.to_string(), found: shown(found.as_bytes()) })
    };
    let endian = element.attribute(&["Endian"]).unwrap_or("Native");
    let big_endian = match endian.to_ascii_lowercase().as_str() {
        "little" => false,
        "big" => true,
        "native" => cfg!(target_endian = "big"),
        _ => return Err(wrong("Little, Big or Native as Endian", endian)),
    };
    if let Some(by) = element.attribute(&["Compression"]).filter(|by| !by.eq_ignore_ascii_case("raw")) {
        let what = format!("data compressed by {} are not read", shown(by.as_bytes()));
        return Err(document.fail(item, Problem::Unsupported { what, instead: CONVERT.to_string() }));
    }
    let seek = element.attribute(&["Seek"]).unwrap_or("0");
    let start: u64 = seek.trim().parse().map_err(|_| wrong("the byte to begin with as Seek", seek))?;
    let scalar = scalar(document, item)?;
    let size = scalar.size();
    let bytes = bytes(document, item, start, count.checked_mul(size))?;
    let decode = |piece: &[u8]| {
        let number = convert(Number::decode(piece, scalar, big_endian));
        number.ok_or_else(|| wrong(&format!("{wanted} in a DataItem"), &format!("{piece:?}")))
    };
    bytes.chunks_exact(size).map(decode).collect()
}

/// So many bytes of the file beside; no more memory is set aside than it has.
fn bytes(document: &Document, item: usize, start: u64, length: Option<usize>) -> Result<Vec<u8>, FileError> {
    let name = document.element(item).text.trim();
    let wrong = |what: String| {
        let what = format!("the file `{}`, which has its numbers, {what}", shown(name.as_bytes()));
        let instead = "put the file that was written with this one beside it, or write both again".to_string();
        document.fail(item, Problem::Unsupported { what, instead })
    };
    let io = |error| wrong(format!("cannot be read: {error}"));
    let mut file = File::open(document.path.with_file_name(name)).map_err(io)?;
    let of_file = file.metadata().map_err(io)?;
    if !of_file.is_file() {
        return Err(wrong("is not a regular file".to_string()));
    }
    let end = length.and_then(|length| start.checked_add(length as u64)).filter(|&end| end <= of_file.len());
    let (Some(length), Some(_)) = (length, end) else {
        let needed = length.map_or("too many".to_string(), |length| length.to_string());
        return Err(wrong(format!("has {} bytes; {needed} from byte {start} on are needed", of_file.len())));
    };
    let mut bytes = vec![0; length];
    file.seek(SeekFrom::Start(start)).map_err(io)?;
    file.read_exact(&mut bytes).map_err(io)?;
    Ok(bytes)
}
