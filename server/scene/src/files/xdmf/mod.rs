//! XDMF, versions 2 and 3, as meshio, FEniCS and ParaView write it: grids of cells, their numbers in the XML or in raw
//! files beside.
use super::builder::Builder;
use super::cursor::shown;
use super::error::{FileError, Problem};
use super::vtk::cells::{CellTable, Groups};
use crate::wording::counted_as;
use document::Document;
use glam::DVec3;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::Path;

mod document;
mod item;
mod topology;

/// Grids within grids, included ones too: more are no mesh.
const DEEPEST: usize = 64;
/// More grids than any file has that was not made to take long.
const MOST_GRIDS: usize = 100_000;

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    let document = Document::parse(path, data)?;
    let Some(root) = document.root("Xdmf") else {
        let wanted = "the element Xdmf".to_string();
        return Err(document.fail(0, Problem::Expected { wanted, found: "other XML".to_string() }));
    };
    let mut reader = Reader {
        document: &document,
        builder: Builder::default(),
        grids: Vec::new(),
        met: 0,
        nodes_of: HashMap::new(),
        built: HashSet::new(),
    };
    let domains: Vec<usize> =
        document.children(root)?.into_iter().filter(|&child| document.element(child).name == "Domain").collect();
    if domains.len() > 1 {
        reader.builder.note(format!("of {} the first is taken", counted_as(domains.len(), "domains")));
    }
    if let Some(&domain) = domains.first() {
        reader.grids_in(domain, 0)?;
    }
    for grid in std::mem::take(&mut reader.grids) {
        reader.grid(grid)?;
    }
    Ok(reader.builder)
}

struct Reader<'a> {
    document: &'a Document<'a>,
    builder: Builder,
    /// Uniform grids: each has a mesh.
    grids: Vec<usize>,
    /// How many grids of any kind were met on the way, those that are included again and again too.
    met: usize,
    /// The nodes of a Geometry, which several grids may share.
    nodes_of: HashMap<usize, Range<u32>>,
    /// Topologies whose cells are there, with their Geometry.
    built: HashSet<(usize, usize)>,
}

