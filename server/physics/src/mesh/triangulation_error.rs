//! Why no springs can be put on a surface.
use glam::DVec3;
use thiserror::Error;

/// Why no springs can be put on a surface.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum TriangulationError {
    /// There are no triangles.
    #[error("the surface has no triangles")]
    Empty,
    /// There are more vertices or triangles than can be numbered once they are refined.
    #[error("the surface has {count} {what}, more than {most} can be refined")]
    TooMany {
        /// Triangles or vertices.
        what: &'static str,
        /// Their number.
        count: usize,
        /// The largest number that can be refined.
        most: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("vertex {vertex} of the surface has a coordinate that is not finite: {position}")]
    NonFinite {
        /// Index, from 0.
        vertex: usize,
        /// Its position.
        position: DVec3,
    },
    /// A triangle names a vertex that does not exist.
    #[error("triangle {triangle} refers to vertex {vertex}, but there are only {vertices}")]
    OutOfRange {
        /// Index, from 0.
        triangle: usize,
        /// The vertex it names.
        vertex: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// A triangle has one vertex twice, or its corners on a line.
    #[error(
        "triangle {triangle} (vertices {}, {}, {}) has no area: remove it, or merge the vertices that coincide",
        corners[0], corners[1], corners[2]
    )]
    NoArea {
        /// Index, from 0.
        triangle: usize,
        /// Its corners.
        corners: [u32; 3],
    },
    /// An edge has more than two triangles.
    #[error("the edge from vertex {} to vertex {} has {count} triangles: a surface has one or two at every edge", edge[0], edge[1])]
    CrowdedEdge {
        /// Its ends.
        edge: [u32; 2],
        /// Number of its triangles.
        count: usize,
    },
    /// Two neighbouring triangles have opposite orientations.
    #[error(
        "triangles {} and {} go the same way along the edge from vertex {} to vertex {}: turn one of them round",
        triangles[0], triangles[1], edge[0], edge[1]
    )]
    Turned {
        /// The two triangles.
        triangles: [u32; 2],
        /// The edge that they share.
        edge: [u32; 2],
    },
    /// A vertex has no triangles.
    #[error("vertex {vertex} belongs to no triangle: no spring would hold it but its own; remove it")]
    Isolated {
        /// Index, from 0.
        vertex: usize,
    },
    /// Parts of the surface are connected by a vertex only.
    #[error(
        "the triangles around vertex {vertex} are {fans} fans that touch in it only: give each a vertex of its own"
    )]
    SeveralFans {
        /// Index, from 0.
        vertex: usize,
        /// Number of fans.
        fans: usize,
    },
}
