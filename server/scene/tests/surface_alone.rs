//! `[body.surface]`: loose triangles gave a fiftieth of the force and a surface that was inside out none, without a
//! word. Both are mended and told, and what is sound is left as it is.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use glam::DVec3;
use palpate_physics::mesh::Triangulation;
use palpate_scene::{Limits, SceneError, load_file};
use std::{fmt::Write, fs};

/// An octahedron of 20 mm, each face cut in four: 18 vertices, 32 triangles.
fn octahedron() -> Vec<[DVec3; 3]> {
    let tip = |axis: DVec3| axis * 20.0;
    let mut faces = Vec::new();
    for x in [1.0, -1.0] {
        for y in [1.0, -1.0] {
            for z in [1.0, -1.0] {
                let face = [tip(DVec3::X * x), tip(DVec3::Y * y), tip(DVec3::Z * z)];
                faces.push(if x * y * z > 0.0 { face } else { [face[1], face[0], face[2]] });
            }
        }
    }
    let quarter = |[a, b, c]: [DVec3; 3]| {
        let [ab, bc, ca] = [(a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0];
        [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    };
    faces.into_iter().flat_map(quarter).collect()
}

/// The surface of these triangles and what was said, from an OBJ in which every triangle has its own vertices, moved by
/// `moved`, or in which they are shared.
fn loaded(
    triangles: &[[DVec3; 3]],
    shared: bool,
    moved: impl Fn(usize) -> DVec3,
) -> Result<(Triangulation, Vec<String>), SceneError> {
    let (mut vertices, mut faces): (Vec<DVec3>, String) = (Vec::new(), String::new());
    for triangle in triangles {
        faces += "f";
        for &corner in triangle {
            let known = vertices.iter().position(|vertex| shared && *vertex == corner);
            let number = known.unwrap_or_else(|| {
                vertices.push(corner + moved(vertices.len()));
                vertices.len() - 1
            });
            write!(faces, " {}", number + 1).unwrap();
        }
        faces += "\n";
    }
    let mut text = String::new();
    for vertex in vertices {
        writeln!(text, "v {} {} {}", vertex.x, vertex.y, vertex.z).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.obj"), text + &faces).unwrap();
    let scene = "[scene]\nname = \"t\"\n[body.surface]\nfile = \"s.obj\"\nunit = \"mm\"\n\
                 [body.springs]\nmesh_n_per_m = 60\nanchor_n_per_m = 12\nvertex_mass_kg = 2e-4\n\
                 [[tool]]\nname = \"t\"\nradius_mm = 5\ncoupling = \"rigid\"\ndriver = \"script\"\n\
                 keyframe = [{ time_s = 0, position_mm = [0, 0, 40] }]\n";
    let path = folder.path().join("t.toml");
    fs::write(&path, scene).unwrap();
    let scene = load_file(&path, &Limits::local(), &mut |_, _| {})?;
    let surface = scene.model.body.as_mass_spring().unwrap().springs.surface.clone();
    Ok((surface, scene.warnings))
}

fn enclosed_m3(surface: &Triangulation) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|v| surface.positions_m()[v as usize]);
    surface.triangles().iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

#[test]
fn a_sound_surface_is_taken_without_a_word() {
    let (surface, told) = loaded(&octahedron(), true, |_| DVec3::ZERO).unwrap();
    assert_eq!((surface.positions_m().len(), surface.triangles().len()), (18, 32));
    assert!(enclosed_m3(&surface) > 0.0);
    assert_eq!(told, Vec::<String>::new());
}

#[test]
fn loose_triangles_are_welded_and_told() {
    // Corners apart by nothing, and by up to a thousandth of an edge.
    let rounded = |n: usize| DVec3::new((n * 7 % 11) as f64, (n * 5 % 13) as f64, (n * 3 % 17) as f64) * 5e-4;
    for moved in [&(|_| DVec3::ZERO) as &dyn Fn(usize) -> DVec3, &rounded] {
        let (surface, told) = loaded(&octahedron(), false, moved).unwrap();
        assert_eq!((surface.positions_m().len(), surface.triangles().len(), surface.edges().len()), (18, 32, 48));
        assert!(surface.edges().iter().all(|edge| !edge.is_boundary()));
        assert_eq!(told.len(), 1, "{told:?}");
        println!("{}", told[0]);
        let wanted = ["body.surface.file = \"s.obj\": 78 points welded", "triangles were loose"];
        assert!(wanted.iter().all(|part| told[0].contains(part)), "{told:?}");
    }
}

#[test]
fn what_is_inside_out_is_turned_and_told() {
    let turned: Vec<[DVec3; 3]> = octahedron().into_iter().map(|[a, b, c]| [a, c, b]).collect();
    let (surface, told) = loaded(&turned, true, |_| DVec3::ZERO).unwrap();
    assert!(enclosed_m3(&surface) > 0.0);
    println!("{told:?}");
    assert!(told[0].contains("32 triangles of 32 turned: the closed surface was inside out") && told.len() == 1);
    // A single one, against its neighbours.
    let mut one = octahedron();
    one[5].swap(0, 1);
    let (surface, told) = loaded(&one, true, |_| DVec3::ZERO).unwrap();
    assert!(enclosed_m3(&surface) > 0.0);
    assert!(told[0].contains("1 triangle of 32 turned: their corners went round the other way"), "{told:?}");
    // An open surface has no inside: it is felt on the side that it shows.
    let cap: Vec<[DVec3; 3]> = turned.into_iter().filter(|t| t.iter().all(|p| p.z >= 0.0)).collect();
    let (surface, told) = loaded(&cap, true, |_| DVec3::ZERO).unwrap();
    assert!(told.is_empty() && enclosed_m3(&surface) < 0.0, "{told:?}");
}
