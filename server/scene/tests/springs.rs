//! Mass-spring surfaces in scenes: where the surface comes from, what its constants are, what regions choose, and what is refused.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use glam::DVec3;
use palpate_physics::{
    Model, Scratch, State, TickInput,
    bodies::mass_spring::{
        AnchorLaw, MassSpringSpec,
        constants_table::{Calibration, ConstantsTable},
    },
    contact::{ToolTarget, is_inside},
    step,
};
use palpate_scene::{Limits, Scene, SceneError, load_file, parse, to_calibrate};
use std::path::Path;

const BOX: &str = r#"[scene]
name = "t"
[body.box]
size_mm = [40, 40, 10]
cells = [8, 8, 2]
[body.springs]
part = "z_max"
mesh_n_per_m = 60
anchor_n_per_m = 12
vertex_mass_kg = 2e-4
damping_n_s_per_m = 0.01
[body.springs.refine]
rings = 2
constants = "area"
[[region]]
name = "rim"
select = { not = { box = { min_mm = [1, 1, 0], max_mm = [39, 39, 20] } } }
[[fixed]]
region = "rim"
[[probe]]
name = "middle"
measure = "displacement"
point_mm = [20, 20, 10]
[[probe]]
name = "holder"
measure = "reaction"
region = "rim"
"#;

fn scene(text: &str) -> Result<Scene, SceneError> {
    parse(text, "t.toml", None, &Limits::local(), &mut |_, _| {})
}

fn springs(text: &str) -> MassSpringSpec {
    let scene = scene(text).unwrap_or_else(|error| panic!("{}", error.one_line()));
    scene.model.body.as_mass_spring().unwrap().clone()
}

/// The message for the good scene with one thing replaced.
fn refused(from: &str, to: &str) -> String {
    assert!(BOX.contains(from), "{from}");
    scene(&BOX.replace(from, to)).unwrap_err().one_line()
}

#[test]
fn a_part_of_a_shape_becomes_the_surface() {
    let scene = scene(BOX).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    let springs = scene.model.body.as_mass_spring().unwrap();
    let surface = &springs.springs.surface;
    assert_eq!((surface.positions_m().len(), surface.triangles().len()), (81, 128));
    assert!(surface.positions_m().iter().all(|p| (p.z - 0.01).abs() < 1e-12));
    assert_eq!((scene.summary.nodes, scene.summary.tets, scene.summary.surface_triangles), (81, 0, 512));
    assert!((scene.summary.mass_kg - 81.0 * 2e-4).abs() < 1e-12);
    // K_d of a vertex is its mass times the damping.
    assert!((scene.model.settings.mass_damping_per_s - 50.0).abs() < 1e-9);
    let fine = springs.springs.fine;
    assert_eq!((fine.mesh_n_per_m, fine.anchor_n_per_m), (60.0, 3.0));
    let held: usize = scene.model.prescribed.iter().map(|set| set.nodes.len()).sum();
    assert_eq!(held, 32);
    let model = Model::build(scene.model).unwrap();
    assert!(model.body().as_mass_spring().unwrap().is_all_awake());
    assert_eq!(model.surface().triangles.len(), 512);
}

