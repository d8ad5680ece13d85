//! Mesh and surface files: readers of the common formats, writers for frames.
//!
//! A reader never trusts a count, an index or a coordinate: what is wrong is a [`FileError`] with its place, and no
//! file makes it set aside more memory than a small multiple of the file's size (of what zlib expands it to, where it
//! is compressed). Coordinates stay in the file's unit;
//! [`VolumeFile::into_tet_mesh`] scales them to metres. What each format keeps: `docs/formats.md`.
use glam::DVec3;
use std::path::{Path, PathBuf};

mod builder;
mod cursor;
mod error;
mod format;
mod medit;
mod msh;
mod obj;
mod ply;
mod solids;
mod split;
mod stl;
mod tet_mesh;
mod tetgen;
mod vtk;
mod write;
mod xdmf;

pub use error::{FileError, Place, Problem};
pub use tet_mesh::{GroupedMesh, Members, UnusedNodes};
pub use write::{Cells, Field, PvdIndex, Values, VtuFrame, encode_vtu, write_obj, write_ply, write_stl, write_vtu};

use builder::Builder;
use format::Format;

/// A named set of elements (Gmsh: a physical group).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Group {
    /// Its name; the tag in decimal where the file gives no name; empty for tets that belong to no group.
    pub name: String,
    /// 3 tets, 2 triangles, 0 nodes.
    pub dimension: u8,
    /// Its number in the file; groups of different dimensions may share it.
    pub tag: i64,
}

impl Group {
    /// What stands before its name or number where that alone means several groups.
    pub fn kind(&self) -> &'static str {
        match self.dimension {
            3 => "volume",
            2 => "surface",
            _ => "points",
        }
    }

    /// Whether a text means it: its name or its number, alone or behind its kind (`surface 3`).
    pub fn is_called(&self, text: &str) -> bool {
        let own = |text: &str| text == self.name || text == self.tag.to_string();
        own(text) || text.strip_prefix(self.kind()).and_then(|rest| rest.strip_prefix(' ')).is_some_and(own)
    }
}

/// A tetrahedral mesh as its file gives it, checked for finite coordinates and existing nodes only.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeFile {
    /// Where it was read from.
    pub path: PathBuf,
    /// Nodes in file order and in the file's unit, unscaled; unused ones included. Behind them the middles of solids
    /// that were split around one.
    pub mesh_nodes: Vec<DVec3>,
    /// Nodes of every tet, as indices into `mesh_nodes`, in the file's orientation.
    pub tets: Vec<[u32; 4]>,
    /// How many of the tets, the first, are the file's own; the others are what its hexahedra, prisms and pyramids were
    /// split into, and are upright.
    pub own_tets: usize,
    /// For every tet, its (first) group as an index into `groups`.
    pub tet_group: Vec<u32>,
    /// Tets of a further group: index into `groups`, tets. Empty unless groups overlap.
    pub more_tet_groups: Vec<(usize, Vec<u32>)>,
    /// Groups in order of appearance.
    pub groups: Vec<Group>,
    /// Triangles by group: index into `groups`, node indices.
    pub surface_groups: Vec<(usize, Vec<[u32; 3]>)>,
    /// Points by group: index into `groups`, node indices.
    pub node_groups: Vec<(usize, Vec<u32>)>,
    /// Nodes, ascending, of lines and ungrouped points of the geometry: no loss where no tet uses them.
    pub of_geometry: Vec<u32>,
    /// What was skipped or changed, for the user to read.
    pub warnings: Vec<String>,
    /// What was skipped without a loss, for the user to read.
    pub notes: Vec<String>,
}

/// A triangulated surface as its file gives it.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceFile {
    /// Vertices in the file's unit, unscaled; each is used by a triangle.
    pub vertices: Vec<DVec3>,
    /// Vertices of every triangle, in the file's orientation, all different.
    pub triangles: Vec<[u32; 3]>,
    /// What was skipped or changed, for the user to read.
    pub warnings: Vec<String>,
    /// What was skipped without a loss, for the user to read.
    pub notes: Vec<String>,
}

/// Reads a mesh of tetrahedra, hexahedra, prisms and pyramids: Gmsh MSH, VTK legacy, VTU, XDMF, TetGen or MEDIT. The
/// content decides, then the extension.
///
/// # Errors
/// A [`FileError`] with the place and what to do.
pub fn read_volume(path: &Path) -> Result<VolumeFile, FileError> {
    parse_volume(path, &format::load(path)?)
}

/// Reads a triangulated surface: STL, OBJ, PLY, VTK legacy, VTP, or the triangles of a volume's file.
///
/// # Errors
/// A [`FileError`] with the place and what to do.
pub fn read_surface(path: &Path) -> Result<SurfaceFile, FileError> {
    parse_surface(path, &format::load(path)?)
}

/// As [`read_volume`], from the content `data` of the file; `path` tells the extension and names the file in errors.
///
/// # Errors
/// A [`FileError`] with the place and what to do.
pub fn parse_volume(path: &Path, data: &[u8]) -> Result<VolumeFile, FileError> {
    parse(path, data)?.into_volume(path)
}

/// As [`read_surface`], from the content `data` of the file; `path` tells the extension and names the file in errors.
///
/// # Errors
/// A [`FileError`] with the place and what to do.
pub fn parse_surface(path: &Path, data: &[u8]) -> Result<SurfaceFile, FileError> {
    parse(path, data)?.into_surface(path)
}

fn parse(path: &Path, data: &[u8]) -> Result<Builder, FileError> {
    if data.is_empty() {
        return Err(FileError::new(path, Place::File, Problem::Empty));
    }
    let data = format::unmarked(data);
    match format::recognise(path, data)? {
        Format::Msh => msh::read(path, data),
        Format::VtkLegacy => vtk::legacy::read(path, data),
        Format::VtkXml => vtk::xml::read(path, data),
        Format::Xdmf => xdmf::read(path, data),
        // TetGen spreads a mesh over files with one stem.
        Format::TetGen => tetgen::read(path),
        Format::Medit => medit::read(path, data),
        Format::Stl => stl::read(path, data),
        Format::Obj => obj::read(path, data),
        Format::Ply => ply::read(path, data),
    }
}
