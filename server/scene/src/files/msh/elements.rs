//! Gmsh's element types.
use crate::files::builder::{Kind, Shape};

const LINES: Kind = Kind { shape: Shape::Curve, name: "lines", corners: 2 };
const TRIANGLES: Kind = Kind { shape: Shape::Triangle, name: "triangles", corners: 3 };
const QUADRANGLES: Kind = Kind { shape: Shape::Polygon, name: "quadrangles", corners: 4 };
const TETRAHEDRA: Kind = Kind { shape: Shape::Tet, name: "tetrahedra", corners: 4 };
const HEXAHEDRA: Kind = Kind { shape: Shape::Other, name: "hexahedra", corners: 8 };
const PRISMS: Kind = Kind { shape: Shape::Other, name: "prisms", corners: 6 };
const PYRAMIDS: Kind = Kind { shape: Shape::Other, name: "pyramids", corners: 5 };
const POINTS: Kind = Kind { shape: Shape::Point, name: "points", corners: 1 };

/// The element type by Gmsh's number, and its number of nodes (first, second and higher orders).
pub(super) fn kind(number: i64) -> Option<(Kind, usize)> {
    Some(match number {
        1 => (LINES, 2),
        2 => (TRIANGLES, 3),
        3 => (QUADRANGLES, 4),
        4 => (TETRAHEDRA, 4),
        5 => (HEXAHEDRA, 8),
        6 => (PRISMS, 6),
        7 => (PYRAMIDS, 5),
        8 => (LINES, 3),
        9 => (TRIANGLES, 6),
        10 => (QUADRANGLES, 9),
        11 => (TETRAHEDRA, 10),
        12 => (HEXAHEDRA, 27),
        13 => (PRISMS, 18),
        14 => (PYRAMIDS, 14),
        15 => (POINTS, 1),
        16 => (QUADRANGLES, 8),
        17 => (HEXAHEDRA, 20),
        18 => (PRISMS, 15),
        19 => (PYRAMIDS, 13),
        20 => (TRIANGLES, 9),
        21 => (TRIANGLES, 10),
        22 => (TRIANGLES, 12),
        23 | 24 => (TRIANGLES, 15),
        25 => (TRIANGLES, 21),
        26 => (LINES, 4),
        27 => (LINES, 5),
        28 => (LINES, 6),
        29 => (TETRAHEDRA, 20),
        30 => (TETRAHEDRA, 35),
        31 => (TETRAHEDRA, 56),
        92 => (HEXAHEDRA, 64),
        93 => (HEXAHEDRA, 125),
        _ => return None,
    })
}