/// Six times the regions of all tools, of 6 n² triangles and of 4 n for each edge's length along a capsule; no more than there are.
#[test]
fn there_is_room_for_what_tools_refine() {
    let fine = BOX.replace("cells = [8, 8, 2]", "cells = [32, 32, 2]");
    let sphere = "[[tool]]\nname = \"ball\"\nradius_mm = 3\ncoupling = \"rigid\"\ndriver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [20, 20, 30] }]\n";
    let capsule = "[[tool]]\nname = \"shaft\"\nshape = \"capsule\"\nradius_mm = 3\nhalf_length_mm = 12\ncoupling = \"rigid\"\ndriver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [20, 20, 30] }]\n";
    let room = |text: &str| springs(text).springs.most_refined;
    // Edges of (2 + √2)/3 · 1.25 mm and a little less in the mean: 17 along 24 mm.
    let (about_ball, about_shaft) = (24, 24 + 8 * 17);
    assert_eq!(room(&fine), 6 * about_ball);
    assert_eq!(room(&format!("{fine}{sphere}{capsule}")), 6 * (about_ball + about_shaft));
    assert_eq!(room(&format!("{BOX}{sphere}{capsule}")), 128);
    let long = capsule.replace("half_length_mm = 12", "half_length_mm = 4000");
    let all = BOX.replace("constants = \"area\"", "constants = \"area\"\nmost_triangles = 128");
    assert_eq!([room(&format!("{BOX}{long}")), room(&format!("{all}{long}"))], [128, 128]);
    let asked = |most: usize| {
        let text = fine.replace("constants = \"area\"", &format!("constants = \"area\"\nmost_triangles = {most}"));
        scene(&format!("{text}{sphere}{capsule}"))
            .map(|scene| scene.model.body.as_mass_spring().unwrap().springs.most_refined)
    };
    assert_eq!(asked(about_shaft).unwrap(), about_shaft);
    let message = asked(about_shaft - 1).unwrap_err().one_line();
    assert!(message.contains("must hold the region of each tool, 160 triangles"), "{message}");
}

/// `K_m = (√3/2) E t`, `K_h` by the mean area of a vertex, masses by each one's own.
#[test]
fn constants_follow_from_a_skin_on_a_foundation() {
    let skin = "young_modulus_pa = 50e3\nthickness_mm = 1.5\nfoundation_pa_per_m = 2e6";
    let text = BOX
        .replace("mesh_n_per_m = 60\nanchor_n_per_m = 12", skin)
        .replace("vertex_mass_kg = 2e-4", "area_density_kg_per_m2 = 3");
    let springs = springs(&text).springs;
    assert!((springs.coarse.mesh_n_per_m - 0.75_f64.sqrt() * 75.0).abs() < 1e-9);
    assert!((springs.coarse.anchor_n_per_m - 2e6 * 1.6e-3 / 81.0).abs() < 1e-9);
    assert!((springs.mass_kg.iter().sum::<f64>() - 3.0 * 1.6e-3).abs() < 1e-12);
    assert!(springs.mass_kg.iter().any(|m| (m / springs.mass_kg[0] - 1.0).abs() > 0.5), "boundaries have less");
}

#[test]
fn anchor_springs_may_stiffen() {
    let cubic = springs(&BOX.replace("vertex_mass", "anchor_cubic_per_m2 = 1e5\nvertex_mass")).springs.anchor_law;
    assert_eq!(cubic, AnchorLaw::cubic(1e5).unwrap());
    let layers = "anchor_layer = [{ thickness_mm = 1, stiffness_ratio = 1 }, { thickness_mm = 5, stiffness_ratio = 4 }]\nvertex_mass";
    let layered = springs(&BOX.replace("vertex_mass", layers)).springs.anchor_law;
    assert!((layered.at(3e-3).slope - 4.0).abs() < 1e-12);
}

/// Keys that were renamed are still read by their first names, and refused where both are given.
#[test]
fn first_names_of_keys_give_the_same_model() {
    let own = BOX.replace("constants = \"area\"", "mesh_n_per_m = 40\nanchor_n_per_m = 4\nblend_s = 0.05");
    let layer = "anchor_layer = [{ thickness_mm = 1, stiffness_ratio = 2 }]\nvertex_mass";
    for text in
        [own.replace("vertex_mass", "anchor_cubic_per_m2 = 1e5\nvertex_mass"), own.replace("vertex_mass", layer)]
    {
        let first = text.replace("anchor_", "home_").replace("blend_s", "fade_s");
        assert!(!first.contains("anchor") && first.contains("home_n_per_m = 4\nfade_s"), "{first}");
        assert_eq!(springs(&first), springs(&text));
    }
    let both = [
        ("anchor_n_per_m = 12", "anchor_n_per_m = 12\nhome_n_per_m = 12", "anchor_n_per_m"),
        ("rings = 2", "rings = 2\nblend_s = 0.1\nfade_s = 0.1", "blend_s"),
    ];
    for (from, to, key) in both {
        let message = refused(from, to);
        assert!(message.contains(&format!("`{key}` is given twice, once by an earlier name of the key")), "{message}");
        println!("{message}");
    }
}

