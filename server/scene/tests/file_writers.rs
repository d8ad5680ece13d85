//! What is written reads back to the same bits.
#![allow(clippy::unwrap_used, clippy::expect_used)] // a test that cannot read its samples has failed
use glam::DVec3;
use palpate_scene::files::{
    Cells, Field, PvdIndex, UnusedNodes, Values, VtuFrame, encode_vtu, parse_surface, parse_volume, read_surface,
    read_volume, write_obj, write_ply, write_stl, write_vtu,
};
use proptest::prelude::*;
use std::path::Path;

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![-1e3..1e3f64, any::<f64>().prop_filter("finite", |x| x.is_finite())]
}

fn points() -> impl Strategy<Value = Vec<DVec3>> {
    prop::collection::vec([coordinate(), coordinate(), coordinate()].prop_map(DVec3::from_array), 4..40)
}

/// So many different indices below `points`.
fn corners<const N: usize>(points: usize) -> impl Strategy<Value = [u32; N]> {
    let all: Vec<u32> = (0..points as u32).collect();
    prop::sample::subsequence(all, N).prop_shuffle().prop_map(|chosen| std::array::from_fn(|i| chosen[i]))
}

fn mesh<const N: usize>() -> impl Strategy<Value = (Vec<DVec3>, Vec<[u32; N]>)> {
    points().prop_flat_map(|points| {
        let cells = prop::collection::vec(corners::<N>(points.len()), 1..60);
        (Just(points), cells)
    })
}

fn frame<'a>(points: &'a [DVec3], cells: Cells<'a>) -> VtuFrame<'a> {
    VtuFrame { points, cells, point_data: &[], cell_data: &[], time_s: None }
}

/// A surface with its unused vertices left out, as readers give it.
fn used(vertices: &[DVec3], triangles: &[[u32; 3]]) -> Vec<[[u64; 3]; 3]> {
    triangles.iter().map(|t| t.map(|v| vertices[v as usize].to_array().map(f64::to_bits))).collect()
}

proptest! {
    #[test]
    fn vtu_of_tets((points, tets) in mesh::<4>()) {
        let groups: Vec<u32> = (0..tets.len() as u32).map(|tet| 5 + tet % 3).collect();
        let heights: Vec<f64> = points.iter().map(|p| p.z).collect();
        let bytes = encode_vtu(&VtuFrame {
            point_data: &[
                Field { name: "height <&\"> m", values: Values::Scalars(&heights) },
                Field { name: "displacement_m", values: Values::Vectors(&points) },
            ],
            cell_data: &[Field { name: "region", values: Values::Integers(&groups) }],
            time_s: Some(0.25),
            ..frame(&points, Cells::Tets(&tets))
        }).unwrap();
        let volume = parse_volume(Path::new("a.vtu"), &bytes).unwrap();
        prop_assert_eq!(&volume.mesh_nodes, &points);
        // A tet over the same nodes as another is the same tet.
        let mut seen = std::collections::HashSet::new();
        let key = |tet: &[u32; 4]| { let mut k = *tet; k.sort_unstable(); k };
        let distinct: Vec<_> = tets.iter().zip(&groups).filter(|(tet, _)| seen.insert(key(tet))).collect();
        prop_assert_eq!(volume.tets.iter().collect::<Vec<_>>(), distinct.iter().map(|(tet, _)| *tet).collect::<Vec<_>>());
        for (tet, (_, group)) in distinct.iter().enumerate() {
            prop_assert_eq!(volume.groups[volume.tet_group[tet] as usize].tag, i64::from(**group));
        }
    }

    #[test]
    fn surfaces((points, triangles) in mesh::<3>()) {
        let folder = tempfile::tempdir().unwrap();
        let wanted = used(&points, &triangles);
        let bytes = encode_vtu(&frame(&points, Cells::Triangles(&triangles))).unwrap();
        let read = parse_surface(Path::new("a.vtu"), &bytes).unwrap();
        prop_assert_eq!(&used(&read.vertices, &read.triangles), &wanted);
        for name in ["a.obj", "a.ply"] {
            let path = folder.path().join(name);
            if name == "a.obj" { write_obj(&path, &points, &triangles) } else { write_ply(&path, &points, &triangles) }.unwrap();
            let read = read_surface(&path).unwrap();
            prop_assert_eq!(&used(&read.vertices, &read.triangles), &wanted);
        }
    }

    /// STL holds single precision, and a soup of points instead of vertices.
    #[test]
    fn stl((points, triangles) in mesh::<3>()) {
        let points: Vec<DVec3> = points.iter().map(|p| p.map(|x| f64::from(x as f32)).clamp(DVec3::splat(-1e30), DVec3::splat(1e30)).as_vec3().as_dvec3()).collect();
        let path = tempfile::tempdir().unwrap().keep().join("a.stl");
        write_stl(&path, &points, &triangles).unwrap();
        let joined = |x: f64| x + 0.0; // -0 is 0
        let positive = |vertices: &[DVec3]| vertices.iter().map(|v| v.map(joined)).collect::<Vec<_>>();
        let distinct: Vec<_> = triangles.iter().filter(|t| {
            let [a, b, c] = t.map(|v| points[v as usize].map(joined));
            a != b && b != c && c != a
        }).copied().collect();
        if let Ok(read) = read_surface(&path) {
            prop_assert_eq!(used(&positive(&read.vertices), &read.triangles), used(&positive(&points), &distinct));
        } else {
            prop_assert!(distinct.is_empty());
        }
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }
}

