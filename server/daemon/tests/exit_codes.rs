//! What `simulate` and `static` end with when there is a result that is not to be trusted: elements that were turned
//! inside out, and equilibria that are none, ended with 0 and without a word.
use serde_json::Value;
use std::{fs, path::Path, process::Command};

/// A block on a table, pressed for 50 ms by a load on its top and then left alone.
fn pressed(law: &str, force_n: f64) -> String {
    format!(
        "[scene]\nname = \"pressed\"\n[body.box]\nsize_mm = [20, 20, 10]\ncells = [4, 4, 2]\n\
         [[material]]\nlaw = \"{law}\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.45\ndensity_kg_per_m3 = 1000\nviscosity_psi_pa_s = 0.3\n\
         [[fixed]]\nregion = \"z_min\"\n[[load]]\nregion = \"z_max\"\ntotal_force_n = [0, 0, -{force_n}]\n\
         amplitude = {{ pulse = {{ value = 1, start_s = 0.02, duration_s = 0.05, period_s = 100 }} }}\n\
         [numerics]\nmass_damping_per_s = 20\n[output]\nduration_s = 0.2\n"
    )
}

/// A block between two plates that come nearer by so much (mm), its faces free to slide along the lower one.
fn squeezed(by_mm: f64) -> String {
    format!(
        "[scene]\nname = \"squeezed\"\n[body.box]\nsize_mm = [20, 20, 10]\ncells = [4, 4, 4]\n\
         [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0\ndensity_kg_per_m3 = 1000\n\
         [[fixed]]\nregion = \"z_min\"\n[[prescribed]]\nregion = \"z_max\"\ndisplacement_mm = [0, 0, -{by_mm}]\n\
         amplitude.constant = 1\n[output]\nduration_s = 0.2\n"
    )
}

struct Ended {
    code: Option<i32>,
    shown: String,
    said: String,
}

/// Runs a scene; what it says on standard error is on one line.
fn run(command: &str, scene: &str, more: &[&str]) -> Ended {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    fs::write(&path, scene).unwrap();
    run_file(command, &path, more)
}

fn run_file(command: &str, path: &Path, more: &[&str]) -> Ended {
    let output = Command::new(env!("CARGO_BIN_EXE_palpated")).arg(command).arg(path).args(more).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    Ended { code: output.status.code(), shown: String::from_utf8(output.stdout).unwrap(), said }
}

#[test]
fn elements_inside_out_are_told_and_end_a_run_with_4() {
    let scene = pressed("stvk", 2.0);
    let ended = run("simulate", &scene, &[]);
    assert_eq!(ended.code, Some(4), "{} {}", ended.shown, ended.said);
    println!("{}", ended.said);
    for part in ["elements turned inside out: the least volume ratio was -", "mm at rest", "stable-neo-hookean"] {
        assert!(ended.said.contains(part), "{part}: {}", ended.said);
    }
    // The run went to its end, and its results are there.
    assert!(ended.shown.contains("ended by duration"), "{}", ended.shown);
    let summary: Value = serde_json::from_str(&run("simulate", &scene, &["--json"]).shown).unwrap();
    let lowest = &summary["lowest_volume_ratio"];
    assert!(lowest["value"].as_f64() < Some(0.0) && lowest["time_s"].as_f64() > Some(0.02), "{summary}");
    // A gentle press ends with 0, and tells its least ratio all the same.
    let gentle = run("simulate", &pressed("stvk", 0.2), &["--json"]);
    assert_eq!(gentle.code, Some(0), "{}", gentle.said);
    let summary: Value = serde_json::from_str(&gentle.shown).unwrap();
    let least = summary["lowest_volume_ratio"]["value"].as_f64().unwrap();
    assert!((0.5..0.99).contains(&least) && !gentle.said.contains("inside out"), "{least} {}", gentle.said);
}