impl Reader<'_> {
    /// Finds the uniform grids in an element, of a collection over time those of its first moment.
    fn grids_in(&mut self, element: usize, depth: usize) -> Result<(), FileError> {
        let all = self.children(element, "Grid")?;
        self.met += all.len();
        if depth > DEEPEST || self.met > MOST_GRIDS {
            let what = "the grids include each other without end".to_string();
            return Err(self.document.fail(element, Problem::Inconsistent { what }));
        }
        for grid in all {
            let own = self.document.element(grid);
            let kind = own.attribute(&["GridType"]).unwrap_or("Uniform").to_ascii_lowercase();
            let over_time =
                own.attribute(&["CollectionType"]).is_some_and(|kind| kind.eq_ignore_ascii_case("temporal"));
            match kind.as_str() {
                "uniform" => self.grids.push(grid),
                "collection" if over_time => self.first_moment(grid, depth)?,
                "collection" | "tree" => self.grids_in(grid, depth + 1)?,
                _ => {
                    let what = format!("a Grid of type `{}` is not read", shown(kind.as_bytes()));
                    let instead = "write the mesh as a Uniform grid".to_string();
                    return Err(self.document.fail(grid, Problem::Unsupported { what, instead }));
                }
            }
        }
        Ok(())
    }

    fn first_moment(&mut self, collection: usize, depth: usize) -> Result<(), FileError> {
        let moments = self.children(collection, "Grid")?;
        let Some(&first) = moments.first() else { return Ok(()) };
        if moments.len() > 1 {
            let name = self.name(collection);
            let moments = counted_as(moments.len(), "moments");
            self.builder.note(format!("of the {moments} of the time series{name} the first is taken"));
        }
        let kind = self.document.element(first).attribute(&["GridType"]).unwrap_or("Uniform");
        if kind.eq_ignore_ascii_case("uniform") {
            self.grids.push(first);
            return Ok(());
        }
        self.grids_in(first, depth + 1)
    }

    fn children(&self, element: usize, name: &str) -> Result<Vec<usize>, FileError> {
        let mut children = self.document.children(element)?;
        children.retain(|&child| self.document.element(child).name == name);
        Ok(children)
    }

    /// Its name in a message, behind a blank.
    fn name(&self, element: usize) -> String {
        let name = self.document.element(element).attribute(&["Name"]).unwrap_or_default();
        if name.is_empty() { String::new() } else { format!(" `{}`", shown(name.as_bytes())) }
    }

    fn grid(&mut self, grid: usize) -> Result<(), FileError> {
        let part = |name: &str| {
            self.children(grid, name)?.first().copied().ok_or_else(|| {
                let what = format!("the grid{} has no {name}", self.name(grid));
                self.document.fail(grid, Problem::Inconsistent { what })
            })
        };
        let (topology, geometry) = (part("Topology")?, part("Geometry")?);
        let shared = self.nodes_of.contains_key(&geometry);
        let nodes = self.nodes(geometry)?;
        let is_new = self.built.insert((topology, geometry));
        let cells = topology::read(self.document, topology)?;
        let tags = self.groups(grid, &cells, shared)?;
        // A moment of a series, or values on a mesh, repeat cells that are there; only their groups are new.
        if is_new || tags.is_some() {
            let built = cells.build(&mut self.builder, &nodes, tags.as_deref());
            built.map_err(|problem| self.document.fail(topology, problem))?;
        }
        Ok(())
    }

    /// The nodes of a Geometry, read once.
    fn nodes(&mut self, geometry: usize) -> Result<Range<u32>, FileError> {
        if let Some(nodes) = self.nodes_of.get(&geometry) {
            return Ok(nodes.clone());
        }
        let first = self.builder.nodes.len() as u32;
        let kind = self.document.element(geometry).attribute(&["GeometryType", "Type"]).unwrap_or("XYZ");
        let items = self.children(geometry, "DataItem")?;
        let arrays = items.iter().map(|&item| item::reals(self.document, item)).collect::<Result<Vec<_>, _>>()?;
        let positions: Vec<DVec3> = match (kind.to_ascii_uppercase().as_str(), arrays.as_slice()) {
            ("XYZ", [all]) if all.len() % 3 == 0 => all.chunks_exact(3).map(DVec3::from_slice).collect(),
            ("XY", [all]) if all.len() % 2 == 0 => all.chunks_exact(2).map(|p| DVec3::new(p[0], p[1], 0.0)).collect(),
            ("X_Y_Z", [x, y, z]) if x.len() == y.len() && y.len() == z.len() => {
                x.iter().zip(y).zip(z).map(|((&x, &y), &z)| DVec3::new(x, y, z)).collect()
            }
            ("XYZ" | "XY" | "X_Y_Z", _) => {
                let counts: Vec<String> = arrays.iter().map(|array| array.len().to_string()).collect();
                let what = format!("a Geometry of type {kind} has {} numbers", counts.join(" and "));
                return Err(self.document.fail(geometry, Problem::Inconsistent { what }));
            }
            _ => {
                let what = format!("a Geometry of type `{}` is not read", shown(kind.as_bytes()));
                let instead = "give the coordinates of every node (GeometryType=\"XYZ\")".to_string();
                return Err(self.document.fail(geometry, Problem::Unsupported { what, instead }));
            }
        };
        if let Some(node) = positions.iter().position(|position| !position.is_finite()) {
            let problem = Problem::NonFinite { node: node as i64, position: positions[node] };
            return Err(self.document.fail(geometry, problem));
        }
        self.builder.nodes.extend(positions);
        let nodes = first..self.builder.nodes.len() as u32;
        self.nodes_of.insert(geometry, nodes.clone());
        Ok(nodes)
    }

    /// The groups of the cells: of the array whose name tells groups. A grid over the nodes of an earlier one, as
    /// dolfinx writes its tags, has them in its one array, whatever its name.
    fn groups(&self, grid: usize, cells: &CellTable, shared: bool) -> Result<Option<Vec<i64>>, FileError> {
        let of_cells = |&attribute: &usize| {
            let own = self.document.element(attribute);
            let is = |keys: &[&str], values: &[&str], default| {
                let value = own.attribute(keys).map(str::to_ascii_lowercase);
                value.map_or(default, |value| values.contains(&value.as_str()))
            };
            is(&["Center"], &["cell"], false) && is(&["AttributeType", "Type"], &["scalar", "none", "globalid"], true)
        };
        let arrays: Vec<usize> = self.children(grid, "Attribute")?.into_iter().filter(of_cells).collect();
        let alone = shared && arrays.len() == 1;
        let mut groups = Groups::default();
        for attribute in arrays {
            let name = self.document.element(attribute).attribute(&["Name"]).unwrap_or_default();
            let telling = if alone && !groups.wants(name, 1) { "cell tags" } else { name };
            let Some(&item) = self.children(attribute, "DataItem")?.first().filter(|_| groups.wants(telling, 1)) else {
                continue;
            };
            let values = item::reals(self.document, item)?;
            let count = cells.types.len();
            if values.len() == count {
                groups.offer(telling, &values);
            } else if count == 0 || values.len() % count != 0 {
                let what = format!("{count} cells have {} values of `{}`", values.len(), shown(name.as_bytes()));
                return Err(self.document.fail(attribute, Problem::Inconsistent { what }));
            }
        }
        Ok(groups.tags)
    }
}
