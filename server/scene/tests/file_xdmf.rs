//! XDMF as meshio, FEniCS, dolfinx and ParaView lay it out, on files small enough to be read by eye.
#![allow(clippy::unwrap_used)] // a test that cannot write its files has failed
use glam::DVec3;
use palpate_scene::files::{UnusedNodes, VolumeFile, parse_surface, parse_volume, read_volume};
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Two tets on one face, as meshio writes them with `data_format="XML"`; regions 3 and 4.
const MESHIO: &str = r#"<Xdmf Version="3.0"><Domain><Grid Name="Grid">
<Geometry GeometryType="XYZ"><DataItem DataType="Float" Dimensions="5 3" Format="XML" Precision="8">
0.0000000000000000e+00 0 0
1 0 0
0 1 0
0 0 1
1 1 1
</DataItem></Geometry>
<Topology TopologyType="Tetrahedron" NumberOfElements="2" NodesPerElement="4"><DataItem DataType="Int" Dimensions="2 4" Format="XML" Precision="8">
0 1 2 3
1 2 3 4
</DataItem></Topology>
<Attribute Name="u" AttributeType="Vector" Center="Node"><DataItem DataType="Float" Dimensions="5 3" Format="XML" Precision="8">nan(ind)</DataItem></Attribute>
<Attribute Name="medit:ref" AttributeType="Scalar" Center="Cell"><DataItem DataType="Int" Dimensions="2" Format="XML" Precision="4">
3
4
</DataItem></Attribute>
</Grid></Domain></Xdmf>
"#;

