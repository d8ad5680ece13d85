//! What regions select: physical groups by dimension, and combinations that leave no hole and no overlap.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_physics::LoadSpec;
use palpate_scene::{Limits, Scene, SceneError, parse};
use std::{collections::BTreeSet, path::Path};

const MATERIAL: &str = "[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\n\
                        density_kg_per_m3 = 1000\n";

fn load(body: &str, rest: &str) -> Result<Scene, SceneError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files");
    parse(
        &format!("[scene]\nname = \"t\"\n{body}\n{MATERIAL}{rest}"),
        "t.toml",
        Some(&folder),
        &Limits::local(),
        &mut |_, _| {},
    )
}

/// The bar of two boxes, 4 x 1 x 1 mm; volumes `1` and `right` (2), surfaces `1` (x = 0) and `3` (x = 4).
fn bar(file: &str, rest: &str) -> Result<Scene, SceneError> {
    load(&format!("[body.mesh]\nfile = \"{file}\"\nunit = \"mm\"\n"), rest)
}

fn block(rest: &str) -> Scene {
    load("[body.box]\nsize_mm = [10, 10, 10]\ncells = [3, 4, 5]\n", rest).unwrap()
}

/// A pressure on each of the selections.
fn pressed(selectors: &[&str]) -> String {
    let one = |(index, selector): (usize, &&str)| {
        format!(
            "[[region]]\nname = \"r{index}\"\nselect = {selector}\n[[load]]\nregion = \"r{index}\"\npressure_pa = 1\n\
             follower = false\namplitude.constant = 1\n"
        )
    };
    selectors.iter().enumerate().map(one).collect()
}

/// Triangles of every pressure.
fn triangles(scene: &Scene) -> Vec<BTreeSet<u32>> {
    let of = |load: &LoadSpec| match load {
        LoadSpec::Pressure { triangles, .. } => triangles.iter().copied().collect(),
        other => panic!("{other:?}"),
    };
    scene.model.loads.iter().map(of).collect()
}

fn part<'s>(scene: &'s Scene, name: &str) -> &'s palpate_scene::PartSummary {
    scene.summary.parts.iter().find(|part| part.name == name).unwrap()
}

const UNNAMED: [&str; 2] = ["bar_unnamed_v22_ascii.msh", "bar_unnamed_v41_ascii.msh"];

/// Gmsh numbers groups by dimension. Volume 1 and surface 1 were one region, and a load on the surface pressed the
/// whole left half.
#[test]
fn volume_1_and_surface_1_are_two_regions() {
    for file in UNNAMED {
        let rest = "[[fixed]]\nregion = \"surface 1\"\n[[region]]\nname = \"left\"\nselect.physical_group = \"volume 1\"\n\
                    [[region]]\nname = \"tip\"\nselect.physical_group = \"3\"\n";
        let scene = bar(file, rest).unwrap();
        let (mesh, held) = (&scene.model.body.solid().unwrap().mesh, &scene.model.prescribed[0].nodes);
        assert!(!held.is_empty() && held.iter().all(|&node| mesh.positions_m()[node as usize].x == 0.0), "{file}");
        let (volume, surface) = (part(&scene, "volume 1"), part(&scene, "surface 1"));
        assert!(volume.tets > 0 && volume.nodes > surface.nodes, "{file}");
        assert_eq!((surface.tets, surface.nodes), (0, held.len()), "{file}");
        assert_eq!(part(&scene, "left").tets, volume.tets, "{file}");
        assert_eq!(volume.tets + part(&scene, "right").tets, 91, "{file}");
        assert_eq!((part(&scene, "tip").tets, part(&scene, "3").tets), (0, 0), "{file}");
        assert!(part(&scene, "3").triangles > 0, "{file}");
    }
}

#[test]
fn a_number_that_means_two_groups_says_how_to_say_which() {
    for file in UNNAMED {
        let group = "[[region]]\nname = \"r\"\nselect.physical_group = \"1\"\n";
        for rest in ["[[fixed]]\nregion = \"1\"\n", group] {
            let text = bar(file, rest).unwrap_err().one_line();
            let says = text.starts_with("t.toml:1") && text.contains("\"1\" means 2 physical groups of the mesh");
            assert!(says && text.contains("write one of"), "{text}");
            assert!(text.contains("\"volume 1\"") && text.contains("\"surface 1\""), "{text}");
        }
    }
}