/// Elements were looked for every ten ticks: of long ticks that was too seldom, and what a probe showed ended with 0.
#[test]
fn what_a_probe_tells_is_told_at_the_end_whatever_a_tick_lasts() {
    let laws = ["stable-neo-hookean", "stvk"];
    for (law, period_ms) in laws.iter().flat_map(|law| ["0.5", "1", "2", "4"].map(|period_ms| (law, period_ms))) {
        let scene = format!(
            "[scene]\nname = \"jab\"\ntick_period_s = {period_ms}e-3\n[body]\nelements = \"linear\"\noffset_mm = [-20, -20, -20]\n[body.box]\nsize_mm = [40, 40, 20]\ncells = [6, 6, 4]\n\
             [[material]]\nlaw = \"{law}\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.45\ndensity_kg_per_m3 = 1000\n\
             [[fixed]]\nregion = \"z_min\"\n[[tool]]\nname = \"finger\"\nradius_mm = 4\ncoupling = \"rigid\"\ndriver = \"script\"\n\
             keyframe = [{{ time_s = 0, position_mm = [0, 0, 5] }}, {{ time_s = 0.004, position_mm = [0, 0, -11] }},\n\
             {{ time_s = 0.008, position_mm = [0, 0, 5] }}]\n[[probe]]\nname = \"ratio\"\nmeasure = \"min-volume-ratio\"\n\
             [numerics]\nmass_damping_per_s = 20\n[output]\nduration_s = 0.04\n\
             sample_interval_s = {period_ms}e-3\n"
        );
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("out");
        let ended = run("simulate", &scene, &["--json", "--out", out.to_str().unwrap()]);
        let rows = fs::read_to_string(out.join("probes.csv")).unwrap_or_else(|error| panic!("{error}: {}", ended.said));
        let values = rows.lines().skip(1).map(|row| row.rsplit(',').next().unwrap().parse::<f64>().unwrap());
        let shown = values.fold(1.0, f64::min);
        let summary: Value = serde_json::from_str(&ended.shown).unwrap();
        let told = summary["lowest_volume_ratio"]["value"].as_f64().unwrap();
        assert!(told <= shown, "{law}, {period_ms} ms: {told} {shown}");
        assert!(told < 0.0 || *law != "stvk", "{period_ms} ms: {told}");
        assert_eq!(ended.code == Some(4), told <= 0.0, "{law}, {period_ms} ms: {told} {:?} {}", ended.code, ended.said);
    }
}

#[test]
fn a_quarantine_ends_a_run_with_3() {
    let step = "[numerics]\nsubsteps = 1\nsubcycle_unstable = false\n";
    let ended = run("simulate", &pressed("stvk", 0.2).replace("[numerics]\n", step).replace("10e3", "1e6"), &[]);
    assert_eq!(ended.code, Some(3), "{} {}", ended.shown, ended.said);
    assert!(
        ended.said.contains("the run stopped there") && ended.shown.contains("ended by quarantined"),
        "{}",
        ended.said
    );
}

/// StVK bears less the more it is pressed below 1/√3 of its length: one layer of elements then gives way to the others.
#[test]
fn an_equilibrium_that_is_not_stable_ends_with_5() {
    let ended = run("static", &squeezed(4.9), &[]);
    assert_eq!(ended.code, Some(5), "{} {}", ended.shown, ended.said);
    assert!(ended.said.contains("this equilibrium is not stable"), "{}", ended.said);
    assert!(ended.shown.contains("NOT in equilibrium: unstable"), "{}", ended.shown);
    let sound = run("static", &squeezed(2.0), &[]);
    assert_eq!((sound.code, sound.said.as_str()), (Some(0), ""), "{}", sound.shown);
    assert!(sound.shown.contains("in equilibrium") && !sound.shown.contains("NOT"), "{}", sound.shown);
}

/// With coarse nodes closer than particles `static` found an equilibrium of nothing, and `simulate` stopped at its
/// second tick.
#[test]
fn coarse_tets_too_small_for_the_particles_are_refused_before_any_tick() {
    let scene = "[scene]\nname = \"block\"\n[body]\n[body.box]\nsize_mm = [40, 40, 20]\ncells = [8, 8, 4]\n[body.particles]\nspacing_mm = 4\n\
                 [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n[[fixed]]\nregion = \"x_min\"\n";
    for command in ["check", "simulate", "static"] {
        let ended = run(command, scene, &[]);
        assert_eq!(ended.code, Some(1), "{command}: {}", ended.shown);
        assert!(ended.said.contains("the coarse tets are too small beside the particles"), "{command}: {}", ended.said);
        assert!(ended.said.contains("edges of at least 8.00 mm"), "{command}: {}", ended.said);
    }
}

