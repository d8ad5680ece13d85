//! Damaged and hostile files of every format: a clear error or a sound mesh, never a panic, never a silent loss.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test that cannot read its samples has failed
#![allow(clippy::case_sensitive_file_extension_comparisons)] // the names are ours
use palpate_scene::files::{FileError, Problem, SurfaceFile, UnusedNodes, VolumeFile, parse_surface, parse_volume};
use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files")
}

/// Every sample with its content; those of TetGen are spread over files and have tests of their own.
fn samples() -> &'static [(String, Vec<u8>)] {
    static SAMPLES: OnceLock<Vec<(String, Vec<u8>)>> = OnceLock::new();
    SAMPLES.get_or_init(load)
}

fn load() -> Vec<(String, Vec<u8>)> {
    let mut samples: Vec<_> = fs::read_dir(folder())
        .expect("the samples")
        .map(|entry| entry.expect("a sample").file_name().into_string().expect("a name"))
        .filter(|name| name.starts_with("bar_") || name.starts_with("skin_"))
        .filter(|name| !name.starts_with("bar_tetgen"))
        .map(|name| (name.clone(), fs::read(folder().join(name)).expect("a sample")))
        .collect();
    samples.sort();
    assert!(samples.len() > 50, "only {} samples", samples.len());
    samples
}

/// Number of elements read. Whatever is read must be sound; whatever is wrong must be said well.
fn elements(name: &str, data: &[u8]) -> Option<usize> {
    let path = Path::new(name);
    if name.starts_with("skin_") {
        checked(path, parse_surface(path, data)).map(|surface| sound_surface(&surface))
    } else {
        checked(path, parse_volume(path, data)).map(sound_volume)
    }
}

fn checked<T>(path: &Path, result: Result<T, FileError>) -> Option<T> {
    result.map_err(|error| said_well(path, &error)).ok()
}

/// Names the file, is not endless, and says what to do.
fn said_well(path: &Path, error: &FileError) {
    let text = error.to_string();
    let stem = path.file_stem().and_then(|s| s.to_str()).expect("a name");
    assert!(text.contains(stem) && text.len() < 600 && !error.problem.help().is_empty(), "{text}");
}

fn sound_surface(surface: &SurfaceFile) -> usize {
    assert!(surface.vertices.iter().all(|v| v.is_finite()));
    let vertices = surface.vertices.len() as u32;
    assert!(surface.triangles.iter().all(|&[a, b, c]| a.max(b).max(c) < vertices && a != b && b != c && c != a));
    surface.triangles.len()
}

fn sound_volume(volume: VolumeFile) -> usize {
    let nodes = volume.mesh_nodes.len() as u32;
    assert!(volume.mesh_nodes.iter().all(|v| v.is_finite()));
    assert!(volume.tets.iter().flatten().all(|&node| node < nodes));
    assert!(volume.surface_groups.iter().flat_map(|(_, t)| t).flatten().all(|&node| node < nodes));
    assert!(volume.node_groups.iter().flat_map(|(_, n)| n).all(|&node| node < nodes));
    assert_eq!(volume.tet_group.len(), volume.tets.len());
    assert!(volume.tet_group.iter().all(|&group| (group as usize) < volume.groups.len()));
    let (count, path) = (volume.tets.len(), volume.path.clone());
    checked(&path, volume.into_tet_mesh(1.0, UnusedNodes::Drop));
    count
}

/// Cut at every byte, a file is refused, or nothing is missing: only what ends behind the last element may go. An OBJ
/// file does not say how long it is.
#[test]
fn truncated_at_every_byte() {
    for (name, data) in samples() {
        let whole = elements(name, data);
        for length in 0..data.len() {
            let cut = elements(name, &data[..length]);
            let nothing_lost = cut.is_none() || cut == whole || name.ends_with(".obj");
            assert!(nothing_lost, "{name} cut to {length} of {} bytes: {cut:?} of {whole:?}", data.len());
        }
    }
}

#[test]
fn truncated_tetgen_files() {
    let scratch = tempfile::tempdir().expect("a folder");
    let read = |name: &str| fs::read(folder().join(name)).expect("a sample");
    let parts = [("bar_tetgen.node", read("bar_tetgen.node")), ("bar_tetgen.ele", read("bar_tetgen.ele"))];
    for (part, (name, data)) in parts.iter().enumerate() {
        let (other, intact) = &parts[1 - part];
        fs::write(scratch.path().join(other), intact).expect("written");
        for length in (0..data.len()).step_by(7).chain([data.len() - 1]) {
            let path = scratch.path().join(name);
            fs::write(&path, &data[..length]).expect("written");
            let volume = checked(&path, palpate_scene::files::read_volume(&path));
            assert!(volume.is_none_or(|volume| sound_volume(volume) == 91), "{name} cut to {length} bytes");
        }
    }
}

