//! Gmsh's element types.
use crate::files::builder::{Kind, Shape};
use crate::files::split::Solid;

const LINES: Kind = Kind { shape: Shape::Curve, name: "lines", corners: 2 };
const TRIANGLES: Kind = Kind { shape: Shape::Triangle, name: "triangles", corners: 3 };
const QUADRANGLES: Kind = Kind { shape: Shape::Polygon, name: "quadrangles", corners: 4 };
const TETRAHEDRA: Kind = Kind { shape: Shape::Tet, name: "tetrahedra", corners: 4 };
const TRIHEDRA: Kind = Kind { shape: Shape::Other, name: "trihedra", corners: 4 };
const POINTS: Kind = Kind { shape: Shape::Point, name: "points", corners: 1 };

/// The element type by Gmsh's number, and its number of nodes (first, second and higher orders).
pub(super) fn kind(number: i64) -> Option<(Kind, usize)> {
    let [hexahedra, prisms, pyramids] = [Solid::Hexahedron, Solid::Prism, Solid::Pyramid].map(Kind::solid);
    Some(match number {
        1 => (LINES, 2),
        2 => (TRIANGLES, 3),
        3 => (QUADRANGLES, 4),
        4 => (TETRAHEDRA, 4),
        5 => (hexahedra, 8),
        6 => (prisms, 6),
        7 => (pyramids, 5),
        8 => (LINES, 3),
        9 => (TRIANGLES, 6),
        10 => (QUADRANGLES, 9),
        11 => (TETRAHEDRA, 10),
        12 => (hexahedra, 27),
        13 => (prisms, 18),
        14 => (pyramids, 14),
        15 => (POINTS, 1),
        16 => (QUADRANGLES, 8),
        17 => (hexahedra, 20),
        18 => (prisms, 15),
        19 => (pyramids, 13),
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
        90 => (prisms, 40),
        91 => (prisms, 75),
        92 => (hexahedra, 64),
        93 => (hexahedra, 125),
        118 => (pyramids, 30),
        119 => (pyramids, 55),
        // Flat: between a quadrangle and two triangles.
        140 => (TRIHEDRA, 4),
        _ => return None,
    })
}
