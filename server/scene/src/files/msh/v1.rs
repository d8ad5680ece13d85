//! MSH 1.0: `$NOD` and `$ELM`, always text.
use super::Reader;
use crate::files::error::FileError;

/// `count`, then `tag x y z` of every node.
pub(super) fn nodes(reader: &mut Reader) -> Result<(), FileError> {
    let count = reader.cursor.parse("the number of nodes")?;
    for _ in 0..reader.cursor.check_count(count, 8, "nodes")? {
        let tag = reader.int("the tag of a node")?;
        let position = reader.position()?;
        reader.add_node(tag, position)?;
    }
    end(reader, "$ENDNOD")
}

/// `count`, then `tag type physical elementary node-count nodes…` of every element; physical 0 is none.
pub(super) fn elements(reader: &mut Reader) -> Result<(), FileError> {
    let count = reader.cursor.parse("the number of elements")?;
    for _ in 0..reader.cursor.check_count(count, 12, "elements")? {
        let tag = reader.int("the tag of an element")?;
        let number = reader.int("the type of an element")?;
        let (kind, node_count) = reader.kind(number)?;
        let physical = reader.int("the physical group of an element")?.saturating_abs();
        reader.int("the elementary entity of an element")?;
        let stated = reader.int("the number of nodes of an element")?;
        if stated != node_count as i64 {
            let wanted = format!("{node_count} nodes of element {tag} (type {number})");
            return Err(reader.cursor.expected(&wanted, stated.to_string().as_bytes()));
        }
        let nodes = reader.nodes_of(tag, node_count, crate::files::cursor::Scalar::I32)?;
        reader.builder.element(kind, &nodes, if physical == 0 { &[] } else { std::slice::from_ref(&physical) });
    }
    end(reader, "$ENDELM")
}

fn end(reader: &mut Reader, wanted: &str) -> Result<(), FileError> {
    let word = reader.cursor.text(wanted)?;
    if word == wanted { Ok(()) } else { Err(reader.cursor.expected(wanted, word.as_bytes())) }
}
