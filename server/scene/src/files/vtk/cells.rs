//! VTK's cells, and the cell array that tells their groups.
use crate::files::builder::{Builder, Kind, Shape};
use crate::files::error::Problem;
use crate::files::split::Solid;
use std::ops::Range;

/// The element type by VTK's number.
fn kind(number: i64) -> Option<Kind> {
    let (shape, name, corners) = match number {
        1 => (Shape::Point, "points", 1),
        2 => (Shape::Other, "sets of points", 0),
        3 | 21 | 35 | 68 | 75 => (Shape::Curve, "lines", 2),
        // Chains of lines are drawn for their own sake.
        4 => (Shape::Other, "lines", 2),
        5 | 22 | 34 | 69 | 76 => (Shape::Triangle, "triangles", 3),
        7 => (Shape::Polygon, "polygons", usize::MAX),
        8 => (Shape::Polygon, "pixels", 4),
        9 | 23 | 28 | 30 | 70 | 77 => (Shape::Polygon, "quadrangles", 4),
        10 | 24 | 71 | 78 => (Shape::Tet, "tetrahedra", 4),
        11 | 12 | 25 | 29 | 33 | 72 | 79 => return Some(Kind::solid(Solid::Hexahedron)),
        13 | 26 | 31 | 32 | 73 | 80 => return Some(Kind::solid(Solid::Prism)),
        14 | 27 | 37 | 74 | 81 => return Some(Kind::solid(Solid::Pyramid)),
        15 | 16 | 36 | 41 | 42 => (Shape::Other, "polygons and polyhedra of other types", 0),
        _ => return None,
    };
    Some(Kind { shape, name, corners })
}

const PIXEL: i64 = 8;
const VOXEL: i64 = 11;
pub(super) const VERTICES: i64 = 2;
pub(super) const LINES: i64 = 4;
pub(super) const STRIP: i64 = 6;
pub(super) const POLYGON: i64 = 7;

/// Cells of any types: those of cell `i` are `connectivity[offsets[i]..offsets[i + 1]]`.
#[derive(Debug, Default)]
pub(in crate::files) struct CellTable {
    pub(in crate::files) connectivity: Vec<i64>,
    pub(in crate::files) offsets: Vec<i64>,
    pub(in crate::files) types: Vec<i64>,
}

impl CellTable {
    /// Adds the cells to `builder`, of whose nodes `own` are theirs; `tags` has a group for each, if any.
    pub(in crate::files) fn build(
        &self,
        builder: &mut Builder,
        own: &Range<u32>,
        tags: Option<&[i64]>,
    ) -> Result<(), Problem> {
        let cells = self.types.len();
        let differ = |what: String| Problem::Inconsistent { what };
        if self.offsets.len() != cells + 1 {
            return Err(differ(format!("{} cells have offsets, {cells} have types", self.offsets.len().max(1) - 1)));
        }
        if tags.is_some_and(|tags| tags.len() != cells) {
            return Err(differ(format!("{cells} cells have {} values of their group", tags.unwrap_or_default().len())));
        }
        let mut nodes = Vec::new();
        for cell in 0..cells {
            self.nodes_of(cell, own, &mut nodes)?;
            let tag = tags.map(|tags| &tags[cell..=cell]).unwrap_or_default();
            self.add(builder, cell, &nodes, tag)?;
        }
        Ok(())
    }

    fn nodes_of(&self, cell: usize, own: &Range<u32>, nodes: &mut Vec<u32>) -> Result<(), Problem> {
        let [from, to] = [self.offsets[cell], self.offsets[cell + 1]];
        let range = usize::try_from(from).ok().zip(usize::try_from(to).ok());
        let Some(corners) = range.and_then(|(from, to)| self.connectivity.get(from..to)) else {
            let known = self.connectivity.len();
            return Err(Problem::Inconsistent {
                what: format!("cell {cell} has offsets {from} to {to} of {known} indices"),
            });
        };
        nodes.clear();
        for &node in corners {
            let count = own.end - own.start;
            if !(0..i64::from(count)).contains(&node) {
                let known = format!("there are {count}, counting from 0");
                return Err(Problem::UnknownNode { element: format!("cell {cell}"), node, known });
            }
            nodes.push(own.start + node as u32);
        }
        Ok(())
    }

    fn add(&self, builder: &mut Builder, cell: usize, nodes: &[u32], tag: &[i64]) -> Result<(), Problem> {
        let number = self.types[cell];
        if number == STRIP {
            // Every other triangle of a strip runs the other way round.
            const TRIANGLE: Kind = Kind { shape: Shape::Triangle, name: "triangles", corners: 3 };
            for (place, t) in nodes.windows(3).enumerate() {
                let corners = if place % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
                builder.element(TRIANGLE, &corners, tag);
            }
            return Ok(());
        }
        let Some(kind) = kind(number) else {
            let what = format!("cell {cell} has type {number}, which is no cell type of VTK");
            return Err(Problem::Inconsistent { what });
        };
        let fits = match (kind.shape, number) {
            (Shape::Other, _) | (_, POLYGON) => true,
            (_, 1 | 3 | 5 | 8..=14) => nodes.len() == kind.corners,
            _ => nodes.len() > kind.corners,
        };
        if !fits {
            let what = format!("cell {cell} (type {number}, {}) has {} nodes", kind.name, nodes.len());
            return Err(Problem::Inconsistent { what });
        }
        match *nodes {
            // Pixels and voxels count their corners along the axes, not around.
            [a, b, c, d] if number == PIXEL => builder.element(kind, &[a, b, d, c], tag),
            [a, b, c, d, e, f, g, h] if number == VOXEL => builder.element(kind, &[a, b, d, c, e, f, h, g], tag),
            _ => builder.element(kind, nodes, tag),
        }
        Ok(())
    }
}

/// Names of cell arrays that tell a group, the most telling first; compared without case, spaces, `_` and `-`.
const GROUP_ARRAYS: [&str; 16] = [
    "gmsh:physical",
    "physical",
    "physicalid",
    "tetgen:ref",
    "medit:ref",
    "celltags",
    "region",
    "regionid",
    "regions",
    "material",
    "materialid",
    "group",
    "groupid",
    "part",
    "partid",
    "cellentityids",
];

/// The cell array that tells the groups, among those seen so far.
#[derive(Debug, Default)]
pub(in crate::files) struct Groups {
    best: Option<usize>,
    pub(in crate::files) tags: Option<Vec<i64>>,
}

impl Groups {
    /// Whether an array of this name would be taken.
    pub(in crate::files) fn wants(&self, name: &str, components: usize) -> bool {
        components == 1 && rank(name).is_some_and(|rank| self.best.is_none_or(|best| rank < best))
    }

    /// Offers an array; one with values that are not whole is no group.
    pub(in crate::files) fn offer(&mut self, name: &str, values: &[f64]) {
        if self.wants(name, 1) && values.iter().all(|v| v.fract() == 0.0 && v.abs() < 9e15) {
            self.best = rank(name);
            self.tags = Some(values.iter().map(|&v| v as i64).collect());
        }
    }
}

fn rank(name: &str) -> Option<usize> {
    // Legacy files write a blank in a name as %20.
    let name = name.replace("%20", "");
    let plain: String = name.chars().filter(|c| !matches!(c, ' ' | '_' | '-')).flat_map(char::to_lowercase).collect();
    GROUP_ARRAYS.iter().position(|known| *known == plain)
}