/// Every bit of the first 200 bytes, where the headers are, and some of the rest.
#[test]
fn single_bits_flipped() {
    for (name, data) in samples() {
        let mut data = data.clone();
        let bits = (0..data.len() * 8).filter(|bit| *bit < 200 * 8 || bit % 97 == 0);
        for bit in bits.collect::<Vec<_>>() {
            data[bit / 8] ^= 1 << (bit % 8);
            elements(name, &data);
            data[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

/// Whole numbers of a binary file overwritten by the greatest and the least.
#[test]
fn extreme_numbers_in_binary_files() {
    for (name, data) in samples() {
        for at in (0..data.len().saturating_sub(8)).step_by(12) {
            for pattern in [[0xff; 8], [0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff, 0x7f], [0x80, 0, 0, 0, 0, 0, 0, 0x80]]
            {
                let mut damaged = data.clone();
                damaged[at..at + 8].copy_from_slice(&pattern);
                elements(name, &damaged);
            }
        }
    }
}

/// Each word of the text samples replaced by words that no count, index or coordinate should be.
#[test]
fn extreme_words_in_text_files() {
    const WORDS: [&str; 8] =
        ["18446744073709551615", "9223372036854775807", "-1", "0", "nan", "1e999", "-2147483648", "x"];
    for (name, data) in samples() {
        let Ok(text) = std::str::from_utf8(data) else { continue };
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        let starts: Vec<usize> = words.iter().map(|w| w.as_ptr() as usize - text.as_ptr() as usize).collect();
        // All words of the head, then a sample.
        for (place, (&start, word)) in starts.iter().zip(&words).enumerate() {
            if place > 120 && place % 23 != 0 {
                continue;
            }
            for replacement in WORDS {
                let damaged = format!("{}{replacement}{}", &text[..start], &text[start + word.len()..]);
                elements(name, damaged.as_bytes());
            }
        }
    }
}

const HEADS: [&str; 18] = [
    "",
    "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n",
    "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n",
    "$MeshFormat\n2.2 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Nodes\n3\n",
    "$MeshFormat\n4.1 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Entities\n",
    "$MeshFormat\n4.1 1 8\n\u{1}\0\0\0\n$EndMeshFormat\n$Nodes\n",
    "$NOD\n",
    "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n",
    "# vtk DataFile Version 5.1\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 double\n",
    "<?xml version=\"1.0\"?><VTKFile type=\"UnstructuredGrid\">",
    "<VTKFile type=\"PolyData\"><AppendedData encoding=\"raw\">_",
    "<Xdmf><Domain><Grid><Geometry><DataItem Dimensions=\"1 3\">",
    "<Xdmf><Domain><Grid><Geometry><DataItem Dimensions=\"1 3\">0 0 0</DataItem></Geometry><Topology TopologyType=\"Mixed\"><DataItem Dimensions=\"5\">",
    "solid a\nfacet normal 0 0 1\nouter loop\n",
    "ply\nformat ascii 1.0\n",
    "ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
    "v 1 2 3\nf 1 1 1\n",
    "4 3 0 0\n",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn garbage(
        head in prop::sample::select(&HEADS[..]),
        tail in prop::collection::vec(any::<u8>(), 0..300),
        extension in prop::sample::select(&["msh", "vtk", "vtu", "vtp", "xdmf", "stl", "obj", "ply", "dat", ""][..]),
        surface in any::<bool>(),
    ) {
        let name = format!("{}_garbage.{extension}", if surface { "skin" } else { "bar" });
        elements(&name, &[head.as_bytes(), &tail].concat());
    }

    #[test]
    fn scattered_damage(
        sample in any::<prop::sample::Index>(),
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let samples = samples();
        let (name, mut data) = samples[sample.index(samples.len())].clone();
        for (place, byte) in damage {
            let place = place.index(data.len());
            data[place] = byte;
        }
        elements(&name, &data);
    }
}

fn refused(name: &str, text: &str) -> String {
    let path = Path::new(name);
    let volume = parse_volume(path, text.as_bytes()).expect_err(name);
    said_well(path, &volume);
    format!("{volume}; {}", volume.problem.help())
}

/// A count is checked against the size of the file before anything is stored.
#[test]
fn announced_counts_are_checked() {
    let msh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n";
    let msh4 = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n";
    let vtk = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n";
    for (name, text) in [
        ("a.msh", format!("{msh}9000000000000000000\n1 0 0 0\n")),
        ("b.msh", format!("{msh}-5\n")),
        ("c.msh", format!("{msh4}1 4 1 4\n3 1 0 4000000000\n1\n")),
        ("d.vtk", format!("{vtk}POINTS 1152921504606846976 double\n0 0 0\n")),
        ("e.vtk", format!("{vtk}POINTS 1 double\n0 0 0\nCELLS 99999999 4\n")),
        ("f.ply", "ply\nformat ascii 1.0\nelement vertex 4294967295\nproperty float x\nend_header\n0\n".to_string()),
    ] {
        let error = parse_volume(Path::new(name), text.as_bytes()).expect_err(name);
        assert!(matches!(*error.problem, Problem::Count { .. }), "{name}: {error}");
    }
    let mut stl = vec![b' '; 80];
    stl.extend(u32::MAX.to_le_bytes());
    let error = parse_surface(Path::new("g.stl"), &stl).expect_err("no triangles");
    assert_eq!(
        error.to_string(),
        "g.stl, byte 80: announces 4294967295 triangles of 50 bytes, but 0 bytes are left in the file; it is truncated \
         or the count is wrong"
    );
}

#[test]
fn messages_name_line_node_and_element() {
    let msh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n";
    let nan = refused("a.msh", &format!("{msh}4 0 0 nan\n$EndNodes\n"));
    assert!(nan.starts_with("a.msh, line 9: node 4 has a coordinate that is not finite: (0, 0, NaN)"), "{nan}");
    let tiny = refused("a.msh", &format!("{msh}4 1e-300 0 nan\n$EndNodes\n"));
    assert!(tiny.contains("not finite: (1e-300, 0, NaN)"), "{tiny}");
    let whole = format!("{msh}4 0 0 1\n$EndNodes\n$Elements\n1\n");
    let range = refused("b.msh", &format!("{whole}7 4 2 1 1 1 2 3 5\n$EndElements\n"));
    assert!(range.contains("b.msh, line 13: element 7 refers to node 5") && range.contains("tags 1 to 4"), "{range}");
    let twice = refused("c.msh", &format!("{msh}3 0 0 1\n$EndNodes\n"));
    assert!(twice.contains("line 9: node 3 is defined twice"), "{twice}");
    let word = refused("d.msh", &format!("{whole}7 four 2 1 1 1 2 3 4\n$EndElements\n"));
    assert!(word.contains("line 13: expected the type of an element, found `four`"), "{word}");
    let none = refused("e.msh", &format!("{whole}7 2 2 1 1 1 2 3\n$EndElements\n"));
    assert!(none.contains("e.msh: holds no tetrahedra (it holds 4 nodes, 1 triangle)"), "{none}");
    assert!(none.contains("gmsh -3"), "{none}");
    let cut = refused("f.msh", &format!("{whole}7 4 2 1 1 1 2"));
    assert!(cut.contains("line 13: the file ends where the node of an element was expected"), "{cut}");

    let vtk =
        "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n";
    let index = refused("g.vtk", &format!("{vtk}CELLS 1 5\n4 0 1 2 4\nCELL_TYPES 1\n10\n"));
    assert!(index.contains("cell 0 refers to node 4") && index.contains("there are 4, counting from 0"), "{index}");
    assert!(refused("h.foo", "hello").contains("neither by the extension `foo` nor by the content"));
    assert!(refused("i.msh", "").contains("i.msh: the file is empty"));
}

#[test]
fn what_is_no_file_is_said() {
    let read = |path: &Path| palpate_scene::files::read_volume(path).expect_err("nothing to read").to_string();
    let missing = read(Path::new("no/such/mesh.msh"));
    assert!(missing.starts_with("no/such/mesh.msh: cannot be read: No such file"), "{missing}");
    assert!(read(&folder()).contains("is not a regular file"));
    #[cfg(unix)]
    assert!(read(Path::new("/dev/zero")).contains("is not a regular file"));
    // Half of TetGen's two files.
    let scratch = tempfile::tempdir().expect("a folder");
    let path = scratch.path().join("half.node");
    fs::write(&path, "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n").expect("written");
    assert!(read(&path).contains("half.ele: cannot be read"), "{}", read(&path));
}