/// Only `check` told what is wrong with a body's lattice; runs and equilibria did not.
#[test]
fn what_is_wrong_with_a_lattice_is_told_by_every_command() {
    let scene = "[scene]\nname = \"block\"\n[body]\n[body.box]\nsize_mm = [40, 40, 20]\ncells = [2, 2, 1]\n\
                 [body.particles]\nspacing_mm = 5\nmost_active = 60\nfine_depth_mm = 15\n\
                 [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n[[fixed]]\nregion = \"z_min\"\n\
                 [output]\nduration_s = 0.01\n";
    let warning = "fine depth in [body.particles]: no cell is of twice the spacing";
    assert!(run("check", scene, &[]).shown.contains(warning));
    for command in ["simulate", "static"] {
        let ended = run(command, scene, &["--json"]);
        assert!(ended.said.contains(warning), "{command}: {}", ended.said);
        let summary: Value = serde_json::from_str(&ended.shown).unwrap();
        assert!(summary["warnings"].to_string().contains(warning), "{command}: {summary}");
    }
}

/// Gravity a thousand times too strong crushed the body in the ticks that `check` ran to time them, of which it told the time alone.
#[test]
fn check_tells_of_elements_that_it_saw_inside_out() {
    let scene =
        pressed("stable-neo-hookean", 0.1).replace("[body.box]", "gravity_m_per_s2 = [0, 0, -9810]\n[body.box]");
    let ended = run("check", &scene, &[]);
    assert_eq!(ended.code, Some(0), "{} {}", ended.shown, ended.said);
    let told =
        "warning: elements turned inside out in the ticks that were run to time them: the least volume ratio was -";
    assert!(ended.shown.contains(told), "{}", ended.shown);
    assert_eq!(run("check", &scene, &["--strict"]).code, Some(1));
    assert_eq!(run("simulate", &scene, &[]).code, Some(4));
    assert!(!run("check", &pressed("stable-neo-hookean", 0.1), &[]).shown.contains("inside out"));
}

/// `check` refused the tool and sent to `check`, which had not told of the unit.
#[test]
fn check_tells_what_it_knows_of_a_body_that_is_refused() {
    let scene = pressed("stable-neo-hookean", 0.1).replace("size_mm", "size_m")
        + "[[tool]]\nname = \"tip\"\nradius_mm = 6\ncoupling = \"rigid\"\ndriver = \"script\"\n\
           keyframe = [{ time_s = 0, position_m = [0, 0, 20] }]\n";
    let ended = run("check", &scene, &[]);
    assert_eq!(ended.code, Some(1), "{} {}", ended.shown, ended.said);
    for part in ["body       shape box", "warning: the body is 20.0000 m long: if millimetres were meant"] {
        assert!(ended.shown.contains(part), "{part}: {}", ended.shown);
    }
    assert!(
        ended.said.contains("too small for the surface") && !ended.said.contains("palpated check"),
        "{}",
        ended.said
    );
    assert!(run("simulate", &scene, &[]).said.contains("`palpated check` shows what its body is like"));
}

/// Whatever asked for too many substeps, the body was blamed.
#[test]
fn what_asks_for_too_many_substeps_is_named() {
    let scene = pressed("stable-neo-hookean", 0.1);
    let tool = "[[tool]]\nname = \"tip\"\nradius_mm = 6\ncoupling = \"spring\"\nstiffness_n_per_m = 5000\ndamping_n_s_per_m = 1\n\
                mass_kg = 1e-14\ndriver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [0, 0, 20] }]\n";
    for (scene, by, advice) in [
        (scene.replace("10e3", "10e15"), "the body needs", "soften the material"),
        (scene.replace("psi_pa_s = 0.3", "psi_pa_s = 3e8"), "the viscosity of the body needs", "lower the viscosity"),
        (scene + tool, "a tool on its spring needs", "more mass_kg"),
    ] {
        let ended = run("check", &scene, &[]);
        assert_eq!(ended.code, Some(1), "{} {}", ended.shown, ended.said);
        assert!(ended.said.contains(by) && ended.said.contains(advice), "{}", ended.said);
    }
}

#[test]
fn check_tells_what_viscosity_costs() {
    let scene = pressed("stable-neo-hookean", 0.1);
    let viscous = scene.replace("psi_pa_s = 0.3", "psi_pa_s = 30");
    assert!(!run("check", &scene, &[]).shown.contains("viscosity)"));
    assert!(run("check", &viscous, &[]).shown.contains("times as many as without viscosity)"));
}
