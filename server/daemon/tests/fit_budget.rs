//! `palpated fit-budget` on a small block: what it chooses, what it writes, and what it refuses.
use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};
use tempfile::TempDir;

/// A block that leaves the spacing out, with comments that are to stay.
const SCENE: &str = r#"# A block on a table.
[scene]
name = "block"
[body.box]
size_mm = [40, 40, 20]
cells = [2, 2, 1]
[body.particles]
most_active = 60 # few
[[material]]
law = "stable-neo-hookean"
young_modulus_pa = 10e3
poisson_ratio = 0.3
density_kg_per_m3 = 1000
[[fixed]]
region = "z_min"
[[tool]]
name = "ball"
radius_mm = 8
coupling = "rigid"
driver = "device"
start_mm = [20, 20, 40]
"#;
/// A budget (µs) that everything fits, in an unoptimised build as well.
const AMPLE: &str = "1e9";

struct Ended {
    code: Option<i32>,
    shown: String,
    said: String,
    text: String,
}

fn file(text: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("block.toml");
    fs::write(&path, text).unwrap();
    (folder, path)
}

fn fit(path: &Path, more: &[&str]) -> Ended {
    let output = Command::new(env!("CARGO_BIN_EXE_palpated")).arg("fit-budget").arg(path).args(more).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    Ended {
        code: output.status.code(),
        shown: String::from_utf8(output.stdout).unwrap(),
        said: said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" "),
        text: fs::read_to_string(path).unwrap_or_default(),
    }
}

#[test]
fn the_spacing_follows_the_tool_and_is_all_that_changes() {
    let (_folder, path) = file(SCENE);
    let dry = fit(&path, &["--tick-us", AMPLE, "--dry-run"]);
    assert_eq!((dry.code, dry.text.as_str()), (Some(0), SCENE), "{}", dry.said);
    assert!(dry.shown.contains("chosen     spacing_mm = 4, most_active = 60: "), "{}", dry.shown);
    let written = fit(&path, &["--tick-us", AMPLE]);
    assert_eq!(written.code, Some(0), "{}", written.said);
    assert_eq!(written.text, SCENE.replace("= 60 # few\n", "= 60 # few\nspacing_mm = 4\n"));
    // Forces with few awake are compared with all awake: something is told, and not nothing.
    let row = written
        .shown
        .lines()
        .find(|line| line.trim_start().starts_with("24 "))
        .unwrap_or_else(|| panic!("{}", written.shown));
    let off: f64 = row.split_whitespace().rev().nth(1).unwrap().parse().unwrap();
    assert!(off > 1.0 && off < 5.0, "{row}");
    // What was chosen is served as it is.
    let check = Command::new(env!("CARGO_BIN_EXE_palpated")).arg("check").arg(&path).output().unwrap();
    assert!(check.status.success(), "{}", String::from_utf8_lossy(&check.stderr));
    // Nothing is left to be chosen now.
    let nothing = fit(&path, &["--tick-us", AMPLE]);
    assert_eq!((nothing.code, nothing.text), (Some(1), written.text), "{}", nothing.said);
    assert!(
        nothing.said.contains("leaves nothing to be chosen") && nothing.said.contains("--again"),
        "{}",
        nothing.said
    );
}

#[test]
fn the_most_awake_are_chosen_that_fit() {
    let (_folder, path) = file(&SCENE.replace("most_active = 60 # few", "spacing_mm = 4"));
    let ended = fit(&path, &["--tick-us", AMPLE]);
    assert_eq!(ended.code, Some(0), "{}", ended.said);
    assert!(ended.text.contains("spacing_mm = 4\nmost_active = 1600\n"), "{}", ended.text);
}

#[test]
fn what_cannot_be_chosen_is_told_and_nothing_is_written() {
    let refused = |text: &str, more: &[&str], words: &str| {
        let (_folder, path) = file(text);
        let ended = fit(&path, more);
        assert_eq!((ended.code, ended.text.as_str()), (Some(1), text), "{}", ended.said);
        assert!(ended.said.contains(words), "{}", ended.said);
    };
    refused(SCENE, &["--tick-us", "0.001"], "no numbers were found whose ticks take 0.001 us: the least was ");
    let without_particles = SCENE.replace("[body.particles]\nmost_active = 60 # few\n", "");
    refused(&without_particles, &[], "has no [body.particles]");
    let without_tool = SCENE.split_once("[[tool]]").unwrap().0;
    refused(without_tool, &[], "has no [[tool]] with a radius_mm or radius_m");
    refused(&SCENE.replace("poisson_ratio = 0.3", "poisson_ratio = 0.7"), &[], "poisson_ratio");
    refused(&SCENE.replace("= 60", "= -60"), &[], "most_active is there, and is not a number that can be used");
    let twice = SCENE.replace("most_active = 60", "spacing_m = 0.004\nspacing_mm = 4");
    refused(&twice, &[], "spacing_m");
    refused(&SCENE.replace("[scene]", "[scene"), &[], "is not TOML");
    let missing = fit(Path::new("no/such/scene.toml"), &[]);
    assert!(missing.code == Some(1) && missing.said.contains("cannot read no/such/scene.toml"), "{}", missing.said);
    // Half the radius of a needle would be a lattice of millions of particles.
    refused(&SCENE.replace("radius_mm = 8", "radius_mm = 0.2"), &[], "particles; at most 5e5 are allowed here");
    let built_in = fit(Path::new("heart"), &[]);
    assert!(built_in.said.contains("\"heart\" is built in: there is no file to write into"), "{}", built_in.said);
    let zero = fit(Path::new("heart"), &["--tick-us", "0"]);
    assert_eq!(zero.code, Some(2), "{}", zero.said);
}

/// A count of tets that the body cannot be made of, since more coarse nodes than particles would be asked for, ends the search and not the
/// command.
#[test]
fn counts_of_tets_that_cannot_be_built_end_the_search() {
    let (before, after) = SCENE.split_once("[body.box]\nsize_mm = [40, 40, 20]\ncells = [2, 2, 1]\n").unwrap();
    let scene = format!("{before}[body.ventricle]\n{after}").replace("z_min", "base");
    let (_folder, path) = file(&scene.replace("most_active = 60 # few", "spacing_mm = 1.5\nmost_active = 60"));
    let ended = fit(&path, &["--tick-us", AMPLE]);
    assert_eq!(ended.code, Some(0), "{}", ended.said);
    let chosen: Vec<&str> = ended.text.lines().filter(|line| line.starts_with("target_tets = ")).collect();
    assert_eq!(chosen.len(), 1, "{}", ended.text);
    // Of six counts that are tried, some cannot be built, and one at least can.
    let rows = ended.shown.lines().filter(|line| line.contains(" % ") && line.ends_with('%')).count();
    assert!((1..6).contains(&rows), "{}", ended.shown);
}
