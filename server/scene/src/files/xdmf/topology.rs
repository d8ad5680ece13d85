//! The cells of a `Topology`, in the terms of VTK, whose numbering of corners XDMF shares.
use super::document::Document;
use super::item;
use crate::files::cursor::shown;
use crate::files::error::{FileError, Problem};
use crate::files::vtk::cells::CellTable;

/// A type of cells: XDMF's number and names, lower case, then VTK's number and how many nodes a cell has.
type Type = (i64, &'static [&'static str], i64, usize);

/// Types whose cells have a number of nodes of their own: it stands before these in a mixed topology.
const POLYVERTEX: i64 = 1;
const POLYLINE: i64 = 2;
const POLYGON: i64 = 3;

const TYPES: [Type; 19] = [
    (4, &["triangle"], 5, 3),
    (5, &["quadrilateral"], 9, 4),
    (6, &["tetrahedron"], 10, 4),
    (7, &["pyramid"], 14, 5),
    (8, &["wedge"], 13, 6),
    (9, &["hexahedron"], 12, 8),
    (34, &["edge_3"], 21, 3),
    (35, &["quadrilateral_9", "quad_9"], 28, 9),
    (36, &["triangle_6", "tri_6"], 22, 6),
    (37, &["quadrilateral_8", "quad_8"], 23, 8),
    (38, &["tetrahedron_10", "tet_10"], 24, 10),
    (39, &["pyramid_13"], 27, 13),
    (40, &["wedge_15"], 26, 15),
    (41, &["wedge_18"], 32, 18),
    (48, &["hexahedron_20", "hex_20"], 25, 20),
    (49, &["hexahedron_24", "hex_24"], 33, 24),
    (50, &["hexahedron_27", "hex_27"], 29, 27),
    (51, &["hexahedron_64", "hex_64"], 72, 64),
    (52, &["hexahedron_125", "hex_125"], 72, 125),
];

/// VTK's number for cells of so many nodes; `None`: no such type.
fn of_own_count(number: i64, nodes: usize) -> Option<i64> {
    match (number, nodes) {
        (POLYVERTEX, 1) => Some(1),
        (POLYVERTEX, _) => Some(2),
        (POLYLINE, 2) => Some(3),
        (POLYLINE, _) => Some(4),
        (POLYGON, _) => Some(7),
        _ => None,
    }
}

/// Reads the cells.
pub(super) fn read(document: &Document, topology: usize) -> Result<CellTable, FileError> {
    let element = document.element(topology);
    let name = element.attribute(&["TopologyType", "Type"]).unwrap_or_default();
    let lower = name.to_ascii_lowercase();
    let data = document.children(topology)?.into_iter().find(|&child| document.element(child).name == "DataItem");
    let own = match lower.as_str() {
        "polyvertex" => Some((POLYVERTEX, 1)),
        "polyline" => Some((POLYLINE, 2)),
        "polygon" => Some((POLYGON, 0)),
        _ => None,
    };
    let fixed = TYPES.iter().find(|(_, names, ..)| names.contains(&lower.as_str()));
    let known = own.is_some() || fixed.is_some() || lower == "mixed";
    let Some(data) = data.filter(|_| known && element.attribute(&["Order"]).is_none()) else {
        let what = format!("a Topology of type `{}` is not read", shown(name.as_bytes()));
        let what =
            if known { format!("{what} without a list of its nodes, or with an Order of its own") } else { what };
        let instead = "write an unstructured mesh of tetrahedra, or of hexahedra, wedges and pyramids".to_string();
        return Err(document.fail(topology, Problem::Unsupported { what, instead }));
    };
    let mut nodes = item::integers(document, data)?;
    let mut table = CellTable { offsets: vec![0], ..CellTable::default() };
    match (fixed, own) {
        (Some(&(_, _, number, each)), _) => uniform(&mut table, number, each, nodes.len()),
        (None, Some((number, each))) => {
            let each = match element.attribute(&["NodesPerElement"]).map(str::parse) {
                Some(Ok(each)) if each > 0 => each,
                None if each > 0 => each,
                _ => return Err(inconsistent(document, topology, "a Topology has no NodesPerElement above 0")),
            };
            uniform(&mut table, of_own_count(number, each).unwrap_or_default(), each, nodes.len());
        }
        (None, None) => nodes = mixed(&mut table, &nodes).map_err(|what| inconsistent(document, data, &what))?,
    }
    let last = table.offsets.last().copied().unwrap_or(0);
    if last != nodes.len() as i64 {
        let what = format!("{} nodes are no whole number of cells of type `{}`", nodes.len(), shown(name.as_bytes()));
        return Err(inconsistent(document, data, &what));
    }
    let announced = element.attribute(&["NumberOfElements", "Dimensions"]).unwrap_or_default();
    if let Ok(announced) = announced.trim().parse::<usize>()
        && announced != table.types.len()
    {
        let what = format!("a Topology announces {announced} cells and has {}", table.types.len());
        return Err(inconsistent(document, topology, &what));
    }
    let base: i64 = element.attribute(&["BaseOffset"]).and_then(|base| base.trim().parse().ok()).unwrap_or(0);
    for node in &mut nodes {
        *node = node.saturating_sub(base);
    }
    table.connectivity = nodes;
    Ok(table)
}

fn inconsistent(document: &Document, element: usize, what: &str) -> FileError {
    document.fail(element, Problem::Inconsistent { what: what.to_string() })
}

/// Cells of one type.
fn uniform(table: &mut CellTable, number: i64, each: usize, nodes: usize) {
    let cells = nodes / each;
    table.types = vec![number; cells];
    table.offsets.extend((1..=cells).map(|cell| (cell * each) as i64));
}

/// Cells each behind the number of its type and, where the type does not tell how many nodes it has, their number. The
/// nodes alone.
fn mixed(table: &mut CellTable, data: &[i64]) -> Result<Vec<i64>, String> {
    let mut nodes = Vec::with_capacity(data.len());
    let mut rest = data;
    while let [number, behind @ ..] = rest {
        let (vtk, each, behind) = match (TYPES.iter().find(|(own, ..)| own == number), behind) {
            (Some(&(_, _, vtk, each)), _) => (vtk, each, behind),
            (None, [each, behind @ ..]) => {
                let each = usize::try_from(*each).ok().filter(|&each| each > 0);
                let vtk = each.and_then(|each| of_own_count(*number, each));
                let both = vtk.zip(each);
                let (vtk, each) = both.ok_or_else(|| {
                    format!("cell {} of a mixed Topology is of type {number}, which is not read", table.types.len())
                })?;
                (vtk, each, behind)
            }
            (None, []) => return Err("a mixed Topology ends within a cell".to_string()),
        };
        let Some((own, behind)) = behind.split_at_checked(each) else {
            return Err("a mixed Topology ends within a cell".to_string());
        };
        nodes.extend(own);
        table.types.push(vtk);
        table.offsets.push(nodes.len() as i64);
        rest = behind;
    }
    Ok(nodes)
}
