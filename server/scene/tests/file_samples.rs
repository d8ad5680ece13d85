//! One mesh in every format, as other programs write it: each file must give the same mesh.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test that cannot read its samples has failed
use glam::DVec3;
use palpate_scene::files::{GroupedMesh, Members, SurfaceFile, UnusedNodes, read_surface, read_volume};
use std::path::{Path, PathBuf};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files").join(name)
}

/// In millimetres, for the sake of the scale.
fn mesh(name: &str) -> GroupedMesh {
    let file = read_volume(&sample(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
    file.into_tet_mesh(1e-3, UnusedNodes::Drop).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// What belongs to the one group that a text means.
fn members(mesh: &GroupedMesh, text: &str) -> Members {
    let called: Vec<usize> = (0..mesh.groups.len()).filter(|&group| mesh.groups[group].is_called(text)).collect();
    assert_eq!(called.len(), 1, "{text}: {:?}", mesh.groups);
    mesh.members().swap_remove(called[0])
}

/// Tets as their corners' coordinates in units of 1e-9 m, each turned to begin with its least corner but one
/// orientation, with the group's tag; sorted, so that numbering plays no part.
fn canonical(mesh: &GroupedMesh) -> Vec<([[i64; 3]; 4], i64)> {
    let rounded = |p: DVec3| (p * 1e9).round().as_i64vec3().to_array();
    let mut tets: Vec<_> = (0..mesh.mesh.tets().len())
        .map(|tet| {
            let mut corners = mesh.mesh.corners_m(tet).map(rounded);
            corners.sort_unstable();
            (corners, mesh.groups[mesh.tet_group[tet] as usize].tag)
        })
        .collect();
    tets.sort_unstable();
    tets
}

/// With the groups `left` (11) and `right` (12).
const GROUPED: [&str; 42] = [
    "bar_v1.msh",
    "bar_v22_ascii.msh",
    "bar_v22_binary.msh",
    "bar_v41_binary.msh",
    "bar_sparse_v41_ascii.msh",
    "bar_sparse_v41_binary.msh",
    "bar_sparse_v22_ascii.msh",
    "bar_parametric_v22_ascii.msh",
    "bar_parametric_v22_binary.msh",
    "bar_parametric_v41_ascii.msh",
    "bar_parametric_v41_binary.msh",
    "bar_partitioned_v41_ascii.msh",
    "bar_quadratic_v41_ascii.msh",
    "bar_quadratic_v22_binary.msh",
    "bar_meshio42_ascii.vtk",
    "bar_meshio42_binary.vtk",
    "bar_meshio51_ascii.vtk",
    "bar_meshio51_binary.vtk",
    "bar_meshio_ascii.vtu",
    "bar_meshio_binary.vtu",
    "bar_meshio_zlib.vtu",
    "bar_meshio_v22_ascii.msh",
    "bar_gmsh.mesh",
    "bar_tetgen.node",
    "bar_tetgen.ele",
    "bar_vtk42_ascii.vtk",
    "bar_vtk42_binary.vtk",
    "bar_vtk51_ascii.vtk",
    "bar_vtk51_binary.vtk",
    "bar_vtk_ascii.vtu",
    "bar_vtk_inline.vtu",
    "bar_vtk_inline_zlib.vtu",
    "bar_vtk_raw.vtu",
    "bar_vtk_raw_u32.vtu",
    "bar_vtk_raw_big.vtu",
    "bar_vtk_base64.vtu",
    "bar_vtk_raw_zlib.vtu",
    "bar_vtk_base64_u32_zlib.vtu",
    "bar_vtk_raw_zlib_blocks.vtu",
    "bar_xdmf_meshio.xdmf",
    "bar_xdmf_binary.xdmf",
    "bar_xdmf_dolfinx.xdmf",
];

#[test]
fn every_volume_format_gives_the_same_mesh_and_groups() {
    let reference = mesh("bar_v41_ascii.msh");
    // Two boxes of 2 x 1 x 1 mm.
    assert!((reference.mesh.total_volume_m3() - 4e-9).abs() < 1e-21);
    assert_eq!((reference.mesh.positions_m().len(), reference.mesh.tets().len()), (40, 91));
    for name in GROUPED {
        assert!(canonical(&mesh(name)) == canonical(&reference), "{name}");
    }
}

/// Gmsh's VTK files and meshio's 4.1 files hold the tets, but not their physical groups.
#[test]
fn formats_without_groups_give_the_same_tets() {
    let without = |name| canonical(&mesh(name)).into_iter().map(|(corners, _)| corners).collect::<Vec<_>>();
    for name in ["bar_gmsh_ascii.vtk", "bar_gmsh_binary.vtk", "bar_meshio_v41_binary.msh"] {
        assert!(without(name) == without("bar_v41_ascii.msh"), "{name}");
    }
}

/// Formats with double precision give the nodes to the bit. (Gmsh's own text has 16 digits, one too few; meshio and
/// VTK made their files from that text.)
#[test]
fn double_precision_is_kept_to_the_bit() {
    let nodes = |name| read_volume(&sample(name)).unwrap().mesh_nodes;
    assert!(nodes("bar_v22_binary.msh") == nodes("bar_v41_binary.msh"));
    for name in [
        "bar_meshio51_binary.vtk",
        "bar_meshio_zlib.vtu",
        "bar_vtk_raw_big.vtu",
        "bar_tetgen.ele",
        "bar_xdmf_binary.xdmf",
    ] {
        assert!(nodes(name) == nodes("bar_v41_ascii.msh"), "{name}");
    }
}

/// The bar and, apart, a cube of a millimetre, which is one hexahedron.
#[test]
fn hexahedra_among_tets_are_split() {
    let bar = canonical(&mesh("bar_v41_ascii.msh"));
    for name in ["bar_mixed.vtu", "bar_mixed_v22_ascii.msh"] {
        let mesh = mesh(name);
        let of_cube = |tet: &([[i64; 3]; 4], i64)| tet.0.iter().all(|corner| corner[0] >= 9_000_000);
        let (cube, rest): (Vec<_>, Vec<_>) = canonical(&mesh).into_iter().partition(of_cube);
        assert_eq!(
            rest.iter().map(|tet| tet.0).collect::<Vec<_>>(),
            bar.iter().map(|tet| tet.0).collect::<Vec<_>>(),
            "{name}"
        );
        assert_eq!((cube.len(), mesh.mesh.positions_m().len()), (6, 48), "{name}");
        assert!((mesh.mesh.total_volume_m3() - 5e-9).abs() < 1e-20, "{name}");
    }
}

#[test]
fn physical_names_surfaces_and_points_are_kept() {
    for name in [
        "bar_v41_ascii.msh",
        "bar_v41_binary.msh",
        "bar_v22_ascii.msh",
        "bar_v22_binary.msh",
        "bar_sparse_v41_ascii.msh",
    ] {
        let mesh = mesh(name);
        let at = |group: &str, x_m: f64| {
            let nodes = members(&mesh, group).nodes;
            assert!(!nodes.is_empty(), "{name}: {group}");
            assert!(
                nodes.iter().all(|&n| (mesh.mesh.positions_m()[n as usize].x - x_m).abs() < 1e-12),
                "{name}: {group}"
            );
        };
        at("base", 0.0);
        at("tip", 4e-3);
        let corner = members(&mesh, "corner").nodes;
        assert_eq!(corner.len(), 1, "{name}");
        assert_eq!(mesh.mesh.positions_m()[corner[0] as usize], DVec3::ZERO, "{name}");
        let half =
            |group: &str| members(&mesh, group).tets.iter().map(|&tet| mesh.mesh.volume_m3(tet as usize)).sum::<f64>();
        assert!((half("left") - 2e-9).abs() < 1e-21 && (half("right") - 2e-9).abs() < 1e-21, "{name}");
        assert_eq!(members(&mesh, "left").tets, members(&mesh, "11").tets, "{name}");
        // A square millimetre of triangles.
        let area_m2 = |group: &str| -> f64 {
            let triangles = members(&mesh, group).triangles;
            let corners = |t: &[u32; 3]| t.map(|n| mesh.mesh.positions_m()[n as usize]);
            triangles.iter().map(corners).map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
        };
        assert!((area_m2("base") - 1e-6).abs() < 1e-18, "{name}");
    }
}

/// dolfinx writes what tags facets as a mesh of triangles over the same nodes.
#[test]
fn tagged_facets_are_groups() {
    let mesh = mesh("bar_xdmf_dolfinx.xdmf");
    let x_mm = |group: &str| -> Vec<f64> {
        members(&mesh, group).nodes.iter().map(|&node| mesh.mesh.positions_m()[node as usize].x * 1e3).collect()
    };
    assert!(x_mm("21").len() > 3 && x_mm("21").iter().all(|x| x.abs() < 1e-9));
    assert!(x_mm("22").len() > 3 && x_mm("22").iter().all(|x| (x - 4.0).abs() < 1e-9));
    assert!(mesh.warnings.is_empty(), "{:?}", mesh.warnings);
}

/// A tet may belong to several physical groups: MSH 2.2 then lists it once for each.
#[test]
fn overlapping_groups_are_kept() {
    for name in ["bar_overlap_v41_ascii.msh", "bar_overlap_v22_ascii.msh"] {
        let mesh = mesh(name);
        assert_eq!(mesh.mesh.tets().len(), 91, "{name}");
        assert_eq!(members(&mesh, "all").tets.len(), 91, "{name}");
        assert_eq!(members(&mesh, "left").tets.len() + members(&mesh, "right").tets.len(), 91, "{name}");
    }
}

/// Gmsh numbers the groups of each dimension apart: volume 1 is not surface 1.
#[test]
fn groups_of_one_number_in_two_dimensions_are_two() {
    for name in ["bar_unnamed_v41_ascii.msh", "bar_unnamed_v22_ascii.msh"] {
        let mesh = mesh(name);
        let (volume, surface) = (members(&mesh, "volume 1"), members(&mesh, "surface 1"));
        assert!(volume.triangles.is_empty() && surface.tets.is_empty(), "{name}");
        assert_eq!(volume.tets.len() + members(&mesh, "right").tets.len(), 91, "{name}");
        let x_m = |node: u32| mesh.mesh.positions_m()[node as usize].x;
        assert!(surface.nodes.len() > 3 && surface.nodes.iter().all(|&node| x_m(node) == 0.0), "{name}");
        assert!(volume.nodes.len() > surface.nodes.len(), "{name}");
    }
}

#[test]
fn what_is_not_used_is_said() {
    let said = |name: &str, words: &str| {
        let warnings = mesh(name).warnings;
        assert!(warnings.iter().any(|w| w.contains(words)), "{name}: {warnings:?}");
    };
    for name in ["bar_mixed_v22_ascii.msh", "bar_mixed.vtu"] {
        let mesh = mesh(name);
        assert!(mesh.warnings.is_empty(), "{name}: {:?}", mesh.warnings);
        assert_eq!(mesh.notes, ["1 hexahedron was split into 6 tetrahedra"], "{name}");
    }
    said("bar_quadratic_v41_ascii.msh", "91 tetrahedra");
    said("bar_quadratic_v41_ascii.msh", "corner nodes");
    assert_eq!(mesh("bar_v41_binary.msh").warnings, Vec::<String>::new());
}

#[test]
fn what_is_not_read_names_the_way_out() {
    let refused = |name: &str| {
        let error = read_volume(&sample(name)).unwrap_err();
        format!("{error}; {}", error.problem.help())
    };
    let version = refused("bar_v40_ascii.msh");
    assert!(version.contains("line 2: MSH version 4 is not read") && version.contains("-format msh41"), "{version}");
    assert!(refused("bar_vtk_raw_lz4.vtu").contains("vtkLZ4DataCompressor"));
    assert!(refused("bar_meshio_lzma.vtu").contains("vtkLZMADataCompressor"));
    assert!(
        refused("bar_xdmf_hdf.xdmf")
            .contains("in the HDF5 file `bar.h5`, which is not read; put the numbers into the XML")
    );
    assert!(refused("skin_meshio_ascii.stl").contains("no tetrahedra (it holds 38 nodes, 72 triangles)"));
}

/// Triangles as their corners in units of 1e-5 (some files hold six digits), each begun with its least corner.
fn triangles(surface: &SurfaceFile) -> Vec<[[i64; 3]; 3]> {
    let mut all: Vec<_> = surface
        .triangles
        .iter()
        .map(|t| {
            let mut corners = t.map(|v| (surface.vertices[v as usize] * 1e5).round().as_i64vec3().to_array());
            let least = (0..3).min_by_key(|&i| corners[i]).unwrap_or(0);
            corners.rotate_left(least);
            corners
        })
        .collect();
    all.sort_unstable();
    all
}

#[test]
fn every_surface_format_gives_the_same_triangles() {
    let reference = read_surface(&sample("skin_meshio.obj")).unwrap();
    assert_eq!((reference.vertices.len(), reference.triangles.len()), (38, 72));
    let volume: f64 = reference
        .triangles
        .iter()
        .map(|t| t.map(|v| reference.vertices[v as usize]))
        .map(|[a, b, c]| a.dot(b.cross(c)) / 6.0)
        .sum();
    assert!((volume - 4.0).abs() < 1e-9, "the skin is closed and faces outwards: {volume}");
    for name in [
        "skin_meshio51_binary.vtk",
        "skin_meshio_ascii.ply",
        "skin_meshio_ascii.stl",
        "skin_meshio_binary.ply",
        "skin_meshio_binary.stl",
        "skin_solid_binary.stl",
        "skin_vtk42_ascii.vtk",
        "skin_vtk42_binary.vtk",
        "skin_vtk51_ascii.vtk",
        "skin_vtk51_binary.vtk",
        "skin_vtk_ascii.ply",
        "skin_vtk_ascii.vtp",
        "skin_vtk_big.ply",
        "skin_vtk_little.ply",
        "skin_vtk_raw.vtp",
    ] {
        let surface = read_surface(&sample(name)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(surface.vertices.len(), 38, "{name}");
        assert_eq!(triangles(&surface), triangles(&reference), "{name}");
        assert!(surface.warnings.is_empty(), "{name}: {:?}", surface.warnings);
    }
}

/// The triangles of physical groups serve as a surface; the points inside the body are no part of it.
#[test]
fn a_volume_file_gives_its_triangles() {
    let surface = read_surface(&sample("bar_v41_ascii.msh")).unwrap();
    assert!(surface.vertices.iter().all(|v| v.x == 0.0 || v.x == 4.0));
    assert!(surface.warnings.iter().any(|w| w.contains("belong to no triangle")), "{:?}", surface.warnings);
}