fn volume(text: &str) -> VolumeFile {
    parse_volume(Path::new("a.xdmf"), text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

fn refused(text: &str) -> String {
    let error = parse_volume(Path::new("a.xdmf"), text.as_bytes()).unwrap_err();
    format!("{error}; {}", error.problem.help())
}

/// Tag of the (first) group of every tet.
fn tags(file: &VolumeFile) -> Vec<i64> {
    file.tet_group.iter().map(|&group| file.groups[group as usize].tag).collect()
}

#[test]
fn uniform_grid_in_the_xml() {
    let file = volume(MESHIO);
    assert_eq!(file.mesh_nodes, [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z, DVec3::ONE]);
    assert_eq!((file.tets.as_slice(), tags(&file)), (&[[0, 1, 2, 3], [1, 2, 3, 4]][..], vec![3, 4]));
    assert!(file.warnings.is_empty() && file.notes.is_empty(), "{:?} {:?}", file.warnings, file.notes);
    // The content decides; a byte order mark, other line ends, a declaration and comments do not matter.
    let head = "\u{feff}<?xml version=\"1.0\" ?>\n<!DOCTYPE Xdmf SYSTEM \"Xdmf.dtd\" []>\n<!-- by hand -->\n";
    assert_eq!(
        parse_volume(Path::new("a.xdmf"), format!("{head}{MESHIO}").replace('\n', "\r\n").as_bytes()).unwrap(),
        file
    );
    let other = parse_volume(Path::new("a.vtu"), MESHIO.as_bytes()).unwrap();
    assert_eq!(VolumeFile { path: "a.xdmf".into(), ..other }, file);
}

/// Version 3 renamed keys, ParaView writes these; defaults may be left out; one list of x, of y and of z.
#[test]
fn other_spellings_of_the_same_mesh() {
    let file = volume(MESHIO);
    for (from, to) in [
        ("TopologyType=", "Type="),
        ("GeometryType=", "Type="),
        ("NumberOfElements=", "Dimensions="),
        (" NumberOfElements=\"2\"", ""),
        ("DataType=", "NumberType="),
        (" Format=\"XML\"", ""),
        ("TopologyType=\"Tetrahedron\"", "TopologyType=\"TETRAHEDRON\""),
        (
            "<Grid Name=\"Grid\">",
            "<Grid Name=\"Grid\" GridType=\"Uniform\"><Time Value=\"0.5\"/><Information Name=\"i\"/>",
        ),
        ("GeometryType=\"XYZ\"", ""),
        ("AttributeType=\"Scalar\"", "AttributeType=\"None\""),
        ("medit:ref", "Region ID"),
        ("<DataItem DataType=\"Int\" Dimensions=\"2 4\"", "<DataItem DataType=\"UInt\" Dimensions=\"8\""),
    ] {
        assert!(MESHIO.contains(from), "{from}");
        assert_eq!(volume(&MESHIO.replace(from, to)), file, "{from}");
    }
    let axis = |values: &str| format!("<DataItem Dimensions=\"5\">{values}</DataItem>");
    let start = MESHIO.find("<Geometry").unwrap();
    let end = MESHIO.find("</Geometry>").unwrap();
    let by_axes = format!("<Geometry Type=\"X_Y_Z\">{}{}{}", axis("0 1 0 0 1"), axis("0 0 1 0 1"), axis("0 0 0 1 1"));
    assert_eq!(volume(&format!("{}{by_axes}{}", &MESHIO[..start], &MESHIO[end..])), file);
    let from_one = MESHIO
        .replace("TopologyType=\"Tet", "BaseOffset=\"1\" TopologyType=\"Tet")
        .replace("0 1 2 3\n1 2 3 4", "1 2 3 4\n2 3 4 5");
    assert_eq!(volume(&from_one), file);
}

/// Raw numbers in files beside: both byte orders, every precision, several arrays in one file.
#[test]
fn raw_files_beside() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.xdmf");
    let coordinates = [0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0., 1., 1., 1., 1.];
    let corners = [0, 1, 2, 3, 1, 2, 3, 4];
    let item = |kind: &str, dimensions: &str, more: &str| {
        format!(
            "<DataItem DataType=\"{kind}\" Dimensions=\"{dimensions}\" Format=\"Binary\" {more}>\n a.bin </DataItem>"
        )
    };
    let text = |geometry: &str, topology: &str| {
        let mut text = MESHIO.to_owned();
        for (element, item) in [("Geometry", geometry), ("Topology", topology)] {
            let start = text.find(&format!("<{element}")).unwrap();
            let start = start + text[start..].find("<DataItem").unwrap();
            let end = text.find(&format!("</{element}>")).unwrap();
            text.replace_range(start..end, item);
        }
        text
    };
    let read = |text: String, data: &[&[u8]]| {
        fs::write(&path, text).unwrap();
        fs::write(folder.path().join("a.bin"), data.concat()).unwrap();
        read_volume(&path)
    };
    let expected = volume(MESHIO);
    let same = |text: String, data: &[&[u8]]| {
        let file = read(text, data).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(VolumeFile { path: "a.xdmf".into(), ..file }, expected);
    };
    let f64s: Vec<u8> = coordinates.iter().flat_map(|x: &f64| x.to_le_bytes()).collect();
    let f32s: Vec<u8> = coordinates.iter().flat_map(|&x| (x as f32).to_be_bytes()).collect();
    let i64s: Vec<u8> = corners.iter().flat_map(|&n| i64::from(n).to_le_bytes()).collect();
    let u16s: Vec<u8> = corners.iter().flat_map(|&n| (n as u16).to_be_bytes()).collect();
    let bytes: Vec<u8> = corners.iter().map(|&n| n as u8).collect();
    let wide = item("Float", "5 3", "Precision=\"8\" Endian=\"Little\"");
    same(text(&wide, &item("Int", "2 4", "Precision=\"8\" Seek=\"120\" Endian=\"Little\"")), &[&f64s, &i64s]);
    // Without an Endian, numbers are in the order of the machine that reads.
    same(text(&item("Float", "5 3", "Precision=\"8\""), &item("UChar", "8", "Seek=\"120\"")), &[&f64s, &bytes]);
    let narrow = item("Float", "5 3", "Endian=\"Big\" Seek=\"3\"");
    same(text(&narrow, &item("UInt", "2 4", "Precision=\"2\" Endian=\"Big\" Seek=\"63\"")), &[b"abc", &f32s, &u16s]);

    let cells = item("Int", "2 4", "Precision=\"8\" Seek=\"120\"");
    let short = read(text(&wide, &cells), &[&f64s, &i64s[..60]]).unwrap_err().to_string();
    assert!(short.contains("`a.bin`, which has its numbers, has 180 bytes; 64 from byte 120 on are needed"), "{short}");
    let huge = item("Float", "999999999999 3", "Precision=\"8\"");
    assert!(read(text(&huge, &cells), &[&f64s, &i64s]).unwrap_err().to_string().contains("has 184 bytes; "));
    let endian = item("Float", "5 3", "Endian=\"Middle\"");
    let told = read(text(&endian, &cells), &[&f64s]).unwrap_err().to_string();
    assert!(told.contains("a.xdmf, line 2: expected Little, Big or Native as Endian, found `Middle`"), "{told}");
    let zlib = item("Float", "5 3", "Compression=\"Zlib\"");
    assert!(
        read(text(&zlib, &cells), &[&f64s]).unwrap_err().to_string().contains("data compressed by Zlib are not read")
    );
    let odd = item("Float", "5 3", "Precision=\"3\"");
    assert!(read(text(&odd, &cells), &[&f64s]).unwrap_err().to_string().contains("found `float of 3 bytes`"));
    same(text(&wide, &cells), &[&f64s, &i64s]);
    fs::remove_file(folder.path().join("a.bin")).unwrap();
    assert!(
        read_volume(&path)
            .unwrap_err()
            .to_string()
            .contains("line 2: the file `a.bin`, which has its numbers, cannot be read: No such")
    );
}

/// HDF5 is what most programs write unless told otherwise: the message says how to tell them.
#[test]
fn hdf5_names_the_way_out() {
    let told = refused(&MESHIO.replacen(
        "Format=\"XML\" Precision=\"8\">\n0.0000000000000000e+00",
        "Format=\"HDF\" Precision=\"8\">mesh.h5:/data0 ",
        1,
    ));
    assert!(told.contains("a.xdmf, line 2: its numbers are in the HDF5 file `mesh.h5`, which is not read"), "{told}");
    for way in ["`meshio ascii FILE.xdmf`", "XDMFFile.Encoding.ASCII", "`meshio convert FILE.xdmf FILE.vtu`"] {
        assert!(told.contains(way), "{told}");
    }
    // Of arrays that nothing uses it does not matter where they are.
    let unused =
        MESHIO.replace("Format=\"XML\" Precision=\"8\">nan(ind)", "Format=\"HDF\" Precision=\"8\">mesh.h5:/data2");
    assert_eq!(volume(&unused), volume(MESHIO));
}

/// Every type of a mixed topology, with XDMF's numbers; corners of second order, points, lines and polygons.
#[test]
fn mixed_topologies() {
    let nodes = "0 0 0  1 0 0  1 1 0  0 1 0  0 0 1  1 0 1  1 1 1  0 1 1  0.5 0.5 2  2 0 0  2 0 1";
    let mixed = |cells: &str, count: usize| {
        format!(
            "<Xdmf Version='2.0'><Domain><Grid><Geometry><DataItem Dimensions='11 3'>{nodes}</DataItem></Geometry>\
             <Topology Type='Mixed' Dimensions='{count}'><DataItem NumberType='Int' Dimensions='{}'>{cells}</DataItem></Topology>\
             </Grid></Domain></Xdmf>",
            cells.split_ascii_whitespace().count()
        )
    };
    // Hexahedron, pyramid on it, wedge beside it, tet; sides as triangle, quadrilateral and polygon; a point and a line.
    let cells =
        "9 0 1 2 3 4 5 6 7  7 4 5 6 7 8  8 1 9 2 5 10 6  6 6 5 10 8  4 0 3 7  5 0 1 5 4  3 5 0 1 2 3 0  1 1 8  2 2 0 1";
    let file = volume(&mixed(cells, 9)).into_tet_mesh(1.0, UnusedNodes::Refuse).unwrap();
    let volume_m3 = 1.0 + 1.0 / 3.0 + 0.5 + 1.0 / 6.0;
    assert!((file.mesh.total_volume_m3() - volume_m3).abs() < 1e-6, "{}", file.mesh.total_volume_m3());
    let split = "1 hexahedron, 1 prism and 1 pyramid were split into 11 tetrahedra; 1 line and 1 point of the geometry were left out";
    assert_eq!((file.notes.as_slice(), file.warnings.len()), (&[split.to_string()][..], 0));
    let skin = parse_surface(Path::new("a.xdmf"), mixed(cells, 9).as_bytes()).unwrap();
    assert_eq!(skin.triangles.len(), 1 + 2 + 2);
    // Tet_10, Hex_20, Wedge_15 and Pyramid_13: what stands behind the corners is not used.
    let behind = |count: usize| " 8".repeat(count);
    let quadratic = format!(
        "48 0 1 2 3 4 5 6 7{} 39 4 5 6 7 8{} 40 1 9 2 5 10 6{} 38 6 5 10 8{}",
        behind(12),
        behind(8),
        behind(9),
        behind(6)
    );
    let quadratic = volume(&mixed(&quadratic, 4)).into_tet_mesh(1.0, UnusedNodes::Refuse).unwrap();
    assert_eq!(quadratic.mesh, file.mesh);
    let told =
        "of 1 hexahedron, 1 prism, 1 pyramid, 1 tetrahedron the corner nodes are used, the nodes between them are not";
    assert_eq!(quadratic.warnings, [told]);
    for (cells, count, told) in [
        ("6 0 1 2", 1, "a mixed Topology ends within a cell"),
        ("6 0 1 2 4 16 1 3 0 1 2", 2, "cell 1 of a mixed Topology is of type 16, which is not read"),
        ("6 0 1 2 4 99 1 2", 2, "cell 1 of a mixed Topology is of type 99"),
        ("6 0 1 2 4", 2, "a Topology announces 2 cells and has 1"),
        ("6 0 1 2 77", 1, "cell 0 refers to node 77, which does not exist (there are 11, counting from 0)"),
        ("6 0 1 2 -1", 1, "cell 0 refers to node -1"),
        ("3 -5 0 1", 1, "cell 0 of a mixed Topology is of type 3, which is not read"),
    ] {
        let error = refused(&mixed(cells, count));
        assert!(error.contains(told), "{error}");
    }
}

/// A mesh, its cell tags and its facet tags, as dolfinx 0.7 writes them: grids over the first one's nodes.
#[test]
fn dolfinx_tags_are_groups() {
    let tagged = |name: &str, kind: &str, cells: &str, values: &str| {
        let count = values.split(' ').count();
        format!(
            "<Grid Name=\"{name}\" GridType=\"Uniform\">\n<xi:include xpointer=\"xpointer(/Xdmf/Domain/Grid/Geometry)\" />\n\
             <Topology TopologyType=\"{kind}\" NumberOfElements=\"{count}\"><DataItem Dimensions=\"{}\" NumberType=\"Int\" Format=\"XML\">{cells}\
             </DataItem></Topology>\n<Attribute Name=\"{name}\" AttributeType=\"Scalar\" Center=\"Cell\">\
             <DataItem Dimensions=\"{count} 1\" Format=\"XML\">{values}</DataItem></Attribute></Grid>\n",
            cells.split_ascii_whitespace().count()
        )
    };
    let mesh =
        MESHIO.replace("medit:ref", "rank").replace("<Xdmf ", "<Xdmf xmlns:xi=\"https://www.w3.org/2001/XInclude\" ");
    let grids = tagged("muscle", "Tetrahedron", "1 2 3 4", "7") + &tagged("held", "Triangle", "0 1 2 0 1 3", "5 6");
    let file = volume(&mesh.replace("</Domain>", &format!("{grids}</Domain>")));
    assert_eq!((file.tets.len(), file.mesh_nodes.len()), (2, 5));
    // The first tet has no tag.
    assert_eq!(tags(&file), [0, 7]);
    assert_eq!(file.groups[file.tet_group[0] as usize].name, "");
    let surface = |group: usize| (file.groups[file.surface_groups[group].0].tag, file.surface_groups[group].1.clone());
    assert_eq!([surface(0), surface(1)], [(5, vec![[0, 1, 2]]), (6, vec![[0, 1, 3]])]);
    assert!(file.warnings.is_empty(), "{:?}", file.warnings);
}

/// A series as dolfinx and meshio write it: the mesh, then a collection whose moments include it.
#[test]
fn of_a_time_series_the_first_moment_is_taken() {
    let pointers = [
        "xpointer(/Xdmf/Domain/Grid[@GridType='Uniform'][1]/*[self::Topology or self::Geometry])",
        "xpointer(//Grid[@Name=&quot;mesh&quot;]/*[self::Topology or self::Geometry])",
    ];
    let mesh = MESHIO.replace("<Grid Name=\"Grid\">", "<Grid Name=\"mesh\" GridType=\"Uniform\">");
    for pointer in pointers {
        let mut series = "<Grid Name=\"u\" GridType=\"Collection\" CollectionType=\"Temporal\">".to_string();
        for moment in 0..3 {
            write!(
                series,
                "<Grid Name=\"u\" GridType=\"Uniform\"><xi:include xpointer=\"{pointer}\" /><Time Value=\"{moment}\" />\
                 <Attribute Name=\"u\" AttributeType=\"Scalar\" Center=\"Node\"><DataItem Dimensions=\"5 1\" Format=\"HDF\">u.h5:/{moment}</DataItem>\
                 </Attribute></Grid>"
            )
            .unwrap();
        }
        let file = volume(&mesh.replace("</Domain>", &format!("{series}</Grid></Domain>")));
        assert_eq!(file.notes, ["of the 3 moments of the time series `u` the first is taken"]);
        assert_eq!(VolumeFile { notes: vec![], ..file }, volume(MESHIO));
    }
    // A series whose moments have meshes of their own.
    let grid = &MESHIO[MESHIO.find("<Grid").unwrap()..MESHIO.find("</Domain>").unwrap()];
    let moved = grid.replace("1 1 1\n", "9 9 9\n");
    let own =
        MESHIO.replace(grid, &format!("<Grid GridType='Collection' CollectionType='Temporal'>{grid}{moved}</Grid>"));
    assert_eq!(volume(&own).mesh_nodes, volume(MESHIO).mesh_nodes);
    // Side by side, all are taken: each with its nodes.
    let both =
        MESHIO.replace(grid, &format!("<Grid GridType='Collection' CollectionType='Spatial'>{grid}{moved}</Grid>"));
    let file = volume(&both);
    assert_eq!((file.mesh_nodes.len(), file.tets.len(), tags(&file)), (10, 4, vec![3, 4, 3, 4]));
    assert_eq!(volume(&both.replace("Collection", "Tree")).tets, file.tets);
}

/// A DataItem, a Geometry or a Topology may be that of another place.
#[test]
fn references() {
    let item = "<DataItem Reference=\"XML\">/Xdmf/Domain/DataItem[@Name='points']</DataItem>";
    let start = MESHIO.find("<DataItem").unwrap();
    let end = MESHIO.find("</Geometry>").unwrap();
    let points = MESHIO[start..end].replacen("<DataItem", "<DataItem Name=\"points\"", 1);
    let head = MESHIO[..start].replace("<Domain>", &format!("<Domain>{points}"));
    let text = format!("{head}{item}{}", &MESHIO[end..]);
    assert_eq!(volume(&text), volume(MESHIO));
    let inner = text.replace(item, "<DataItem Reference=\"/Xdmf/Domain/DataItem[1]\"/>");
    assert_eq!(volume(&inner), volume(MESHIO));
    let lost = refused(&text.replace("[@Name='points']", "[@Name='point']"));
    assert!(
        lost.contains("refers to `/Xdmf/Domain/DataItem[@Name=") && lost.contains("which is not in the file"),
        "{lost}"
    );
    let other = MESHIO.replace("<Geometry Geo", "<xi:include href=\"other.xdmf\"/><Geometry Geo");
    assert!(refused(&other).contains("line 2: a part of the mesh is to be included from another file, `other.xdmf`"));
    // A grid that includes itself.
    let endless = "<Xdmf><Domain><Grid GridType='Tree'><xi:include xpointer='xpointer(/Xdmf/Domain/Grid)'/></Grid></Domain></Xdmf>";
    assert!(refused(endless).contains("the grids include each other without end"));
    // Grids each of which includes the next twice: 2⁴⁰ in all.
    let mut doubling = "<Xdmf><Domain>".to_string();
    for next in 1..=40 {
        let include = format!("<xi:include xpointer=\"xpointer(//Grid[@Name='{next}'])\"/>");
        write!(doubling, "<Grid Name='{}' GridType='Tree'>{include}{include}</Grid>", next - 1).unwrap();
    }
    assert!(refused(&(doubling + "<Grid Name='40' GridType='Tree'/></Domain></Xdmf>")).contains("without end"));
}

#[test]
fn what_is_wrong_is_told_with_its_line() {
    for (from, to, told) in [
        ("1 1 1\n", "1 1 nan\n", "line 2: node 4 has a coordinate that is not finite: (1, 1, NaN)"),
        ("1 1 1\n", "1 1\n", "line 2: a DataItem announces 15 numbers and has 14"),
        ("1 1 1\n", "1 1 x\n", "line 2: expected a number in a DataItem, found `x`"),
        (
            "1 2 3 4\n",
            "1 2 3 5\n",
            "line 9: cell 1 refers to node 5, which does not exist (there are 5, counting from 0)",
        ),
        ("1 2 3 4\n", "1 2 3 4.5\n", "line 9: expected an integer in a DataItem, found `4.5`"),
        (
            "\"5 3\" Format=\"XML\" Precision=\"8\">\n0",
            "\"5 x\" Format=\"XML\">\n0",
            "line 2: expected the Dimensions of a DataItem",
        ),
        ("\"2 4\"", "\"18446744073709551615 4\"", "expected the Dimensions of a DataItem, whole numbers"),
        ("\"2 4\"", "\"2000000000 4\"", "line 9: announces 8000000000 numbers"),
        ("\"2 4\"", "\"8\"", ""),
        ("=\"Tetrahedron\"", "=\"3DSMesh\"", "line 9: a Topology of type `3DSMesh` is not read"),
        ("=\"Tetrahedron\"", "=\"Pyramid\"", "8 nodes are no whole number of cells of type `Pyramid`"),
        ("=\"XYZ\"", "=\"ORIGIN_DXDYDZ\"", "line 2: a Geometry of type `ORIGIN_DXDYDZ` is not read"),
        ("Dimensions=\"2\"", "Dimensions=\"1\"", "a DataItem announces 1 numbers and has 2"),
        (
            "Dimensions=\"2\" Format=\"XML\" Precision=\"4\">\n3\n",
            "Dimensions=\"1\">",
            "line 14: 2 cells have 1 values of `medit:ref`",
        ),
        (
            "<DataItem DataType=\"Int\" Dim",
            "<DataItem ItemType=\"HyperSlab\" Dim",
            "a DataItem of type `HyperSlab` is not read",
        ),
        ("</Geometry>", "", "expected well-formed XML"),
        ("</Xdmf>", "", "line 19: the file ends where `</Xdmf>` was expected"),
        ("<Grid Name=\"Grid\">", "<Grid GridType=\"Subset\">", "a Grid of type `subset` is not read"),
    ] {
        let text = MESHIO.replace(from, to);
        assert_ne!(text, MESHIO, "{from}");
        if told.is_empty() {
            assert_eq!(volume(&text), volume(MESHIO));
            continue;
        }
        let error = refused(&text);
        assert!(error.contains(told), "{from} to {to}: {error}");
    }
    let none = "<Xdmf><Domain><Grid Name='g'><Geometry/></Grid></Domain></Xdmf>";
    assert!(refused(none).contains("the grid `g` has no Topology"));
    assert!(refused("<Xdmf><Domain/></Xdmf>").contains("holds no tetrahedra (it holds 0 nodes)"));
}
