//! The sections of MSH 2.x.
use super::Reader;
use crate::files::cursor::{Encoding, Scalar};
use crate::files::error::FileError;

/// `count`, then `tag x y z` of every node; of a parametric one also `dimension entity`, and as many parameters as the
/// curve or surface has that the node is on.
pub(super) fn nodes(reader: &mut Reader, parametric: bool) -> Result<(), FileError> {
    let count = section_count(reader, "nodes", 28, 8)?;
    for _ in 0..count {
        let tag = reader.int("the tag of a node")?;
        let position = reader.position()?;
        reader.add_node(tag, position)?;
        if parametric {
            parameters(reader)?;
        }
    }
    reader.end(if parametric { "ParametricNodes" } else { "Nodes" })
}

fn parameters(reader: &mut Reader) -> Result<(), FileError> {
    let dimension = reader.int("the dimension of a node's entity")?;
    reader.int("the tag of a node's entity")?;
    let parameters = match dimension {
        1 | 2 => dimension,
        0 | 3 => 0,
        _ => {
            let found = dimension.to_string();
            return Err(reader.cursor.expected("the dimension of a node's entity, 0 to 3", found.as_bytes()));
        }
    };
    for _ in 0..parameters {
        reader.cursor.optional_real(Scalar::F64, "a parametric coordinate")?.ok();
    }
    Ok(())
}

/// Text: `tag type tag-count tags… nodes…` of every element. Binary: blocks `type block-size tag-count`, behind each
/// `tag tags… nodes…` of its elements. The first of the tags is the physical group, 0 for none.
pub(super) fn elements(reader: &mut Reader) -> Result<(), FileError> {
    let count = section_count(reader, "elements", 8, 8)?;
    let mut read = 0;
    while read < count {
        if reader.cursor.encoding == Encoding::Ascii {
            let tag = reader.int("the tag of an element")?;
            let number = reader.int("the type of an element")?;
            let tags = reader.int("the number of tags of an element")?;
            element(reader, tag, number, tags)?;
            read += 1;
            continue;
        }
        let number = reader.int("the type of a block of elements")?;
        let block = reader.int("the number of elements of a block")?;
        if block <= 0 || block as usize > count - read {
            let wanted = format!("a block of 1 to {} elements", count - read);
            return Err(reader.cursor.expected(&wanted, block.to_string().as_bytes()));
        }
        let tags = reader.int("the number of tags of an element")?;
        for _ in 0..block {
            let tag = reader.int("the tag of an element")?;
            element(reader, tag, number, tags)?;
        }
        read += block as usize;
    }
    reader.end("Elements")
}

fn element(reader: &mut Reader, tag: i64, number: i64, tags: i64) -> Result<(), FileError> {
    let (kind, node_count) = reader.kind(number)?;
    let least = reader.least(4);
    let mut physical = 0;
    for place in 0..reader.cursor.check_count(tags, least, "tags of an element")? {
        let value = reader.int("the tag of an element")?;
        if place == 0 {
            physical = value.saturating_abs();
        }
    }
    let nodes = reader.nodes_of(tag, node_count, Scalar::I32)?;
    reader.builder.element(kind, &nodes, if physical == 0 { &[] } else { std::slice::from_ref(&physical) });
    Ok(())
}

/// The count of a section, always text on a line of its own.
fn section_count(reader: &mut Reader, what: &str, binary: usize, text: usize) -> Result<usize, FileError> {
    let count = reader.cursor.parse(&format!("the number of {what}"))?;
    let bytes_each = if reader.cursor.encoding == Encoding::Ascii { text } else { binary };
    let count = reader.cursor.check_count(count, bytes_each, what)?;
    if reader.cursor.encoding != Encoding::Ascii {
        reader.end_of_line()?;
    }
    Ok(count)
}