/// A frame of the sample mesh goes through a file to the same body.
#[test]
fn a_frame_is_a_mesh_again() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files/bar_v41_ascii.msh");
    let first = read_volume(&sample).unwrap().into_tet_mesh(1e-3, UnusedNodes::Drop).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame_0000.vtu");
    write_vtu(&path, &frame(first.mesh.positions_m(), Cells::Tets(first.mesh.tets()))).unwrap();
    let second = read_volume(&path).unwrap().into_tet_mesh(1.0, UnusedNodes::Refuse).unwrap();
    assert_eq!(first.mesh, second.mesh);
    let path = folder.path().join("run.pvd");
    let mut index = PvdIndex::create(&path).unwrap();
    let head = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
    let tail = "</Collection>\n</VTKFile>\n";
    let mut frames = String::new();
    // Whole at every moment: a run may end there.
    for (time_s, name) in [(0.0, "a&b.vtu"), (0.125, "frame_0001.vtu"), (10.0, "frame_0002.vtu")] {
        assert_eq!(std::fs::read_to_string(&path).unwrap(), [head, &frames, tail].concat());
        index.add(time_s, name).unwrap();
        let name = name.replace('&', "&amp;");
        let frame = format!("<DataSet timestep=\"{time_s}\" part=\"0\" file=\"{name}\"/>\n");
        frames.push_str(&frame);
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), [head, &frames, tail].concat());
}

#[test]
fn what_does_not_fit_is_refused() {
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let error = |frame: &VtuFrame| encode_vtu(frame).unwrap_err();
    assert!(error(&frame(&points, Cells::Triangles(&[[0, 1, 2], [0, 1, 3]]))).contains("cell 1 refers to a point"));
    let short = [Field { name: "force_n", values: Values::Scalars(&[1.0]) }];
    let misfit = VtuFrame { point_data: &short, ..frame(&points, Cells::Triangles(&[[0, 1, 2]])) };
    assert!(error(&misfit).contains("`force_n` has 1 values for 3 points"));
    let path = Path::new("no/such/folder/a.stl");
    assert!(write_stl(path, &points, &[[0, 1, 3]]).unwrap_err().to_string().contains("triangle 0"));
    assert!(write_stl(path, &points, &[[0, 1, 2]]).unwrap_err().to_string().contains("a.stl: cannot be written"));
}
