//! What can be wrong with a mesh file, said so that a user can act on it.
use crate::wording::short;
use glam::DVec3;
use miette::Diagnostic;
use palpate_physics::MeshError;
use std::fmt;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// A mesh file that could not be read, used or written.
#[derive(Debug, Error, Diagnostic)]
#[error("{}{place}: {problem}", path.display())]
#[diagnostic(code(palpate::mesh_file), help("{}", problem.help()))]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// Where in it.
    pub place: Place,
    /// What was wrong.
    pub problem: Box<Problem>,
}

impl FileError {
    pub(crate) fn new(path: &Path, place: Place, problem: Problem) -> Self {
        Self { path: path.to_path_buf(), place, problem: Box::new(problem) }
    }
}

/// A place in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    File,
    /// A line of a text file, from 1.
    Line(usize),
    /// A byte of a binary file, from 0.
    Byte(usize),
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File => Ok(()),
            Self::Line(line) => write!(out, ", line {line}"),
            Self::Byte(byte) => write!(out, ", byte {byte}"),
        }
    }
}

/// What is wrong with a mesh file.
#[derive(Debug, Error)]
pub enum Problem {
    /// The operating system refused.
    #[error("cannot be {action}: {error}")]
    Io {
        /// `read` or `written`.
        action: &'static str,
        /// Why.
        error: std::io::Error,
    },
    /// A directory, a pipe or a device.
    #[error("is not a regular file")]
    NotAFile,
    /// Nothing in it.
    #[error("the file is empty")]
    Empty,
    /// Neither name nor content tell a format.
    #[error("the format is not known, neither by the extension `{extension}` nor by the content")]
    UnknownFormat {
        /// The extension found, without the dot.
        extension: String,
    },
    /// The file ends too early.
    #[error("the file ends where {wanted} was expected; it is truncated")]
    Truncated {
        /// What was expected.
        wanted: String,
    },
    /// Something else stands where a value was expected.
    #[error("expected {wanted}, found `{found}`")]
    Expected {
        /// What was expected.
        wanted: String,
        /// What is there.
        found: String,
    },
    /// A count that the rest of the file cannot hold.
    #[error("announces {count} {what}, but {room} bytes are left in the file; it is truncated or the count is wrong")]
    Count {
        /// What is counted.
        what: String,
        /// How many were announced.
        count: i128,
        /// Bytes left.
        room: usize,
    },
    /// A coordinate is NaN or infinite.
    #[error("node {node} has a coordinate that is not finite: ({}, {}, {})", number(position.x), number(position.y), number(position.z))]
    NonFinite {
        /// The node's number in the file.
        node: i64,
        /// Its position.
        position: DVec3,
    },
    /// An element names a node that is not in the file.
    #[error("{element} refers to node {node}, which does not exist ({known})")]
    UnknownNode {
        /// The element, as the file names it.
        element: String,
        /// The node it names.
        node: i64,
        /// Which nodes there are.
        known: String,
    },
    /// A node number that occurs twice.
    #[error("node {node} is defined twice")]
    DuplicateNode {
        /// Its number in the file.
        node: i64,
    },
    /// Sound in itself, but not readable here.
    #[error("{what}")]
    Unsupported {
        /// What is not supported.
        what: String,
        /// What to do instead.
        instead: String,
    },
    /// Two parts of the file contradict each other.
    #[error("{what}")]
    Inconsistent {
        /// The contradiction.
        what: String,
    },
    /// A volume was wanted, and there is none.
    #[error("holds no tetrahedra (it holds {found})")]
    NoTets {
        /// What is there.
        found: String,
    },
    /// A surface was wanted, and there is none.
    #[error("holds no triangles (it holds {found})")]
    NoTriangles {
        /// What is there.
        found: String,
    },
    /// Some tets are inverted, not all: no other node ordering explains it.
    #[error("{count} of {total} tetrahedra are inverted (numbers {}, counting from 0)", list(first, *count))]
    Inverted {
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
        /// The first few.
        first: Vec<usize>,
    },
    /// Hexahedra, prisms or pyramids that cannot be split into upright tetrahedra.
    #[error(
        "{count} of {total} {solids} {} flat or turned inside out at a corner (numbers {}, counting the {solids} from 0; \
         the first is around ({}, {}, {}) in the file's unit)",
        if *count == 1 { "is" } else { "are" }, list(first, *count), short(place.x), short(place.y), short(place.z)
    )]
    InvertedSolids {
        /// What they are, plural.
        solids: &'static str,
        /// How many.
        count: usize,
        /// Of how many.
        total: usize,
        /// The first few.
        first: Vec<usize>,
        /// The middle of the first.
        place: DVec3,
    },
    /// The factor from the file's unit to metres is no length.
    #[error("the scale from the file's unit to metres is {scale}, which is not positive and finite")]
    Scale {
        /// The factor given.
        scale: f64,
    },
    /// The mesh cannot carry a body.
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

fn list(first: &[usize], count: usize) -> String {
    let mut text = first.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    if count > first.len() {
        text.push_str(", …");
    }
    text
}

impl Problem {
    /// What the user can do about it.
    pub fn help(&self) -> String {
        match self {
            Self::Io { action: "read", .. } => {
                "check the path (relative paths start at the scene file) and its permissions"
            }
            Self::Io { .. } => "check that the directory exists, is writable and has room",
            Self::NotAFile => "give the path of a mesh file",
            Self::Empty | Self::Truncated { .. } | Self::Count { .. } => {
                "copy or export the file again; its writer or the transfer may have been interrupted"
            }
            Self::UnknownFormat { .. } => {
                "volumes: .msh .vtk .vtu .xdmf .node/.ele .mesh; surfaces: .stl .obj .ply .vtk .vtp; see docs/formats.md"
            }
            Self::Expected { .. } => "the file is damaged, or of another format than it claims; export it again",
            Self::NonFinite { .. } | Self::UnknownNode { .. } | Self::DuplicateNode { .. } => {
                "the program that wrote the mesh made an error; repair the mesh there and export it again"
            }
            Self::Unsupported { instead, .. } => instead,
            Self::Inconsistent { .. } => "the file contradicts itself; export it again",
            Self::NoTets { .. } => {
                "a body needs a tetrahedral mesh: mesh the volume (`gmsh -3`), or give two surfaces to be filled"
            }
            Self::NoTriangles { .. } => "give a triangulated surface",
            Self::Inverted { .. } | Self::InvertedSolids { .. } => "repair or optimise the mesh where it was made (`gmsh -optimize`)",
            Self::Scale { .. } => "give the length of one file unit in metres, 0.001 for millimetres",
            Self::Mesh(_) => {
                "repair the mesh where it was made; tets and nodes are counted from 0, in the file's order"
            }
        }
        .to_string()
    }
}

/// As written by people: in full while that is short.
fn number(x: f64) -> String {
    let full = x.to_string();
    if full.len() <= 24 { full } else { format!("{x:e}") }
}
