//! Details of the formats, on files small enough to be read by eye.
#![allow(clippy::unwrap_used)] // a helper that cannot write its files has failed
use glam::DVec3;
use palpate_scene::files::{SurfaceFile, VolumeFile, parse_surface, parse_volume, read_volume};
use std::fs;
use std::path::Path;

fn volume(name: &str, text: &str) -> VolumeFile {
    parse_volume(Path::new(name), text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn surface(name: &str, text: &str) -> SurfaceFile {
    parse_surface(Path::new(name), text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

const CORNERS: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];

fn tetgen(files: &[(&str, &str)]) -> VolumeFile {
    let folder = tempfile::tempdir().unwrap();
    for (extension, text) in files {
        fs::write(folder.path().join("mesh").with_extension(extension), text).unwrap();
    }
    read_volume(&folder.path().join("mesh.node")).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn tetgen_counts_from_zero_or_one() {
    let from_zero = tetgen(&[
        ("node", "# made by hand\n4 3 0 0\n\n0 0 0 0 # the first\n1 1 0 0\n2 0 1 0\n3 0 0 1\n"),
        ("ele", "1 4 0\n0 0 1 2 3\n"),
    ]);
    let from_one = tetgen(&[("node", "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"), ("ele", "1 4 0\n1 1 2 3 4\n")]);
    for file in [from_zero, from_one] {
        assert_eq!((file.mesh_nodes.as_slice(), file.tets.as_slice()), (&CORNERS[..], &[[0, 1, 2, 3]][..]));
    }
}

/// Attributes before the marker of a node; ten nodes a tet; regions; faces with markers.
#[test]
fn tetgen_attributes_markers_and_faces() {
    let between = "5 .5 0 0 9 0\n6 .5 .5 0 9 0\n7 0 .5 0 9 0\n8 0 0 .5 9 0\n9 .5 0 .5 9 0\n10 0 .5 .5 9 0\n";
    let node = format!("10 3 1 1\n1 0 0 0 9 5\n2 1 0 0 9 0\n3 0 1 0 9 5\n4 0 0 1 9 -2\n{between}");
    let file = tetgen(&[
        ("node", &node),
        ("ele", "1 10 1\n1 1 2 3 4 5 6 7 8 9 10 7\n"),
        ("face", "2 1\n1 1 2 3 3\n2 2 3 4 0\n"),
    ]);
    assert_eq!(file.tets, [[0, 1, 2, 3]]);
    let tag = |group: usize| (file.groups[group].dimension, file.groups[group].tag);
    assert_eq!(tag(file.tet_group[0] as usize), (3, 7));
    let points: Vec<_> = file.node_groups.iter().map(|(group, nodes)| (tag(*group), nodes.clone())).collect();
    assert_eq!(points, [((0, 5), vec![0, 2]), ((0, -2), vec![3])]);
    let faces: Vec<_> = file.surface_groups.iter().map(|(group, faces)| (tag(*group), faces.clone())).collect();
    assert_eq!(faces, [((2, 3), vec![[0, 1, 2]])]);
    assert!(file.warnings.iter().any(|w| w.contains("corner nodes")), "{:?}", file.warnings);
}

#[test]
fn obj_polygons_negative_numbers_and_continued_lines() {
    let text = "# a square and a triangle\nmtllib a.mtl\no square\nv 0 0 0 1.0\nv 1 0 0\nv 1 1 \\\n0\nv 0 1 0\nvt 0 0\n\
                vn 0 0 1\nf 1/1/1 2//1 3 4/1\nv 0 0 1 # a peak\nf -1 -5 -4\n";
    let file = surface("a.obj", text);
    assert_eq!(file.vertices, [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y, DVec3::Z]);
    assert_eq!(file.triangles, [[0, 1, 2], [0, 2, 3], [4, 0, 1]]);
    assert!(file.warnings.iter().any(|w| w.starts_with("1 polygons are cut")), "{:?}", file.warnings);
    let error = |text: &str| parse_surface(Path::new("b.obj"), text.as_bytes()).unwrap_err().to_string();
    assert!(error("v 0 0 0\nv 1 0 0\nf 1 2 3\n").contains("b.obj, line 3: a face refers to node 3"));
    assert!(error("v 0 0\n").contains("line 1: expected three coordinates"));
}

#[test]
fn ply_passes_over_what_is_no_part_of_a_surface() {
    let text = "ply\r\nformat ascii 1.0\r\ncomment by hand\r\nelement vertex 4\r\nproperty uchar red\r\nproperty float x\r\n\
                property float y\r\nproperty float z\r\nelement edge 1\r\nproperty int a\r\nproperty int b\r\nelement face 1\r\n\
                property list uchar float weights\r\nproperty list uchar int vertex_index\r\nend_header\r\n\
                9 0 0 0\r\n9 1 0 0\r\n9 0 1 0\r\n9 0 0 1\r\n0 1\r\n2 .5 .5 3 0 1 3\r\n";
    let file = surface("a.ply", text);
    assert_eq!(file.vertices, [DVec3::ZERO, DVec3::X, DVec3::Z]);
    assert_eq!(file.triangles, [[0, 1, 2]]);
    assert!(file.warnings.iter().any(|w| w.contains("1 point that belongs to no triangle")), "{:?}", file.warnings);
}

#[test]
fn stl_joins_points_and_drops_collapsed_triangles() {
    let facet = |points: &str| format!("facet normal 0 0 1\n outer loop\n{points} endloop\nendfacet\n");
    let one = facet("vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n");
    let two = facet("vertex 1 0 0\nvertex 1 1 0\nvertex -0 1 0\n");
    let thin = facet("vertex 1 0 0\nvertex 1 0 0\nvertex 0 1 0\n");
    let file = surface("a.stl", &format!("solid two words\n{one}{two}{thin}endsolid two words\n"));
    assert_eq!((file.vertices.len(), file.triangles.as_slice()), (4, &[[0, 1, 2], [1, 3, 2]][..]));
    assert!(file.warnings.iter().any(|w| w.starts_with("1 triangle that uses a vertex twice")), "{:?}", file.warnings);
}

const LEGACY: &str = "# vtk DataFile Version 2.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
                      0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 2 9\n3 0 1 2\n4 0 1 2 3\nCELL_TYPES 2\n5 10\n";

/// Every kind of attribute stands before the one that tells the groups.
#[test]
fn legacy_attributes_are_passed_over() {
    let attributes = "POINT_DATA 4\nVECTORS v float\n0 0 0 0 0 0 0 0 0 nan 0 0\nTEXTURE_COORDINATES t 2 float\n0 0 0 0 0 0 0 0\n\
                      SCALARS s double 2\nLOOKUP_TABLE own\n0 0 0 0 0 0 0 0\nLOOKUP_TABLE own 2\n0 0 0 1 1 1 1 1\n\
                      CELL_DATA 2\nTENSORS t float\n1 0 0 0 1 0 0 0 1\n1 0 0 0 1 0 0 0 1\nCOLOR_SCALARS c 1\n0.5 0.5\n\
                      METADATA\nINFORMATION 0\n\nFIELD f 2\npressure 1 2 double\n0.5 0.25\nRegion_Id 1 2 int\n4 6\n";
    let file = volume("a.vtk", &format!("{LEGACY}{attributes}"));
    assert_eq!((file.mesh_nodes.as_slice(), file.tets.as_slice()), (&CORNERS[..], &[[0, 1, 2, 3]][..]));
    assert_eq!(file.groups[file.tet_group[0] as usize].tag, 6);
    let (group, triangles) = &file.surface_groups[0];
    assert_eq!((file.groups[*group].tag, triangles.as_slice()), (4, &[[0, 1, 2]][..]));
    // A group of cells whose values are not whole is none.
    let file = volume("b.vtk", &format!("{LEGACY}CELL_DATA 2\nSCALARS material float\nLOOKUP_TABLE default\n0.5 2\n"));
    assert_eq!(file.groups[file.tet_group[0] as usize].name, "");
}

#[test]
fn legacy_strips_alternate() {
    let text = "# vtk DataFile Version 1.0\nby hand\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\n\
                LINES 1 3\n2 0 1\nTRIANGLE_STRIPS 1 5\n4 0 1 2 3\n";
    let file = surface("a.vtk", text);
    assert_eq!(file.triangles, [[0, 1, 2], [2, 1, 3]]);
    assert!(file.warnings.iter().any(|w| w.contains("1 line")), "{:?}", file.warnings);
}

#[test]
fn vtu_pieces_count_their_nodes_by_themselves() {
    let piece = |x: f64, region: i32| {
        format!(
            "<Piece NumberOfPoints='4' NumberOfCells='1'><PointData><DataArray type='Float32' Name='region' format='ascii'>\
             1 2 3 4</DataArray></PointData><CellData><DataArray type='Int32' Name='Region' format='ascii'>{region}</DataArray>\
             </CellData><Points><DataArray type='Float64' NumberOfComponents='3' format='ascii'>{x} 0 0 {} 0 0 {x} 1 0 {x} 0 1\
             <InformationKey name='k'>77</InformationKey></DataArray></Points><Cells><DataArray type='Int32' Name='connectivity' \
             format='ascii'>0 1 2 3</DataArray><DataArray type='Int32' Name='offsets' format='ascii'>4</DataArray>\
             <DataArray type='UInt8' Name='types' format='ascii'>10</DataArray></Cells></Piece>",
            x + 1.0
        )
    };
    let text = format!(
        "<VTKFile type='UnstructuredGrid' version='0.1'><UnstructuredGrid><FieldData><DataArray type='String' format='ascii'>\
         1 2 3</DataArray></FieldData>{}{}</UnstructuredGrid></VTKFile>",
        piece(0.0, 3),
        piece(5.0, 4)
    );
    let file = volume("a.vtu", &text);
    assert_eq!(file.tets, [[0, 1, 2, 3], [4, 5, 6, 7]]);
    assert_eq!(file.mesh_nodes[5], DVec3::new(6.0, 0.0, 0.0));
    let tags: Vec<i64> = file.tet_group.iter().map(|&group| file.groups[group as usize].tag).collect();
    assert_eq!(tags, [3, 4]);
}

/// Text that went through Windows is the same text.
#[test]
fn line_ends_do_not_matter() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files");
    for name in [
        "bar_v1.msh",
        "bar_v22_ascii.msh",
        "bar_v41_ascii.msh",
        "bar_vtk42_ascii.vtk",
        "bar_vtk51_ascii.vtk",
        "bar_vtk_inline.vtu",
    ] {
        let text = fs::read_to_string(folder.join(name)).unwrap();
        assert_eq!(volume(name, &text.replace('\n', "\r\n")), volume(name, &text), "{name}");
    }
}

/// The content goes before the extension.
#[test]
fn a_wrong_extension_does_not_matter() {
    assert_eq!(volume("a.msh", LEGACY).tets, [[0, 1, 2, 3]]);
    assert_eq!(volume("a", LEGACY).tets, [[0, 1, 2, 3]]);
}

/// A group may have names beyond ASCII, and a negative tag turns elements, not groups.
#[test]
fn physical_names_and_negative_tags() {
    let file = volume(
        "a.msh",
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"linke Herzkammer ü\"\n$EndPhysicalNames\n$Nodes\n4\n\
         1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n1 4 2 -7 1 1 2 3 4\n$EndElements\n$NodeData\n1\n\"u\"\n$EndNodeData\n",
    );
    assert_eq!(file.groups[file.tet_group[0] as usize].name, "linke Herzkammer ü");
}