#[test]
fn bad_springs_are_told_with_their_key() {
    let cases = [
        (
            "anchor_n_per_m = 12",
            "anchor_n_per_m = 0",
            "body.springs.anchor_n_per_m = 0: must be finite and larger than 0",
        ),
        ("mesh_n_per_m = 60", "mesh_n_per_m = -1", "body.springs.mesh_n_per_m = -1"),
        ("mesh_n_per_m = 60\n", "", "lacks the key `mesh_n_per_m`, which goes with `anchor_n_per_m`"),
        ("mesh_n_per_m = 60", "mesh_n_per_m = 60\nyoung_modulus_pa = 1e4", "exactly one of"),
        ("vertex_mass_kg = 2e-4", "vertex_mass_kg = 0", "body.springs.vertex_mass_kg = 0"),
        ("vertex_mass_kg = 2e-4\n", "", "exactly one of `area_density_kg_per_m2`, `vertex_mass_kg`"),
        ("part = \"z_max\"", "part = \"z_mix\"", "the body has no part \"z_mix\""),
        ("rings = 2", "rings = 0", "body.springs.refine.rings = 0: must be 1 to 16"),
        ("constants = \"area\"", "mesh_n_per_m = 3", "which go together"),
        (
            "constants = \"area\"",
            "constants = \"area\"\nmost_triangles = 5",
            "must hold the region of each tool, 24 triangles",
        ),
        ("damping_n_s_per_m = 0.01", "damping_n_s_per_m = -1", "must be finite and not negative"),
        ("constants = \"area\"", "constants = \"area\"\nblend_s = 0", "blend_s = 0"),
        ("vertex_mass_kg", "anchor_cubic_per_m2 = -1\nvertex_mass_kg", "per_m2 = -1"),
        (
            "[[probe]]\nname = \"middle\"",
            "[numerics]\nmass_damping_per_s = 5\n[[probe]]\nname = \"middle\"",
            "two ways",
        ),
        ("[[fixed]]\nregion = \"rim\"", "[[fixed]]\nregion = \"rim\"\naxes = \"z\"", ""),
        ("[body.springs]", "[body.particles]\nspacing_mm = 2\n[body.springs]", "not both"),
        (
            "[[region]]",
            "[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n[[region]]",
            "a body of springs has no material",
        ),
    ];
    for (from, to, expected) in cases {
        if expected.is_empty() {
            let scene = scene(&BOX.replace(from, to)).unwrap();
            assert!(Model::build(scene.model).unwrap_err().to_string().contains("held along some axes"));
        } else {
            let message = refused(from, to);
            assert!(message.contains(expected), "{to}: {message}");
            assert!(message.starts_with("t.toml:"), "{message}");
        }
    }
}

/// A dome as an STL, a surface that is open.
fn write_stl(path: &Path, extra: &str) {
    let side = 6;
    let at = |i: i32, j: i32| {
        let [x, y] = [i, j].map(|n| f64::from(n) * 5.0 - 15.0);
        format!("vertex {x} {y} {}\n", 10.0 - 0.02 * (x * x + y * y))
    };
    let mut text = "solid dome\n".to_owned();
    for i in 0..side {
        for j in 0..side {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            for corners in [[&a, &b, &c], [&a, &c, &d]] {
                let corners = corners.map(String::as_str).concat();
                text.extend(["facet normal 0 0 1\nouter loop\n", &corners, "endloop\nendfacet\n"]);
            }
        }
    }
    std::fs::write(path, text + extra + "endsolid dome\n").unwrap();
}

const FILE: &str = r#"[scene]
name = "t"
[body]
offset_mm = [0, 0, 100]
[body.surface]
file = "dome.stl"
unit = "mm"
[body.springs]
mesh_n_per_m = 60
anchor_n_per_m = 12
vertex_mass_kg = 2e-4
[body.springs.refine]
rings = 1
table_file = "table.json"
"#;

