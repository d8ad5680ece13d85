//! Bodies whose parts are not joined: half of one flew away, and nothing was said. Two boxes side by side, whose common
//! side has its nodes twice, once, or a gap.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_scene::{Limits, Scene, load_file};
use std::{fmt::Write, fs, path::Path};

/// Six tets of a box by its corners, whose bits are x, y and z.
const TETS: [[usize; 4]; 6] = [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

/// Gmsh's format 2.2: a box of 10 mm from the origin and one `gap_mm` beside it; `merged` boxes share the nodes between
/// them.
fn write_boxes(path: &Path, gap_mm: f64, merged: bool) {
    let mut nodes: Vec<[f64; 3]> = Vec::new();
    let mut tets = Vec::new();
    for from in [0.0, 10.0 + gap_mm] {
        let number = |bits: usize, nodes: &mut Vec<[f64; 3]>| {
            let side = |bit: usize| if bits >> bit & 1 == 1 { 10.0 } else { 0.0 };
            let place = [from + side(0), side(1), side(2)];
            let known = nodes.iter().position(|node| merged && *node == place);
            known.unwrap_or_else(|| {
                nodes.push(place);
                nodes.len() - 1
            })
        };
        let corners: Vec<usize> = (0..8).map(|bits| number(bits, &mut nodes)).collect();
        tets.extend(TETS.map(|tet| tet.map(|corner| corners[corner])));
    }
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", nodes.len());
    for (number, [x, y, z]) in (1..).zip(nodes) {
        writeln!(text, "{number} {x} {y} {z}").unwrap();
    }
    write!(text, "$EndNodes\n$Elements\n{}\n", tets.len()).unwrap();
    for (number, [a, b, c, d]) in (1..).zip(tets) {
        writeln!(text, "{number} 4 2 1 1 {} {} {} {}", a + 1, b + 1, c + 1, d + 1).unwrap();
    }
    fs::write(path, text + "$EndElements\n").unwrap();
}

const TETRAHEDRA: &str =
    "[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";
const SPRINGS: &str = "[body.springs]\nmesh_n_per_m = 60\nanchor_n_per_m = 12\nvertex_mass_kg = 2e-4\n";

/// The warnings of a scene of two boxes, held where `held` says.
fn warnings(gap_mm: f64, merged: bool, kind: &str, held: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    write_boxes(&folder.path().join("boxes.msh"), gap_mm, merged);
    let hold = if held.is_empty() {
        String::new()
    } else {
        format!("[[region]]\nname = \"held\"\nselect = {held}\n[[fixed]]\nregion = \"held\"\n")
    };
    let text = format!("[scene]\nname = \"t\"\n[body.mesh]\nfile = \"boxes.msh\"\nunit = \"mm\"\n{kind}{hold}");
    let path = folder.path().join("t.toml");
    fs::write(&path, text).unwrap();
    let scene: Scene = load_file(&path, &Limits::local(), &mut |_, _| {}).unwrap();
    scene.warnings
}

const ONE_SIDE: &str = "{ box = { min_mm = [-1, -1, -1], max_mm = [1, 11, 11] } }";
const ALL: &str = "{ box = { min_mm = [-1, -1, -1], max_mm = [41, 11, 11] } }";

#[test]
fn boxes_with_the_nodes_between_them_twice_are_told_with_what_is_not_held() {
    let told = warnings(0.0, false, TETRAHEDRA, ONE_SIDE);
    assert_eq!(told.len(), 1, "{told:?}");
    println!("{}", told[0]);
    for part in [
        "2 separate parts, 8 coincident nodes",
        "as at (10, 0, 0) mm",
        "part 2 (8 nodes about (15, 5, 5) mm) is not held",
        "merge the coincident nodes",
    ] {
        assert!(told[0].contains(part), "{part}: {}", told[0]);
    }
    // Held on either side they do not fly, but move apart all the same.
    let told = warnings(0.0, false, TETRAHEDRA, ALL);
    assert!(told[0].contains("2 separate parts, 8 coincident nodes") && !told[0].contains("not held"), "{told:?}");
    // Nothing is held, and nothing acts: only that they are not joined.
    let told = warnings(0.0, false, TETRAHEDRA, "");
    assert!(told.len() == 1 && !told[0].contains("not held"), "{told:?}");
}

#[test]
fn a_part_beside_the_other_is_told_where_it_is_not_held() {
    let told = warnings(5.0, false, TETRAHEDRA, ONE_SIDE);
    assert_eq!(told.len(), 1, "{told:?}");
    let wanted =
        ["2 separate parts, 0 coincident nodes; part 2", "about (20, 5, 5) mm", "hold each part with a [[fixed]]"];
    assert!(wanted.iter().all(|part| told[0].contains(part)), "{told:?}");
    assert_eq!(warnings(5.0, false, TETRAHEDRA, ALL), Vec::<String>::new());
    assert_eq!(warnings(0.0, true, TETRAHEDRA, ONE_SIDE), Vec::<String>::new());
}

/// Anchor springs hold every vertex, but join no part to the other.
#[test]
fn springs_hold_every_part_and_join_none() {
    let told = warnings(0.0, false, SPRINGS, "");
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("surface is 2 separate parts, 8 coincident nodes"), "{told:?}");
    assert!(!told[0].contains("not held"), "{told:?}");
    assert_eq!(warnings(5.0, false, SPRINGS, ""), Vec::<String>::new());
}

/// Cells of the lattice reach across the side between the boxes: a load on one does not take it away. Across a gap they do not.
#[test]
fn particles_join_what_touches() {
    let particles = format!("[body.particles]\nspacing_mm = 2\n{TETRAHEDRA}");
    assert_eq!(warnings(0.0, false, &particles, ONE_SIDE), Vec::<String>::new());
    let told = warnings(5.0, false, &particles, ONE_SIDE);
    assert!(told.len() == 1 && told[0].contains("part 2") && told[0].contains("not held"), "{told:?}");
}
