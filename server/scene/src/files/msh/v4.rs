//! The sections of MSH 4.1. Text and binary have the same numbers in the same order.
use super::Reader;
use crate::files::cursor::{Encoding, Scalar};
use crate::files::error::FileError;

/// The geometric entities, of which the physical groups are kept. An entity of a partition names its parent too.
pub(super) fn entities(reader: &mut Reader, partitioned: bool) -> Result<(), FileError> {
    binary_follows(reader)?;
    let least = reader.least(4);
    if partitioned {
        reader.count("the number of partitions")?;
        let ghosts = reader.count("the number of ghost entities")?;
        for _ in 0..reader.cursor.check_count(ghosts, 2 * least, "ghost entities")? {
            reader.int("a ghost entity")?;
            reader.int("a partition")?;
        }
    }
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = reader.count("the number of entities")?;
    }
    for (dimension, count) in counts.into_iter().enumerate() {
        for _ in 0..reader.cursor.check_count(count, least, "entities")? {
            entity(reader, dimension as i64, partitioned)?;
        }
    }
    reader.end(if partitioned { "PartitionedEntities" } else { "Entities" })
}

/// `tag [parent-dimension parent-tag partitions…] bounds physical-groups… [bounding entities…]`.
fn entity(reader: &mut Reader, dimension: i64, partitioned: bool) -> Result<(), FileError> {
    let tag = reader.int("the tag of an entity")?;
    if partitioned {
        reader.int("the dimension of a parent entity")?;
        reader.int("the tag of a parent entity")?;
        tags(reader, "partitions")?;
    }
    // A point has its position, the others have the corners of their bounding box.
    for _ in 0..if dimension == 0 { 3 } else { 6 } {
        reader.cursor.optional_real(Scalar::F64, "the bounds of an entity")?.ok();
    }
    let physical = tags(reader, "physical groups")?.into_iter().map(i64::saturating_abs).collect();
    if dimension > 0 {
        tags(reader, "bounding entities")?;
    }
    reader.physical.insert((dimension, tag), physical);
    Ok(())
}

fn tags(reader: &mut Reader, what: &str) -> Result<Vec<i64>, FileError> {
    let count = reader.count(&format!("the number of {what}"))?;
    let least = reader.least(4);
    (0..reader.cursor.check_count(count, least, what)?).map(|_| reader.int(what)).collect()
}

/// Blocks `dimension entity parametric count`; behind each the tags and then the coordinates of its nodes.
pub(super) fn nodes(reader: &mut Reader) -> Result<(), FileError> {
    let blocks = blocks(reader, "nodes")?;
    for _ in 0..blocks {
        let dimension = reader.int("the dimension of an entity")?;
        reader.int("the tag of an entity")?;
        let parametric = reader.int("0 or 1 for parametric coordinates")?;
        let count = reader.count("the number of nodes of a block")?;
        // A tag and three coordinates, and as many parameters as the entity has dimensions.
        let least = reader.least(reader.size.size() + 24).max(8);
        let count = reader.cursor.check_count(count, least, "nodes")?;
        let parameters = if parametric == 0 { 0 } else { dimension.clamp(0, 3) };
        let tags: Vec<i64> = (0..count).map(|_| reader.count("the tag of a node")).collect::<Result<_, _>>()?;
        for tag in tags {
            let position = reader.position()?;
            for _ in 0..parameters {
                reader.cursor.optional_real(Scalar::F64, "a parametric coordinate")?.ok();
            }
            reader.add_node(tag, position)?;
        }
    }
    reader.end("Nodes")
}

/// Blocks `dimension entity type count`; behind each `tag nodes…` of its elements.
pub(super) fn elements(reader: &mut Reader) -> Result<(), FileError> {
    for _ in 0..blocks(reader, "elements")? {
        let dimension = reader.int("the dimension of an entity")?;
        let entity = reader.int("the tag of an entity")?;
        let number = reader.int("the type of a block of elements")?;
        let (kind, node_count) = reader.kind(number)?;
        let count = reader.count("the number of elements of a block")?;
        let least = reader.least(reader.size.size()) * (1 + node_count);
        let count = reader.cursor.check_count(count, least, "elements")?;
        let physical = reader.physical.get(&(dimension, entity)).cloned().unwrap_or_default();
        for _ in 0..count {
            let tag = reader.count("the tag of an element")?;
            let nodes = reader.nodes_of(tag, node_count, reader.size)?;
            reader.builder.element(kind, &nodes, &physical);
        }
    }
    reader.end("Elements")
}

/// `blocks total least-tag greatest-tag`: the number of blocks.
fn blocks(reader: &mut Reader, what: &str) -> Result<usize, FileError> {
    binary_follows(reader)?;
    let blocks = reader.count(&format!("the number of blocks of {what}"))?;
    let blocks = reader.cursor.check_count(blocks, reader.least(12), &format!("blocks of {what}"))?;
    for wanted in ["the total number", "the least tag", "the greatest tag"] {
        reader.count(wanted)?;
    }
    Ok(blocks)
}

fn binary_follows(reader: &mut Reader) -> Result<(), FileError> {
    if reader.cursor.encoding == Encoding::Ascii { Ok(()) } else { reader.end_of_line() }
}