#[test]
fn a_file_and_its_table() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dome.toml");
    write_stl(&folder.path().join("dome.stl"), "");
    std::fs::write(&path, FILE).unwrap();
    let load = || load_file(&path, &Limits::local(), &mut |_, _| {});
    let missing = load().unwrap_err();
    assert!(missing.one_line().contains("table.json") && missing.advice().unwrap().contains("palpated calibrate"));

    let wanted = to_calibrate(&path, &Limits::local()).unwrap();
    assert_eq!((wanted.rings, wanted.table.clone()), (1, folder.path().join("table.json")));
    assert!(wanted.surface.positions_m().iter().all(|p| p.z > 0.09));
    let of = Calibration { coarse: wanted.coarse, rings: 1, ratio: 5.0, samples: 2 };
    let table = ConstantsTable::calibrate(&wanted.surface, of, &mut |_| ()).unwrap();
    std::fs::write(&wanted.table, serde_json::to_string(&table).unwrap()).unwrap();
    let springs = load().unwrap().model.body.as_mass_spring().unwrap().clone();
    assert_eq!(springs.table.as_ref(), Some(&table));
    assert_eq!(springs.springs.surface.positions_m().len(), 49);
    // A table that was written when its fields had their first names.
    let text = serde_json::to_string(&table).unwrap();
    let first = text.replace("anchor_n_per_m", "home_n_per_m").replace("anchor_ratio", "home_ratio");
    assert!(first.contains("home_n_per_m") && first.contains("home_ratio"), "{first}");
    std::fs::write(&wanted.table, first).unwrap();
    assert_eq!(load().unwrap().model.body.as_mass_spring().unwrap().table.as_ref(), Some(&table));
    std::fs::write(&wanted.table, text).unwrap();

    std::fs::write(&path, FILE.replace("anchor_n_per_m = 12", "anchor_n_per_m = 13")).unwrap();
    assert!(load().unwrap_err().one_line().contains("the table was made for other spring constants"));
    std::fs::write(&path, FILE.replace("rings = 1", "rings = 2")).unwrap();
    assert!(load().unwrap_err().one_line().contains("another number of rings"));
    std::fs::write(&wanted.table, "{}").unwrap();
    std::fs::write(&path, FILE).unwrap();
    assert!(load().unwrap_err().one_line().contains("is no table of spring constants"));
    std::fs::write(&path, FILE.replace("table_file = \"table.json\"", "constants = \"unchanged\"")).unwrap();
    assert!(to_calibrate(&path, &Limits::local()).unwrap_err().one_line().contains("names no table"));
}

#[test]
fn what_is_no_surface_is_told_where() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("dome.toml");
    std::fs::write(&path, FILE.replace("table_file = \"table.json\"", "constants = \"unchanged\"")).unwrap();
    let load = || load_file(&path, &Limits::local(), &mut |_, _| {});
    write_stl(&folder.path().join("dome.stl"), "");
    assert!(load().is_ok());
    // A third triangle on an edge: not manifold.
    let fin = "facet normal 0 1 0\nouter loop\nvertex 0 0 10\nvertex 5 0 9.5\nvertex 2 3 30\nendloop\nendfacet\n";
    write_stl(&folder.path().join("dome.stl"), fin);
    let message = load().unwrap_err().one_line();
    assert!(message.contains("cannot be one of springs") && message.contains("3 triangles"), "{message}");
    let without = FILE.split("[body.springs]").next().unwrap();
    std::fs::write(&path, without).unwrap();
    assert!(load().unwrap_err().one_line().contains("no inside"));
}

#[test]
fn a_tool_that_slips_through_is_told() {
    let tool = |radius_mm: f64| {
        format!(
            "{BOX}[[tool]]\nname = \"tip\"\nradius_mm = {radius_mm}\ncoupling = \"rigid\"\ndriver = \"script\"\nkeyframe = [{{ time_s = 0, position_mm = [20, 20, 20] }}]\n"
        )
    };
    assert!(scene(&tool(3.0)).unwrap().warnings.is_empty());
    assert!(scene(&tool(1.0)).unwrap().warnings[0].contains("slips through"));
}

