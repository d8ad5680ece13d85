//! `palpated static` of bodies with particles.
use serde_json::Value;
use std::{fs, path::Path, process::Command};

/// A sphere pressed 1 mm into a block that weighs, over a vertex of its skin.
const PRESSED: &str = r#"[scene]
name = "pressed"
[body]
offset_mm = [-20, -20, -20]
[body.box]
size_mm = [40, 40, 20]
cells = [2, 2, 1]
[body.particles]
spacing_mm = 2.5
most_active = 300
[[material]]
law = "stable-neo-hookean"
young_modulus_pa = 10e3
poisson_ratio = 0.45
density_kg_per_m3 = 1000
[[fixed]]
region = "z_min"
[[tool]]
name = "ball"
radius_mm = 6
coupling = "rigid"
friction_coefficient = 0
driver = "script"
keyframe = [{ time_s = 0, position_mm = [0.3, 0.2, 9] }, { time_s = 0.4, position_mm = [0.3, 0.2, 5] }]
[[probe]]
name = "force"
measure = "contact-force"
tool = "ball"
[[probe]]
name = "under"
measure = "displacement"
point_mm = [0, 0, -5]
[[probe]]
name = "table"
measure = "reaction"
region = "z_min"
[numerics]
precision = "double"
mass_damping_per_s = 40
[output]
duration_s = 2.5
"#;

/// What it prints on standard output and, in one line, on standard error.
fn palpated(arguments: &[&str]) -> (bool, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_palpated")).args(arguments).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    (output.status.success(), String::from_utf8(output.stdout).unwrap(), said)
}

fn json(command: &str, scene: &str) -> Value {
    let (success, shown, said) = palpated(&[command, scene, "--json"]);
    assert!(success, "{said}");
    serde_json::from_str(&shown).unwrap()
}

fn scene(folder: &Path, text: &str) -> String {
    let path = folder.join("pressed.toml");
    fs::write(&path, text).unwrap();
    path.to_str().unwrap().to_owned()
}

/// The loop damped for two seconds, the solver to 1e-10 of the forces: they are 1e-12 apart.
#[test]
fn static_and_simulate_agree_at_rest_with_the_same_particles_awake() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), &PRESSED.replace("[body]\n", "gravity_m_per_s2 = [0, 0, -9.81]\n[body]\n"));
    let (moved, still) = (json("simulate", &scene), json("static", &scene));
    assert_eq!(moved["body"]["particles"], still["body"]["particles"]);
    assert!(still["body"]["particles"]["active"].as_u64() > Some(100), "{}", still["body"]["particles"]);
    assert_eq!((&still["solve"]["stable"], &still["solve"]["spread_loads"]), (&Value::from(true), &Value::from(0)));
    for (probe, axis) in [("force", "z"), ("under", "z"), ("table", "z")] {
        let value = |run: &Value| run["probes"][probe]["values"][axis].as_f64().unwrap();
        let (a, b) = (value(&moved), value(&still));
        println!("{probe}: simulate {a}, static {b}, {:.1e}", (a - b) / b);
        assert!((a - b).abs() < 1e-9 * b.abs(), "{probe} {axis}: simulate {a}, static {b}");
    }
    // 40 × 40 × 20 mm of 1000 kg/m³, and what the ball gives.
    let of = |probe: &str| still["probes"][probe]["values"]["z"].as_f64().unwrap();
    assert!((of("table") - of("force") - 0.032 * 9.81).abs() < 1e-9, "{} {}", of("table"), of("force"));
    assert!(of("force") > 0.02);
}

#[test]
fn its_files_are_those_of_other_bodies_and_its_frame_is_the_skin() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path(), PRESSED);
    let out = folder.path().join("out");
    let (success, shown, said) = palpated(&["static", &scene, "--out", out.to_str().unwrap()]);
    assert!(success && shown.contains("in equilibrium") && shown.contains("of at most 300 awake"), "{shown} {said}");
    assert!(shown.contains("stable"), "{shown}");
    let summary: Value = serde_json::from_str(&fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    assert_eq!((&summary["ended_by"], &summary["frames"]), (&Value::from("equilibrium"), &Value::from(1)));
    assert!(fs::read_to_string(out.join("probes.csv")).unwrap().starts_with("time_s,force_x_n"));
    let frame = fs::read(out.join("frames/frame-000000.vtu")).unwrap();
    let triangles = summary["body"]["particles"]["skin_triangles"].as_u64().unwrap();
    assert!(String::from_utf8_lossy(&frame).contains(&format!("NumberOfCells=\"{triangles}\"")));
}

#[test]
fn a_load_that_is_spread_says_so_and_one_without_an_answer_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let tool = PRESSED.find("[[tool]]").unwrap();
    let untouched = PRESSED[..tool].to_owned();
    let load = "[[load]]\nregion = \"z_max\"\ntraction_pa = [0, 0, -200]\namplitude.smooth_step.duration_s = 0.1\n";
    let (success, shown, said) = palpated(&["static", &scene(folder.path(), &format!("{untouched}{load}"))]);
    assert!(
        success && shown.contains("1 load on more of the skin") && shown.contains("0 of at most 300"),
        "{shown} {said}"
    );
    let held = "[[fixed]]\nregion = \"z_min\"\n";
    let free = format!("{}{load}", untouched.replace(held, ""));
    let (success, _, said) = palpated(&["static", &scene(folder.path(), &free)]);
    assert!(!success && said.contains("is free to") && said.contains("add a [[fixed]] region"), "{said}");
    let far = PRESSED.replace("position_mm = [0.3, 0.2, 5]", "position_mm = [0.3, 0.2, 1e6]");
    let (success, _, said) = palpated(&["static", &scene(folder.path(), &far)]);
    assert!(!success && said.contains("let the tool start nearer"), "{said}");
}
