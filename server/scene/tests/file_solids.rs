//! Hexahedra, prisms and pyramids, split into tetrahedra that fit each other: on cubes whose volume and area are known,
//! with their nodes numbered at random, in every format.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test that cannot read its meshes has failed
use cubes::{Mesh, Of, Random, cube};
use glam::DVec3;
use palpate_scene::files::{FileError, GroupedMesh, Problem, UnusedNodes, VolumeFile, parse_volume};
use std::collections::HashMap;
use std::fmt::Write;
use std::path::Path;

use crate::cubes;

fn volume(name: &str, data: impl AsRef<[u8]>) -> VolumeFile {
    parse_volume(Path::new(name), data.as_ref()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

fn read(name: &str, data: impl AsRef<[u8]>) -> GroupedMesh {
    volume(name, data).into_tet_mesh(1.0, UnusedNodes::Refuse).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Faces of tets, each with how many tets have it.
fn faces(mesh: &GroupedMesh) -> HashMap<[u32; 3], usize> {
    let mut faces = HashMap::new();
    for &[a, b, c, d] in mesh.mesh.tets() {
        for mut face in [[b, c, d], [a, c, d], [a, b, d], [a, b, c]] {
            face.sort_unstable();
            *faces.entry(face).or_default() += 1;
        }
    }
    faces
}

fn area(mesh: &GroupedMesh, face: [u32; 3]) -> f64 {
    let [a, b, c] = face.map(|node| mesh.mesh.positions_m()[node as usize]);
    (b - a).cross(c - a).length() / 2.0
}

/// The mesh is the unit cube, without a gap: its volume and area, and every face within has two tets.
fn is_the_unit_cube(mesh: &GroupedMesh, told: &str) {
    // Tets of no volume, and inverted ones, are refused before.
    assert!((mesh.mesh.total_volume_m3() - 1.0).abs() < 1e-12, "{told}");
    let mut outside = 0.0;
    for (face, tets) in faces(mesh) {
        let corners = face.map(|node| mesh.mesh.positions_m()[node as usize]);
        let on = |side: &dyn Fn(DVec3) -> f64| corners.iter().all(|&p| side(p).abs() < 1e-12);
        let is_outside = (0..3).any(|axis| on(&|p| p[axis]) || on(&|p| p[axis] - 1.0));
        assert_eq!(tets, if is_outside { 1 } else { 2 }, "{told}: {corners:?}");
        outside += if is_outside { area(mesh, face) } else { 0.0 };
    }
    assert!((outside - 6.0).abs() < 1e-12, "{told}: {outside}");
}

/// Every kind, every numbering: upright tets, no gap, the cube's volume and area; quadrangles of the surface are cut
/// as the faces of the solids on which they lie.
#[test]
fn cubes_are_filled_whatever_the_numbers_of_their_nodes() {
    for of in [Of::Hexahedra, Of::Prisms, Of::Pyramids, Of::Mixed] {
        for n in 1..5 {
            for seed in 0..25 {
                let told = format!("{of:?}, {n}³, seed {seed}");
                let plain = cube(n, of);
                let whole = if seed == 0 { plain } else { plain.shuffled(seed) };
                let mesh = read("cube.msh", whole.msh22());
                is_the_unit_cube(&mesh, &told);
                let faces = faces(&mesh);
                let quadrangles = &mesh.members()[mesh.groups.iter().position(|g| g.tag == 7).unwrap()].triangles;
                assert_eq!(quadrangles.len(), 2 * n * n, "{told}");
                for &triangle in quadrangles {
                    let mut key = triangle;
                    key.sort_unstable();
                    assert_eq!(faces.get(&key), Some(&1), "{told}: {triangle:?} is no face of a tet on the surface");
                }
                assert!(mesh.warnings.is_empty(), "{told}: {:?}", mesh.warnings);
            }
        }
    }
}

/// Corners by position and the group, sorted: numbering plays no part.
fn canonical(mesh: &GroupedMesh) -> Vec<([[i64; 3]; 4], i64)> {
    let tet = |tet: usize| {
        let mut corners = mesh.mesh.corners_m(tet).map(|p| (p * 1e9).round().as_i64vec3().to_array());
        corners.sort_unstable();
        (corners, mesh.groups[mesh.tet_group[tet] as usize].tag)
    };
    let mut all: Vec<_> = (0..mesh.mesh.tets().len()).map(tet).collect();
    all.sort_unstable();
    all
}

#[test]
fn every_format_gives_the_same_tetrahedra_and_groups() {
    for of in [Of::Hexahedra, Of::Prisms, Of::Pyramids, Of::Mixed] {
        let whole = cube(3, of).shuffled(2026);
        let reference = read("cube.msh", whole.msh22());
        let tags: Vec<i64> = canonical(&reference).iter().map(|tet| tet.1).collect();
        assert!(tags.contains(&1) && tags.contains(&2), "{of:?}");
        for (name, data) in [
            ("ascii.msh", whole.msh41(false)),
            ("binary.msh", whole.msh41(true)),
            ("cube.vtk", whole.vtk().into_bytes()),
            ("cube.vtu", whole.vtu().into_bytes()),
            ("cube.mesh", whole.medit().into_bytes()),
            ("cube.xdmf", whole.xdmf().into_bytes()),
        ] {
            let mesh = read(name, data);
            assert!(canonical(&mesh) == canonical(&reference), "{of:?}: {name}");
            assert!(
                mesh.warnings.is_empty() && !mesh.notes.is_empty(),
                "{name}: {:?}, {:?}",
                mesh.warnings,
                mesh.notes
            );
        }
    }
}

#[test]
fn what_was_split_is_told_in_one_line() {
    let whole = cube(2, Of::Hexahedra);
    let text = whole.msh22().replace(
        "$Elements\n12\n",
        "$Elements\n17\n20 1 2 0 1 1 2\n21 1 2 0 1 2 3\n22 1 2 0 1 3 6\n23 15 2 0 1 1\n24 15 2 0 1 3\n",
    );
    let mesh = read("cube.msh", text);
    let split = "8 hexahedra were split into 48 tetrahedra; 3 lines and 2 points of the geometry were left out";
    assert_eq!(mesh.notes, [split.to_string()]);
    let mixed = read("cube.msh", cube(2, Of::Mixed).msh22());
    assert_eq!(mixed.notes.len(), 1);
    assert!(mixed.notes[0].starts_with("2 hexahedra, 8 prisms and 12 pyramids were split into "), "{:?}", mixed.notes);
    let one = Mesh { quadrangles: vec![], ..cube(1, Of::Hexahedra) };
    assert_eq!(read("cube.msh", one.msh22()).notes, ["1 hexahedron was split into 6 tetrahedra"]);
}

/// A solid that lists its corners the other way round is turned by itself; the file's own tets by theirs.
#[test]
fn solids_that_are_inverted_are_turned() {
    for of in [Of::Hexahedra, Of::Prisms, Of::Pyramids] {
        let mut whole = cube(2, of).shuffled(7);
        for solid in whole.solids.iter_mut().step_by(2) {
            match solid.as_mut_slice() {
                [a, b, c, d, e, f, g, h] => {
                    (*a, *b, *c, *d, *e, *f, *g, *h) = (*e, *f, *g, *h, *a, *b, *c, *d);
                }
                [a, b, c, d, e, f] => (*a, *b, *c, *d, *e, *f) = (*d, *e, *f, *a, *b, *c),
                [_, b, _, d, _] => std::mem::swap(b, d),
                _ => unreachable!(),
            }
        }
        let mesh = read("cube.msh", whole.msh22());
        is_the_unit_cube(&mesh, "turned");
        assert!(
            mesh.notes.iter().any(|note| note.contains("the corners are taken in the other order")),
            "{:?}",
            mesh.notes
        );
        assert!(mesh.warnings.is_empty());
    }
    // A hexahedron and a tet beside, which is inverted: as all of the file's tets, it is turned.
    let mut whole = cube(1, Of::Hexahedra);
    whole.nodes.push(DVec3::new(2.0, 2.0, 2.0));
    whole.nodes.push(DVec3::new(2.0, 0.0, 2.0));
    for (tet, volume) in [([7, 6, 8, 9], 1.0), ([6, 7, 8, 9], 1.0)] {
        let whole = Mesh { solids: vec![whole.solids[0].clone(), tet.to_vec()], tags: vec![1, 1], ..whole.clone() };
        let mesh = read("cube.msh", whole.msh22());
        assert!(mesh.mesh.total_volume_m3() > volume);
    }
}

/// ANSYS writes prisms, pyramids and tetrahedra as hexahedra whose corners fall together.
#[test]
fn collapsed_hexahedra_give_what_is_left_of_them() {
    for of in [Of::Prisms, Of::Pyramids, Of::Mixed] {
        let whole = cube(3, of).shuffled(11);
        let mut collapsed = whole.clone();
        for solid in &mut collapsed.solids {
            *solid = match *solid.as_slice() {
                [a, b, c, d, e, f] => vec![a, b, c, c, d, e, f, f],
                [a, b, c, d, apex] => vec![a, b, c, d, apex, apex, apex, apex],
                _ => solid.clone(),
            };
        }
        let mesh = read("cube.msh", collapsed.msh22());
        is_the_unit_cube(&mesh, "collapsed");
        assert!(canonical(&mesh) == canonical(&read("cube.msh", whole.msh22())), "{of:?}");
    }
    // One that has collapsed to a face is left out, and told.
    let mut whole = cube(1, Of::Hexahedra);
    whole.solids.push(vec![0, 1, 3, 2, 0, 1, 3, 2]);
    whole.tags.push(1);
    let mesh = read("cube.msh", whole.msh22());
    is_the_unit_cube(&mesh, "with a flat one");
    assert_eq!(mesh.warnings, ["left out, for their corners fall together and leave no volume: 1 hexahedron"]);
    assert_eq!(mesh.notes, ["1 hexahedron was split into 6 tetrahedra"]);
}

fn refused(mesh: &Mesh) -> FileError {
    match parse_volume(Path::new("cube.msh"), mesh.msh22().as_bytes()) {
        Ok(file) => panic!("{:?}", file.notes),
        Err(error) => error,
    }
}

/// A hexahedron that is turned inside out at a corner, or as a whole while its neighbours are not (it would be laid over
/// them), is told with its number and its place.
#[test]
fn inverted_and_flat_hexahedra_are_named() {
    let mut whole = cube(3, Of::Hexahedra);
    // The node in the middle of all, pushed through the opposite corner of the cube that it begins: number 13 of 27.
    let middle = whole.solids[13][0];
    whole.nodes[middle] = DVec3::splat(0.9);
    let error = refused(&whole);
    let Problem::InvertedSolids { first, .. } = &*error.problem else { panic!("{error}") };
    assert!(first.contains(&13), "{error}");
    assert!(error.to_string().starts_with("cube.msh: "), "{error}");
    assert!(
        error.to_string().contains("1 of 27 hexahedra is flat or turned inside out at a corner (numbers 13, "),
        "{error}"
    );
    let mut flat = cube(2, Of::Hexahedra);
    flat.nodes.iter_mut().for_each(|p| p.z = if p.z > 0.6 { 0.5 } else { p.z });
    let told = refused(&flat).to_string();
    assert!(told.contains("4 of 8 hexahedra are flat") && told.contains("(numbers 4, 5, 6, 7,"), "{told}");
    assert!(told.contains("the first is around (0.25, 0.25, 0.5) in the file's unit"), "{told}");
}

/// Faces that are bent so much that the rule gives an inverted tet: a node in the middle, from which all corners are
/// seen.
#[test]
fn much_bent_hexahedra_are_split_around_their_middle() {
    // A corner pushed in behind the plane of its three neighbours, whose numbers have it cut off by that plane.
    let mut dented = Mesh { quadrangles: vec![], ..cube(1, Of::Hexahedra) };
    dented.nodes = [[0, 0, 0], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
        .map(|p| DVec3::from(p.map(f64::from)))
        .to_vec();
    dented.nodes.push(DVec3::splat(0.6));
    dented.solids = vec![vec![0, 4, 1, 5, 6, 2, 7, 3]];
    let mesh = read("cube.msh", dented.msh22());
    let told = "split around a node of their own in the middle, for their faces are bent: 1 hexahedron";
    assert_eq!(mesh.notes, [told, "1 hexahedron was split into 12 tetrahedra"]);
    assert!((mesh.mesh.total_volume_m3() - (5.0 - 0.2) / 6.0).abs() < 1e-14);
    assert_eq!(faces(&mesh).values().filter(|&&tets| tets == 1).count(), 12);
    let mut seen = 0;
    for seed in 1..60 {
        let mut whole = cube(3, Of::Hexahedra).shuffled(seed);
        let mut random = Random::of(seed);
        let within = |p: &DVec3| p.min_element() > 0.1 && p.max_element() < 0.9;
        for p in whole.nodes.iter_mut().filter(|p| within(p)) {
            *p += DVec3::from([0; 3].map(|_| (random.below(2001) as f64 / 1000.0 - 1.0) * 0.16));
        }
        // One that is beyond that may be refused, never read with a gap.
        let Ok(file) = parse_volume(Path::new("cube.msh"), whole.msh22().as_bytes()) else { continue };
        let mesh = file.into_tet_mesh(1.0, UnusedNodes::Refuse).unwrap();
        is_the_unit_cube(&mesh, &format!("bent, seed {seed}"));
        seen +=
            usize::from(mesh.notes.iter().any(|note| note.contains("split around a node of their own in the middle")));
    }
    assert!(seen >= 5, "{seen}");
}

/// A hexahedron beside two tets whose faces are cut along the other diagonal: the body is open there, and that is said.
#[test]
fn faces_that_cannot_fit_are_told() {
    let nodes = [
        [0., 0., 0.],
        [1., 0., 0.],
        [1., 1., 0.],
        [0., 1., 0.],
        [0., 0., 1.],
        [1., 0., 1.],
        [1., 1., 1.],
        [0., 1., 1.],
    ];
    let mut whole = Mesh { nodes: nodes.map(DVec3::from).to_vec(), ..Mesh::default() };
    whole.nodes.push(DVec3::new(0.5, 0.5, 2.0));
    // The top is cut from node 4 to node 6.
    whole.solids = vec![(0..8).collect(), vec![4, 5, 6, 8], vec![4, 6, 7, 8]];
    whole.tags = vec![1; 3];
    let fitting = read("a.msh", whole.msh22());
    assert!(fitting.warnings.is_empty(), "{:?}", fitting.warnings);
    assert_eq!(faces(&fitting).values().filter(|&&tets| tets == 1).count(), 10 + 4);
    whole.solids = vec![(0..8).collect(), vec![4, 5, 7, 8], vec![5, 6, 7, 8]];
    let open = read("a.msh", whole.msh22());
    let told =
        "2 triangles of tetrahedra, prisms or pyramids lie across the diagonal along which the face of four corners";
    assert!(open.warnings.len() == 1 && open.warnings[0].starts_with(told), "{:?}", open.warnings);
    // A pyramid has a face of four corners, and fits whatever the numbers are.
    whole.solids = vec![(0..8).collect(), vec![4, 5, 6, 7, 8]];
    whole.tags = vec![1; 2];
    let pyramid = read("a.msh", whole.msh22());
    assert!(pyramid.warnings.is_empty(), "{:?}", pyramid.warnings);
    assert!((pyramid.mesh.total_volume_m3() - 4.0 / 3.0).abs() < 1e-14);
}

/// MSH 2.2 lists a solid once for each of its groups; XDMF's tags list the cells once more.
#[test]
fn a_solid_that_is_listed_for_each_of_its_groups_is_one() {
    let mut whole = cube(2, Of::Hexahedra);
    for solid in 0..8 {
        whole.solids.push(whole.solids[solid].clone());
        whole.tags.push(9);
    }
    let mesh = read("cube.msh", whole.msh22());
    is_the_unit_cube(&mesh, "listed twice");
    let group = mesh.groups.iter().position(|group| group.tag == 9).unwrap();
    assert_eq!(mesh.members()[group].tets.len(), 48);
    assert!(
        mesh.warnings.is_empty() && mesh.notes[0].starts_with("8 hexahedra were split into 48"),
        "{:?}",
        mesh.notes
    );
    whole.solids.push(whole.solids[0].clone());
    whole.tags.push(9);
    assert_eq!(read("cube.msh", whole.msh22()).warnings, ["repeated elements are used once: 1 hexahedron"]);
}

/// Voxels and pixels of VTK count their corners along the axes.
#[test]
fn voxels_and_pixels() {
    let hexahedra = cube(2, Of::Hexahedra);
    let mut voxels = hexahedra.clone();
    voxels.solids.iter_mut().for_each(|s| (s[2], s[3], s[6], s[7]) = (s[3], s[2], s[7], s[6]));
    let (hexahedra, voxels) =
        (hexahedra.vtk(), voxels.vtk().replace("\n12\n12\n", "\n11\n11\n").replace("\n12\n", "\n11\n"));
    assert!(canonical(&read("a.vtk", &voxels)) == canonical(&read("a.vtk", &hexahedra)));
    let sheet = |numbers: &str, kind: i64| {
        let head = "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\n";
        let text = format!("{head}CELLS 1 5\n4 {numbers}\nCELL_TYPES 1\n{kind}\n");
        palpate_scene::files::parse_surface(Path::new("a.vtk"), text.as_bytes()).unwrap().triangles
    };
    assert_eq!(sheet("0 1 2 3", 8), sheet("0 1 3 2", 9));
}

/// Of hexahedra and prisms of second order the corners are used, in every format's own number of nodes.
#[test]
fn second_order_is_reduced_to_the_corners() {
    let whole = cube(2, Of::Hexahedra);
    let more = |count: usize| " 1".repeat(count);
    for (number, nodes) in [(12, 27), (17, 20)] {
        let text = whole.msh22();
        let mut quadratic = String::new();
        for line in text.lines() {
            let is_hexahedron = line.split(' ').nth(1) == Some("5") && line.split(' ').count() == 13;
            if is_hexahedron {
                writeln!(quadratic, "{}{}", line.replacen(" 5 ", &format!(" {number} "), 1), more(nodes - 8)).unwrap();
            } else {
                writeln!(quadratic, "{line}").unwrap();
            }
        }
        let mesh = read("cube.msh", quadratic);
        is_the_unit_cube(&mesh, "second order");
        assert!(mesh.warnings[0].starts_with("of 8 hexahedra the corner nodes are used"), "{:?}", mesh.warnings);
    }
}