/// The hollow surface of a pan 12 mm thick, and a fingertip that an arm presses through it, drags to one side and takes away. Pressed by
/// the upper wall alone, the upper wall passed the lower one, and the fingertip was held by that from outside for ever.
#[test]
fn a_fingertip_that_pressed_one_wall_beyond_another_comes_free() {
    let text = "[scene]\nname = \"pan\"\n[body.ellipsoid_shell]\ninner_semi_axes_mm = [28, 28, 4]\nouter_semi_axes_mm = [30, 30, 6]\n\
                target_tets = 4000\n[body.springs]\npart = \"outer\"\nmesh_n_per_m = 60\nanchor_n_per_m = 12\n\
                area_density_kg_per_m2 = 15\ndamping_n_s_per_m = 0.02\n[[tool]]\nname = \"fingertip\"\nradius_mm = 5\n\
                coupling = \"spring\"\nstiffness_n_per_m = 1000\ndamping_n_s_per_m = 1\nmass_kg = 0.05\nfriction_coefficient = 0.2\n\
                driver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [0, 0, 15] }]\n";
    for (aside_mm, deep_mm) in [(15.0, 12.0), (22.0, 10.0), (0.0, 14.0)] {
        let model = Model::build(scene(text).unwrap().model).unwrap();
        let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
        let corners_mm = [[0.0, 15.0], [0.0, -deep_mm], [aside_mm, -deep_mm], [aside_mm, 40.0], [aside_mm, 40.0]];
        let triangles = &model.surface().triangles;
        let (mut surface_m, mut deepest_m) = (Vec::new(), f64::INFINITY);
        for (tick, part) in (0..1200).map(|tick| (tick, f64::from(tick % 300) / 300.0)) {
            let [[x, z], [to_x, to_z]] = [0, 1].map(|next| corners_mm[tick as usize / 300 + next]);
            let at_mm = DVec3::new(x + (to_x - x) * part, 0.0, z + (to_z - z) * part);
            let input = TickInput {
                tools: &[ToolTarget::at(at_mm * 1e-3)],
                load_factors: &[],
                prescribed_displacements_m: &[],
                point_forces: &[],
            };
            assert!(
                step(&model, &mut state, &mut scratch, &input).quarantined.is_none(),
                "{aside_mm}, {deep_mm}: {tick}"
            );
            let centre_m = state.mechanical.tools[0].centre_m;
            deepest_m = deepest_m.min(centre_m.z);
            if tick % 20 == 0 {
                model.surface_positions_m(&state, &mut surface_m);
                assert!(!is_inside(centre_m, triangles, &surface_m), "{aside_mm}, {deep_mm}: {tick}");
            }
        }
        let tool = &state.mechanical.tools[0];
        let left_mm = tool.centre_m.distance(DVec3::new(aside_mm, 0.0, 40.0) * 1e-3) * 1e3;
        assert!(left_mm < 1.0 && tool.contact_force_n == DVec3::ZERO, "{aside_mm}, {deep_mm}: {left_mm} mm, {tool:?}");
        assert!(deepest_m < 0.0, "{aside_mm}, {deep_mm}: {deepest_m}");
    }
}

/// Tools and probes see the surface refined everywhere, moved with the body.
#[test]
fn probes_follow_the_surface() {
    let text =
        BOX.replace("[body.box]", "[body]\noffset_mm = [0, 0, -10]\n[body.box]").replace("20, 20, 10]", "20, 20, 0]");
    let text = text.replace("min_mm = [1, 1, 0]", "min_mm = [1, 1, -10]");
    let scene = scene(&text).unwrap();
    let probe = scene.probes[0].clone();
    let model = Model::build(scene.model).unwrap();
    let mut state = State::at_rest(&model);
    let middle = (0..81).find(|&v| model.rest_positions_m()[v].distance(DVec3::new(0.02, 0.02, 0.0)) < 1e-9).unwrap();
    state.mechanical.x[middle].z -= 1e-3;
    let mut row = [0.0; 3];
    probe.evaluate_with(&model, &state, &[], &mut row);
    assert!((row[2] + 1e-3).abs() < 1e-12, "{row:?}");
}