/// The boundary of a group of tets was made of the triangles whose corners belong to it, whichever tet they bound: at
/// the border a triangle belonged to both groups.
#[test]
fn groups_of_tets_share_out_the_surface() {
    let scene = bar(UNNAMED[0], &pressed(&["{ region = \"volume 1\" }", "{ region = \"right\" }"])).unwrap();
    partition(&scene);
    for (side, triangles) in [(0.0..2.0 + 1e-9, &triangles(&scene)[0]), (2.0 - 1e-9..4.0, &triangles(&scene)[1])] {
        let surface = palpate_physics::Surface::of(&scene.model.body.solid().unwrap().mesh).unwrap();
        for &triangle in triangles {
            let corners = surface.triangle_nodes(triangle as usize);
            let x_mm = corners.map(|node| scene.model.body.solid().unwrap().mesh.positions_m()[node as usize].x * 1e3);
            assert!(x_mm.iter().all(|x| (side.start - 1e-9..side.end + 1e-9).contains(x)), "{x_mm:?}");
        }
    }
}

/// All triangles are in exactly one of the loads.
fn partition(scene: &Scene) {
    let sets = triangles(scene);
    let union: BTreeSet<u32> = sets.iter().flatten().copied().collect();
    assert_eq!(union.len(), scene.summary.surface_triangles, "holes");
    assert_eq!(sets.iter().map(BTreeSet::len).sum::<usize>(), union.len(), "overlaps");
}

#[test]
fn a_selection_and_its_complement_cover_every_triangle_once() {
    let near = "half_space = { point_mm = [4, 4, 4], normal = [1, 2, 3] }";
    let ball = "sphere = { centre_mm = [0, 0, 0], radius_mm = 9 }";
    let corner = "box = { min_mm = [-1, -1, -1], max_mm = [4, 7, 5] }";
    let face = "plane = { point_mm = [0, 0, 10], normal = [0, 0, 1] }";
    let nearest = "nearest = { point_mm = [0, 0, 0], count = 7 }";
    let both = format!("all_of = [{{ {near} }}, {{ {ball} }}]");
    let either = format!("any_of = [{{ {corner} }}, {{ region = \"x_max\" }}, {{ {ball} }}]");
    for selector in [near, ball, corner, face, nearest, "region = \"y_min\"", &both, &either] {
        let scene = block(&pressed(&[&format!("{{ {selector} }}"), &format!("{{ not = {{ {selector} }} }}")]));
        partition(&scene);
        assert!(triangles(&scene).iter().all(|set| !set.is_empty()), "{selector}");
    }
}

/// Triangles were selected by all three corners: those across the border of two boxes that cover the body together were
/// in neither, and a pressure on both left a seam.
#[test]
fn selections_that_cover_the_body_together_leave_no_seam() {
    let low = "{ box = { min_mm = [0, 0, 0], max_mm = [10, 10, 4.5] } }";
    let high = "{ box = { min_mm = [0, 0, 4.5], max_mm = [10, 10, 10] } }";
    partition(&block(&pressed(&[low, high])));
    let union = block(&pressed(&[&format!("{{ any_of = [{low}, {high}] }}")]));
    partition(&union);
}

#[test]
fn a_plane_selects_the_triangles_that_lie_in_it() {
    // At a third of a cell: the centroids of many triangles are in this plane, and no triangle is.
    let crossing = "{ plane = { point_mm = [0, 0, 0.6666666666666666], normal = [0, 0, 1] } }";
    let rest = format!("[[region]]\nname = \"none\"\nselect = {crossing}\n");
    let scene = load("[body.box]\nsize_mm = [10, 10, 10]\ncells = [5, 5, 5]\n", &rest);
    assert!(scene.is_err_and(|error| error.one_line().contains("selects nothing")));
    let top = block(&pressed(&["{ plane = { point_mm = [0, 0, 10], normal = [0, 0, -2] } }"]));
    assert_eq!(triangles(&top)[0].len(), 2 * 3 * 4);
}
