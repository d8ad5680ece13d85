//! Sound files as other programs write them: each gives the mesh of the ordinary spelling, and tells what is left out.
#![allow(clippy::unwrap_used)] // a helper that cannot write its files has failed
use palpate_scene::files::{SurfaceFile, UnusedNodes, VolumeFile, parse_surface, parse_volume, read_volume};
use std::fmt::Write;
use std::fs;
use std::path::Path;

fn volume(name: &str, data: impl AsRef<[u8]>) -> VolumeFile {
    parse_volume(Path::new(name), data.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn surface(name: &str, data: impl AsRef<[u8]>) -> SurfaceFile {
    parse_surface(Path::new(name), data.as_ref()).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(name: &str, data: impl AsRef<[u8]>) -> String {
    let data = data.as_ref();
    let surface = [".stl", ".obj", ".ply"].iter().any(|extension| name.ends_with(extension));
    let error = if surface {
        parse_surface(Path::new(name), data).map(drop).unwrap_err()
    } else {
        parse_volume(Path::new(name), data).map(drop).unwrap_err()
    };
    error.to_string()
}

/// The same but for what is told.
fn quiet(file: VolumeFile) -> VolumeFile {
    VolumeFile { warnings: vec![], notes: vec![], ..file }
}

fn quiet_surface(file: SurfaceFile) -> SurfaceFile {
    SurfaceFile { warnings: vec![], notes: vec![], ..file }
}

const STL: &str = "solid two triangles\n facet normal 0 0 1\n  outer loop\n   vertex 0 0 0\n   vertex 1.5e+0 0 0\n   \
                   vertex 0 1 0\n  endloop\n endfacet\n facet normal 0 0 1\n  outer loop\n   vertex 1.5e+0 0 0\n   \
                   vertex 1 1 0\n   vertex 0 1 0\n  endloop\n endfacet\nendsolid two triangles\n";
const OBJ: &str = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 \\\n0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";
const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                   property float quality\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n\
                   0 0 0 1\n1 0 0 1\n1 1 0 1\n0 1 0 1\n3 0 1 2\n3 0 2 3\n";
const MSH22: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 7 \"a muscle\"\n$EndPhysicalNames\n\
                     $Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n$Elements\n1\n\
                     1 4 2 7 1 1 2 3 4\n$EndElements\n";
const MSH41: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n\
                     0 0 0\n1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";
const MSH1: &str = "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$ENDNOD\n$ELM\n1\n1 4 7 1 4 1 2 3 4\n$ENDELM\n";
const VTK51: &str = "# vtk DataFile Version 5.1\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n\
                     0 0 0 1 0 0 0 1 0 0 0 1\nMETADATA\nINFORMATION 0\n\nCELLS 2 4\nOFFSETS vtktypeint64\n0 4\n\
                     CONNECTIVITY vtktypeint64\n0 1 2 3\nCELL_TYPES 1\n10\n";
const VTU: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\">\n<UnstructuredGrid>\n\
                   <Piece NumberOfPoints=\"4\" NumberOfCells=\"1\">\n<Points>\n\
                   <DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">\n\
                   0 0 0 1 0 0\n0 1 0 0 0 1\n</DataArray>\n</Points>\n<Cells>\n\
                   <DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">\n0 1 2 3\n</DataArray>\n\
                   <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">\n4\n</DataArray>\n\
                   <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">\n10\n</DataArray>\n</Cells>\n</Piece>\n\
                   </UnstructuredGrid>\n</VTKFile>\n";

const MESH: &str = "MeshVersionFormatted 2\nDimension\n3\n# by hand\nVertices\n4\n0 0 0 1\n1 0 0 2\n0 1 0 3\n0 0 1 0\n\
                    Tetrahedra\n1 # one\n1 2 3 4 7\nTriangles\n2\n1 3 2 3\n2 3 4 0\nEnd\n";

const VOLUMES: [(&str, &str); 6] =
    [("a.msh", MSH22), ("b.msh", MSH41), ("c.msh", MSH1), ("d.vtk", VTK51), ("e.vtu", VTU), ("f.mesh", MESH)];
const SURFACES: [(&str, &str); 3] = [("a.stl", STL), ("b.obj", OBJ), ("c.ply", PLY)];
const NODE: &str = "# by hand\n4 3 0 1\n1 0 0 0 5\n2 1 0 0 0\n3 0 1 0 5\n4 0 0 1 0\n";
const ELE: &str = "1 4 1\n1 1 2 3 4 7\n";
const FACE: &str = "2 1\n1 1 3 2 3\n2 2 3 4 0\n";

fn tetgen(files: &[(&str, &str)]) -> VolumeFile {
    let folder = tempfile::tempdir().unwrap();
    for (extension, text) in files {
        fs::write(folder.path().join("mesh").with_extension(extension), text).unwrap();
    }
    let file = read_volume(&folder.path().join("mesh.node")).unwrap_or_else(|error| panic!("{error}"));
    VolumeFile { path: "mesh.node".into(), ..file }
}

/// Every text format, spelt otherwise by `change`, is the same mesh, of which nothing else is told.
fn same_in_every_text(change: impl Fn(&str) -> String) {
    for (name, text) in VOLUMES {
        assert_eq!(volume(name, change(text)), volume(name, text), "{name}");
    }
    for (name, text) in SURFACES {
        assert_eq!(surface(name, change(text)), surface(name, text), "{name}");
    }
    let [node, ele, face] = [NODE, ELE, FACE].map(&change);
    let changed = tetgen(&[("node", &node), ("ele", &ele), ("face", &face)]);
    assert_eq!(changed, tetgen(&[("node", NODE), ("ele", ELE), ("face", FACE)]));
}

/// Upper-case ASCII STL was taken for a binary file with billions of triangles.
#[test]
fn stl_in_upper_case() {
    assert_eq!(surface("a.stl", STL.to_uppercase()), surface("a.stl", STL));
    // The content tells without an extension, and a cut is told by its line.
    assert_eq!(surface("a", STL.to_uppercase()), surface("a", STL));
    let cut = STL.to_uppercase().replace("ENDSOLID TWO TRIANGLES\n", "");
    assert!(refused("a.stl", cut).contains("a.stl, line 16: the file ends where `endsolid` was expected"));
}

/// A file with the line ends of the old Mac was one long line: an OBJ a comment, an STL a name.
#[test]
fn line_ends_of_cr_alone_and_mixed() {
    same_in_every_text(|text| text.replace('\n', "\r"));
    same_in_every_text(|text| {
        let ends = ["\r\n", "\n", "\r"];
        text.lines().zip(ends.iter().cycle()).flat_map(|(line, end)| [line, end]).collect()
    });
    // Lines are counted alike.
    let wrong = OBJ.replace("f 1 3 4", "f 1 3 9");
    for end in ["\n", "\r", "\r\n"] {
        let message = refused("b.obj", wrong.replace('\n', end));
        assert!(message.contains("line 8: a face refers to node 9"), "{end:?}: {message}");
    }
}

/// Behind a header of lines that end in CR, binary data that begin with a line feed lost it.
#[test]
fn ply_header_of_cr_lines_before_binary_data() {
    let head = PLY.split("0 0 0 1\n").next().unwrap().replace("ascii", "binary_little_endian");
    let mut data = Vec::new();
    // The first byte of the first coordinate is a line feed.
    let first = f32::from_le_bytes([b'\n', 0, 0, 0]);
    for [x, y] in [[first, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        data.extend([x, y, 0.0, 1.0].into_iter().flat_map(f32::to_le_bytes));
    }
    for face in [[0, 1, 2], [0, 2, 3]] {
        data.push(3);
        data.extend(face.into_iter().flat_map(i32::to_le_bytes));
    }
    let with = |end: &str| [head.replace('\n', end).as_bytes(), &data].concat();
    let ordinary = surface("a.ply", with("\n"));
    assert_eq!(surface("a.ply", with("\r")), ordinary);
    assert_eq!(surface("a.ply", with("\r\n")), ordinary);
}

fn binary_stl(header: &[u8], count: u32) -> Vec<u8> {
    let mut data = header.to_vec();
    data.resize(80, b' ');
    data.extend(count.to_le_bytes());
    let (a, b, c, d) = ([0.0, 0.0, 0.0], [1.5, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]);
    for corners in [[a, b, c], [b, d, c]] {
        let numbers = [0.0, 0.0, 1.0].into_iter().chain(corners.into_iter().flatten());
        data.extend(numbers.flat_map(f32::to_le_bytes));
        data.extend([0, 0]);
    }
    data
}

/// A binary STL that begins with `solid` and has bytes behind its last triangle was read as text, and refused.
#[test]
fn binary_stl_that_begins_with_solid_and_has_a_trail() {
    for header in [&b"solid x"[..], b"SOLID x", b"solid x\nfacet normal 0 0 1\n", b"made by hand"] {
        let whole = binary_stl(header, 2);
        assert_eq!(surface("a.stl", &whole), surface("a.stl", STL));
        let trailed = surface("a.stl", [&whole[..], b"\n"].concat());
        assert_eq!(trailed.warnings, ["a byte behind the last triangle is not read"]);
        assert_eq!(quiet_surface(trailed), surface("a.stl", STL));
    }
    // Cut, it is refused as what it is.
    let cut = refused("a.stl", &binary_stl(b"solid x", 2)[..150]);
    assert!(cut.contains("a.stl, byte 80: announces 2 triangles of 50 bytes, but 66 bytes are left"), "{cut}");
    // A text stays a text, also one whose name is long or beyond ASCII.
    let named = STL.replace("two triangles", &"zwei Würfel, ".repeat(9));
    assert_eq!(surface("a.stl", named), surface("a.stl", STL));
}

/// A byte order mark before the text was no keyword of any format.
#[test]
fn byte_order_mark() {
    same_in_every_text(|text| format!("\u{feff}{text}"));
    // The content goes before the extension as ever.
    assert_eq!(quiet(volume("a.obj", format!("\u{feff}{VTK51}"))).tets, volume("a.obj", VTK51).tets);
}

/// VTK 9.7 writes `signed_char`, which was no type.
#[test]
fn every_number_type_that_vtk_writes() {
    let types = [
        "bit",
        "char",
        "signed_char",
        "unsigned_char",
        "short",
        "unsigned_short",
        "int",
        "unsigned_int",
        "long",
        "unsigned_long",
        "vtktypeint64",
        "vtktypeuint64",
        "vtkIdType",
        "float",
        "double",
    ];
    let mut text = format!("{VTK51}\nCELL_DATA 1\nFIELD FieldData {}\n", types.len() + 1);
    for name in types {
        write!(text, "of_{name} 1 1 {name}\n1 \n").unwrap();
    }
    text += "material 1 1 signed_char\n6 \n";
    let ordinary = volume("a.vtk", format!("{VTK51}\nCELL_DATA 1\nSCALARS material int\nLOOKUP_TABLE default\n6\n"));
    let file = volume("a.vtk", text);
    assert_eq!(file.warnings, ["arrays that nothing uses are left out: `of_bit` (of type bit)"]);
    assert_eq!(quiet(file), ordinary);
}

/// An array of strings, which nobody uses, refused the file.
#[test]
fn arrays_of_strings_and_variants() {
    let head = VTK51.split("POINTS").next().unwrap();
    let field = "FIELD FieldData 3\nwho%20am%20I 2 3 string\na%20b\n\n100%25\n%0A\n\n\n\
                 vari 1 3 variant\n11 3.5\n13 a%20b\n0 \nmaterial 1 1 string\nmuscle\n\n";
    let told = "arrays that nothing uses are left out: `material` (of type string), `vari` (of type variant), \
                `who am I` (of type string)";
    let file = volume("a.vtk", VTK51.replace(head, &format!("{head}{field}")));
    assert_eq!(file.warnings, [told]);
    assert_eq!(quiet(file), volume("a.vtk", VTK51));
    // Of cells, even by a name that tells groups.
    let file = volume("a.vtk", format!("{VTK51}CELL_DATA 1\nFIELD FieldData 1\nmaterial 1 1 string\nmuscle\n"));
    assert_eq!(quiet(file), volume("a.vtk", VTK51));
    let short = refused("a.vtk", format!("{VTK51}CELL_DATA 1\nFIELD f 1\nwho 1 2 string\na\nSCALARS material int\n"));
    assert!(short.contains("line 21: expected a line of text in an array, found `SCALARS material int`"), "{short}");
    let cut = refused("a.vtk", format!("{head}FIELD FieldData 1\nwho 1 3 string\na\nb\n"));
    assert!(cut.contains("line 9: the file ends where a line of text was expected"), "{cut}");
}

/// In binary files strings have their length before them, in one byte or more, and bits are packed.
#[test]
fn binary_strings_bits_and_variants() {
    let points: Vec<u8> =
        [0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1].into_iter().flat_map(|x| (x as f32).to_be_bytes()).collect();
    let cell: Vec<u8> = [4, 0, 1, 2, 3].into_iter().flat_map(i32::to_be_bytes).collect();
    let grid = |field: &[u8]| {
        let head: &[u8] = b"# vtk DataFile Version 4.2\nby hand\nBINARY\nDATASET UNSTRUCTURED_GRID\n";
        let parts: [&[u8]; 8] =
            [head, field, b"POINTS 4 float\n", &points, b"\nCELLS 1 5\n", &cell, b"\nCELL_TYPES 1\n", &[0, 0, 0, 10]];
        parts.concat()
    };
    let long = [&[0x80, 70][..], &[b'x'; 70]].concat();
    let longer = [&[0x40, 0, 0, 2][..], b"\n\n", &[0, 0, 0, 0, 0, 0, 0, 1], b"y"].concat();
    let fields: [&[u8]; 6] = [
        b"FIELD FieldData 3\nwho 1 5 string\n\xc3a b\xc0",
        &long,
        &longer,
        b"\nbits 1 9 bit\n\x55\x00\nvari 1 2 variant\n",
        b"11 3.5\n0 \n",
        b"\n",
    ];
    let file = volume("a.vtk", grid(&fields.concat()));
    let told = "`bits` (of type bit), `vari` (of type variant), `who` (of type string)";
    assert_eq!(file.warnings, [format!("arrays that nothing uses are left out: {told}")]);
    assert_eq!(quiet(file), volume("a.vtk", grid(b"")));
    let endless = refused("a.vtk", grid(b"FIELD FieldData 1\nwho 1 1 string\n\x3f\xff\xff\xff\xff\xff\xff\xff"));
    assert!(endless.contains("the file ends where a string was expected"), "{endless}");
}

/// Windows' word for NaN, in an array that nobody uses, refused the file.
#[test]
fn words_for_what_is_not_finite() {
    let ordinary = volume("a.vtk", VTK51);
    let array =
        |values: &str| format!("{VTK51}CELL_DATA 1\nFIELD FieldData 1\nvon%20Mises%20stress 5 1 double\n{values}\n");
    let file = volume("a.vtk", array("0.5 -nan(ind) 1.#QNAN nan 0,5"));
    assert_eq!(file.warnings, ["arrays that nothing uses are left out: `von Mises stress` (has `-nan(ind)`, line 20)"]);
    assert_eq!(quiet(file), ordinary);
    assert_eq!(volume("a.vtk", array("nan -nan inf -Inf NaN")), ordinary);
    // An array by a name that tells groups tells none then.
    let material = format!("{VTK51}CELL_DATA 1\nSCALARS material double\nLOOKUP_TABLE default\n-1.#IND\n");
    assert_eq!(quiet(volume("a.vtk", material)), ordinary);
    let material = "<DataArray type=\"Float64\" Name=\"material\" format=\"ascii\">1.#QNAN</DataArray>";
    let file = volume("a.vtu", VTU.replace("</Piece>", &format!("<CellData>{material}</CellData></Piece>")));
    assert_eq!(file.warnings.len(), 1);
    assert_eq!(quiet(file), volume("a.vtu", VTU));
    let quality = surface("a.ply", PLY.replace("1 1 0 1\n", "1 1 0 1.#INF\n"));
    assert_eq!(quality.warnings, ["arrays that nothing uses are left out: `quality` (has `1.#INF`, line 13)"]);
    assert_eq!(quiet_surface(quality), surface("a.ply", PLY));
    // Too few values are told before what follows is taken for values; coordinates have to be numbers.
    let short = refused("a.vtk", format!("{VTK51}CELL_DATA 1\nVECTORS v double\n0 0\nSCALARS material int\n"));
    assert!(short.contains("line 20: expected a value of an array, found `SCALARS`"), "{short}");
    let coordinate = refused("a.vtk", VTK51.replace("1 0 0 0 1 0", "1 0 0 0 -nan(ind) 0"));
    assert!(coordinate.contains("line 6: expected a coordinate, found `-nan(ind)`"), "{coordinate}");
}

/// Gmsh writes `$ParametricNodes` in the place of `$Nodes`; its nodes were passed over, and then did not exist.
#[test]
fn msh_22_with_parametric_nodes() {
    let nodes =
        "$ParametricNodes\n4\n1 0 0 0 0 1\n2 1 0 0 1 3 0.25\n3 0 1 0 2 1 0.5 -1e-3\n4 0 0 1 3 1\n$EndParametricNodes";
    let from = MSH22.find("$Nodes").unwrap();
    let to = MSH22.find("$EndNodes").unwrap() + "$EndNodes".len();
    let text = MSH22.replace(&MSH22[from..to], nodes);
    assert_eq!(volume("a.msh", &text), volume("a.msh", MSH22));
    let wrong = refused("a.msh", text.replace("4 0 0 1 3 1", "4 0 0 1 4 1"));
    assert!(wrong.contains("line 13: expected the dimension of a node's entity, 0 to 3, found `4`"), "{wrong}");
}

/// The same in binary, where parameters are double and the rest is four bytes.
#[test]
fn binary_msh_22_with_parametric_nodes() {
    let head = b"$MeshFormat\n2.2 1 8\n\x01\0\0\0\n$EndMeshFormat\n";
    let int = |values: &[i32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let real = |values: &[f64]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
    let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let of_entity = [(0, 1, vec![]), (1, 3, vec![0.25]), (2, 1, vec![0.5, -1e-3]), (3, 1, vec![])];
    let elements =
        [b"\n$Elements\n1\n".to_vec(), int(&[4, 1, 2, 1, 7, 1, 1, 2, 3, 4]), b"\n$EndElements\n".to_vec()].concat();
    let file = |section: &str, parametric: bool| {
        let mut data = [head, format!("${section}\n4\n").as_bytes()].concat();
        for ((tag, position), (dimension, entity, parameters)) in (1..).zip(&positions).zip(&of_entity) {
            data.extend([int(&[tag]), real(position)].concat());
            if parametric {
                data.extend([int(&[*dimension, *entity]), real(parameters)].concat());
            }
        }
        data.extend(format!("\n$End{section}").as_bytes());
        volume("a.msh", [data, elements.clone()].concat())
    };
    assert_eq!(file("ParametricNodes", true), file("Nodes", false));
}

/// One face of two corners among thousands refused the surface.
#[test]
fn faces_of_fewer_than_three_corners() {
    let told = ["not used: 1 face of fewer than three corners"];
    let ply = surface("a.ply", PLY.replace("face 2", "face 3").replace("3 0 1 2\n", "3 0 1 2\n2 1 2\n"));
    let obj = surface("a.obj", OBJ.replace("f 1 2 3\n", "f 1 2 3\nf 2 3\n"));
    let head =
        "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET POLYDATA\nPOINTS 4 float\n0 0 0 1 0 0 1 1 0 0 1 0\n";
    let vtk = surface("a.vtk", format!("{head}POLYGONS 3 11\n3 0 1 2\n2 1 2\n3 0 2 3\n"));
    for file in [ply, obj, vtk] {
        assert_eq!(file.warnings, told);
        assert_eq!(quiet_surface(file), surface("a.ply", PLY));
    }
    // At the end of a file such a face may have been cut.
    assert!(refused("a.obj", OBJ.trim_end().trim_end_matches(" 4")).contains("line 8: expected three or more corners"));
}

/// Faces of second order have six nodes: the fourth was taken for a marker, and dozens of groups were invented.
#[test]
fn tetgen_faces_of_second_order() {
    let between = "5 .5 0 0 0\n6 .5 .5 0 0\n7 0 .5 0 0\n8 0 0 .5 0\n9 .5 0 .5 0\n10 0 .5 .5 0\n";
    let node = NODE.replace("4 3 0 1", "10 3 0 1") + between;
    let ele = "1 10 1\n1 1 2 3 4 5 6 7 8 9 10 7\n";
    let read = |face: &str| tetgen(&[("node", &node), ("ele", ele), ("face", face)]);
    let ordinary = read(FACE);
    let file = read("2 1\n1 1 3 2 6 5 7 3\n2 2 3 4 10 9 6 0\n");
    assert!(file.warnings.iter().any(|w| w.starts_with("of 1 tetrahedron, 2 triangles the corner nodes are used")));
    // With the tets beside each face (-nn), and where only the tets are of second order.
    assert_eq!(quiet(read("2 1\n1 1 3 2 6 5 7 3 1 -1\n2 2 3 4 10 9 6 0 1 -1\n")), quiet(ordinary.clone()));
    assert_eq!(quiet(read("2 1\n1 1 3 2 3 1 -1\n2 2 3 4 0 1 -1\n")), quiet(ordinary.clone()));
    assert_eq!(file.groups.len(), 3);
    assert_eq!(quiet(file), quiet(ordinary));
}

/// MEDIT: references are groups, 0 is none; what says more of vertices is passed over, what is not known is told.
#[test]
fn medit() {
    let faces = ("face", "2 1\n1 1 3 2 3\n2 2 3 4 0\n");
    let ordinary = tetgen(&[("node", &NODE.replace("4 3 0 1", "4 3 0 0")), ("ele", ELE), faces]);
    let file = volume("mesh.node", MESH);
    assert_eq!(file, ordinary);
    let extras = "Corners\n2\n1\n2\nNormals 1\n0 0 nan(ind)\nEdges\n1\n1 2 9\nIsoCurves 1\n5 5\nEnd\n";
    let more = volume("mesh.node", MESH.replace("End\n", extras));
    assert_eq!(
        (&more.warnings[..], &more.notes[..]),
        (
            &["arrays that nothing uses are left out: `IsoCurves` (a section that is not read)".to_string()][..],
            &["1 line of the geometry was left out".to_string()][..]
        )
    );
    assert_eq!(VolumeFile { of_geometry: vec![], ..quiet(more) }, ordinary);
    let told = |from: &str, to: &str| refused("a.mesh", MESH.replace(from, to));
    assert!(
        told("End\n", "")
            .contains("a.mesh, line 18: the file ends where a section such as Vertices, or End was expected")
    );
    assert!(told("2 3 4 0", "2 3 5 0").contains("line 17: element 2 of the triangles refers to node 5"));
    assert!(told("1 0 0 2", "1 0 inf 2").contains("line 8: node 2 has a coordinate that is not finite"));
    assert!(told("Vertices\n4", "Vertices\n99").contains("line 6: announces 99 vertices"));
    assert!(told("n\n3", "n\n2").contains("line 3: expected the dimension 3, found `2`"));
}

/// Lines and points of the geometry, which Gmsh writes by itself, are no loss to a body: they are noted, not warned of.
#[test]
fn lines_and_points_of_the_geometry_are_noted() {
    let text = MSH22
        .replace("$Nodes\n4\n", "$Nodes\n5\n5 .5 .5 .5\n")
        .replace("$Elements\n1\n", "$Elements\n3\n8 15 2 0 1 5\n9 1 2 0 1 1 2\n");
    let file = volume("a.msh", text).into_tet_mesh(1.0, UnusedNodes::Drop).unwrap();
    let ordinary = volume("a.msh", MSH22).into_tet_mesh(1.0, UnusedNodes::Drop).unwrap();
    assert_eq!(file.warnings, Vec::<String>::new());
    let centre = "1 node of the geometry that belongs to no tetrahedron is left out";
    assert_eq!(file.notes, ["1 line and 1 point of the geometry were left out", centre]);
    assert_eq!((file.mesh, file.tet_group), (ordinary.mesh, ordinary.tet_group));
}

/// A line among the cells refused a VTK file, for it has no more nodes than its two ends.
#[test]
fn lines_among_the_cells_of_vtk() {
    let ordinary = volume("a.vtk", VTK51);
    let text = VTK51
        .replace("CELLS 2 4", "CELLS 3 6")
        .replace("vtktypeint64\n0 4\n", "vtktypeint64\n0 4 6\n")
        .replace("0 1 2 3\nCELL_TYPES 1\n10\n", "0 1 2 3 0 1\nCELL_TYPES 2\n10 3\n");
    let file = volume("a.vtk", text);
    assert_eq!(
        (file.warnings.len(), file.notes.as_slice()),
        (0, &["1 line of the geometry was left out".to_string()][..])
    );
    assert_eq!(VolumeFile { of_geometry: vec![], ..quiet(file) }, ordinary);
}
