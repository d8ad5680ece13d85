//! Every scene we ship loads, builds, and says what its comments claim.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_physics::Model;
use palpate_scene::{Limits, Scene, builtin, builtin_names, load_builtin, load_file};
use std::path::PathBuf;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes")
}

fn examples() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    let mut scenes: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    scenes.sort();
    assert!(scenes.len() >= 6, "{scenes:?}");
    scenes
}

fn load(path: &std::path::Path) -> Scene {
    load_file(path, &Limits::local(), &mut |_, _| {}).unwrap_or_else(|error| panic!("{}", error.one_line()))
}

#[test]
fn every_example_loads_without_warnings_and_builds() {
    for path in examples() {
        let scene = load(&path);
        // A second arm is one that a scene cannot be without and has not.
        let waits: &[&str] = match scene.name.as_str() {
            "two-hands" => &["the tool \"shaft\" waits for an arm: offline it stays at its start"],
            _ => &[],
        };
        assert_eq!(scene.warnings, waits, "{}", path.display());
        assert_eq!(scene.name, path.file_stem().unwrap().to_str().unwrap());
        let model = Model::build(scene.model.clone()).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert!(model.substeps() <= 100, "{}: {} substeps", path.display(), model.substeps());
        assert_eq!(scene.timeline.loads.len(), model.loads().len());
        assert_eq!(scene.timeline.prescribed.len(), model.prescribed().len());
        assert_eq!(scene.drivers.len(), model.tools().len());
    }
}

#[test]
fn built_in_scenes_are_the_shipped_files_with_what_they_need() {
    assert_eq!(builtin_names().first(), Some(&"heart"));
    for name in builtin_names() {
        // A client may ask for each of them.
        let scene = load_builtin(name, &Limits::wire(), &mut |_, _| {}).unwrap().unwrap();
        assert_eq!(scene.name, *name);
        let file = folder().join(format!("{name}.toml"));
        assert_eq!(builtin(name), std::fs::read_to_string(&file).ok().as_deref());
        assert_eq!(format!("{:?}", scene.model), format!("{:?}", load(&file).model), "{name}");
    }
    assert!(builtin("nothing").is_none() && load_builtin("nothing", &Limits::wire(), &mut |_, _| {}).is_none());
}

#[test]
fn the_default_scene_is_pressed_by_the_simulated_arm_every_two_seconds() {
    let scene = load(&folder().join("heart.toml"));
    let arm = scene.arm.as_ref().unwrap();
    assert_eq!(arm.path.duration_s(), 2.0);
    assert_eq!(scene.model.tools[arm.tool].name, arm.tool_name);
    let outer = scene.summary.parts.iter().find(|part| part.name == "outer").unwrap();
    assert!(outer.triangles > 100 && outer.tets == 0);
    // Offline the hand stands in for the arm, and comes round.
    let (a, b) = (scene.offline_target(0, 0.25), scene.offline_target(0, 2.25));
    assert!((a.position_m - b.position_m).length() < 1e-12 && a.velocity_m_per_s.x < 0.0);
}

/// Turned over by the press on its edge, offline.
#[test]
fn the_capsule_is_turned_where_it_is_pressed_beside_its_middle() {
    use palpate_physics::{Scratch, State, TickInput, contact::ToolShape};
    let scene = load(&folder().join("capsule-press.toml"));
    let model = Model::build(scene.model.clone()).unwrap();
    assert!(matches!(model.tools()[0].shape, ToolShape::Capsule(_)));
    let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
    let mut torques_nm = Vec::new();
    for tick in 1..=2000_u32 {
        let tools = [scene.offline_target(0, f64::from(tick) * 1e-3)];
        let input = TickInput {
            tools: &tools,
            load_factors: &[],
            prescribed_displacements_m: &[glam::DVec3::ZERO],
            point_forces: &[],
        };
        palpate_physics::step(&model, &mut state, &mut scratch, &input);
        if tick % 1500 == 500 {
            torques_nm
                .push((state.mechanical.tools[0].contact_force_n.z, state.mechanical.tools[0].contact_torque_nm.y));
        }
    }
    let [(middle_n, middle_nm), (edge_n, edge_nm)] = torques_nm[..] else { panic!("{torques_nm:?}") };
    assert!(middle_n > 0.5 && middle_nm.abs() < 1e-3 * middle_n, "{middle_n} {middle_nm}");
    assert!(edge_n > 0.1 && edge_nm > 5e-3 * edge_n, "{edge_n} {edge_nm}");
}
