//! Why two surfaces cannot be filled.
use glam::DVec3;
use palpate_physics::MeshError;
use thiserror::Error;

/// Positions in mm: what a user finds in a viewer.
fn mm(p: &DVec3) -> String {
    format!("({:.3}, {:.3}, {:.3}) mm", p.x * 1e3, p.y * 1e3, p.z * 1e3)
}

/// Why two surfaces cannot be filled. `which` is `inner` or `outer`; positions in metres.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FillError {
    /// No triangles, or none left after dropping degenerate ones.
    #[error("the {which} surface has no triangles with an area; check that the file is the right one")]
    Empty {
        /// Which surface.
        which: &'static str,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of the {which} surface (counting from 0) has a coordinate that is not finite")]
    NonFinite {
        /// Which surface.
        which: &'static str,
        /// The vertex.
        vertex: usize,
    },
    /// A triangle names a vertex that does not exist.
    #[error("the {which} surface refers to vertex {vertex}, but has only {vertices} (counting from 0)")]
    IndexOutOfRange {
        /// Which surface.
        which: &'static str,
        /// The vertex named.
        vertex: u32,
        /// Vertices present.
        vertices: usize,
    },
    /// An option outside its range.
    #[error("{name} = {value}: {rule}")]
    Option {
        /// Name.
        name: &'static str,
        /// Value.
        value: f64,
        /// What it must satisfy.
        rule: &'static str,
    },
    /// A one-sided (Möbius) surface.
    #[error("the {which} surface has no consistent inside and outside: it twists near {}", mm(at_m))]
    NotOrientable {
        /// Which surface.
        which: &'static str,
        /// Near (m).
        at_m: DVec3,
    },
    /// More than one large piece.
    #[error(
        "the {which} surface consists of {parts} separate large parts; a wall needs one connected surface: keep one part, or join them"
    )]
    SeveralParts {
        /// Which surface.
        which: &'static str,
        /// How many.
        parts: usize,
    },
    /// More than one large opening.
    #[error(
        "the {which} surface has {openings} large openings, near {} and {}; at most one (the base) can be left open: close the others",
        mm(first_m),
        mm(second_m)
    )]
    SeveralOpenings {
        /// Which surface.
        which: &'static str,
        /// How many.
        openings: usize,
        /// Middle of the first (m).
        first_m: DVec3,
        /// Middle of the second (m).
        second_m: DVec3,
    },
    /// One surface is open and the other closed.
    #[error("the {open} surface is open at its base and the {closed} surface is closed; both must be alike")]
    OpenAndClosed {
        /// The open one.
        open: &'static str,
        /// The closed one.
        closed: &'static str,
    },
    /// The sizes differ so much that units must be mixed.
    #[error(
        "the inner surface measures {inner_m:.4} m across and the outer {outer_m:.4} m: one of the files is probably in millimetres and the other in metres; give each its unit"
    )]
    Units {
        /// Diagonal of the inner surface's bounding box (m).
        inner_m: f64,
        /// Diagonal of the outer surface's (m).
        outer_m: f64,
    },
    /// The surfaces cut each other.
    #[error(
        "the inner surface crosses the outer at {pairs} pairs of triangles, first near {}; the wall must have a thickness everywhere",
        mm(at_m)
    )]
    Crossing {
        /// First place found (m).
        at_m: DVec3,
        /// Pairs of triangles that cut each other.
        pairs: usize,
    },
    /// The inner surface is not inside the outer.
    #[error("the inner surface does not lie inside the outer, e.g. at {}{}", mm(at_m), if *swapped { ": the two are swapped, or in different units" } else { "; check positions and units" })]
    NotInside {
        /// A point of the inner surface outside (m).
        at_m: DVec3,
        /// The outer one lies inside the inner.
        swapped: bool,
    },
    /// The wall is thinner than can be meshed.
    #[error(
        "the wall is only {:.4} mm thick near {}, less than {:.4} mm (1 % of its mean); separate the surfaces there",
        thickness_m * 1e3,
        mm(at_m),
        least_m * 1e3
    )]
    TooThin {
        /// Where (m).
        at_m: DVec3,
        /// Thickness there (m).
        thickness_m: f64,
        /// Least thickness accepted (m).
        least_m: f64,
    },
    /// The wanted count cannot be met.
    #[error("{wanted} tets cannot fill this wall well: with its area and thickness {lowest} to {highest} can")]
    Count {
        /// Asked for.
        wanted: u32,
        /// Fewest possible.
        lowest: u32,
        /// Most possible.
        highest: u32,
    },
    /// The count came out too far from the wanted one.
    #[error("the wall was filled with {found} tets instead of {wanted}")]
    CountMissed {
        /// Asked for.
        wanted: u32,
        /// Reached.
        found: u32,
    },
    /// The tets are bad.
    #[error(
        "no good mesh was found: near {} a tet has a dihedral angle of {angle_deg:.2}° (at least {wanted_deg:.2}° is needed)",
        mm(at_m)
    )]
    Quality {
        /// Where (m).
        at_m: DVec3,
        /// Smallest dihedral angle (degrees); 0 for an inverted tet.
        angle_deg: f64,
        /// Smallest accepted (degrees).
        wanted_deg: f64,
    },
    /// The mesh is bad in another way.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
