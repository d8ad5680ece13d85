//! What `palpated` says of limits before a hand feels them, and where a run has passed them.
use serde_json::Value;
use std::{fs, process::Command};

struct Ended {
    code: Option<i32>,
    shown: String,
    said: String,
}

/// Runs a command on a scene; what it says on standard error is on one line.
fn run(command: &str, scene: &str, more: &[&str]) -> Ended {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    fs::write(&path, scene).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_palpated")).arg(command).arg(&path).args(more).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    let said = said.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
    Ended { code: output.status.code(), shown: String::from_utf8(output.stdout).unwrap(), said }
}

fn json(ended: &Ended) -> Value {
    serde_json::from_str(&ended.shown).unwrap_or_else(|_| panic!("{} {}", ended.shown, ended.said))
}

/// A block of 80 × 80 × 40 mm on a table, `cells` along its length, with a sphere above it.
fn block(cells: u32, nu: f64, law: &str, tool: &str) -> String {
    format!(
        "[scene]\nname = \"block\"\n[body]\nelements = \"linear\"\n[body.box]\nsize_mm = [80, 80, 40]\ncells = [{cells}, {cells}, {}]\n\
         [[material]]\nlaw = \"{law}\"\nyoung_modulus_pa = 10e3\npoisson_ratio = {nu}\ndensity_kg_per_m3 = 1000\n\
         [[fixed]]\nregion = \"z_min\"\n{tool}[output]\nduration_s = 0.02\n",
        cells / 2
    )
}

const RIGID: &str = "[[tool]]\nname = \"ball\"\nradius_mm = 10\ncoupling = \"rigid\"\ndriver = \"script\"\n\
                     keyframe = [{ time_s = 0, position_mm = [40, 40, 60] }, { time_s = 1, position_mm = [40, 40, 59] }]\n";
const NEO_HOOKEAN: &str = "stable-neo-hookean";

#[test]
fn check_tells_how_tools_follow_their_devices() {
    let shown = run("check", &block(4, 0.3, NEO_HOOKEAN, RIGID), &[]).shown;
    let told = shown.split("rigid: it is where its driver says, up to ").nth(1).unwrap_or_else(|| panic!("{shown}"));
    let (speed, slips) = told.split_once(" m/s; it slips before it would go through a surface, at ").unwrap();
    let most_n: f64 = slips.split_whitespace().next().unwrap().parse().unwrap();
    assert!(speed.parse::<f64>().unwrap() <= 5.0 && most_n > 0.0, "{shown}");
    let spring = RIGID.replace(
        "coupling = \"rigid\"",
        "coupling = \"spring\"\nstiffness_n_per_m = 400\ndamping_n_s_per_m = 2\nmass_kg = 0.02",
    );
    let shown = run("check", &block(4, 0.3, NEO_HOOKEAN, &spring), &[]).shown;
    println!("{shown}");
    let number = |before: &str| -> f64 {
        let rest = shown.split(before).nth(1).unwrap_or_else(|| panic!("{before}: {shown}"));
        rest.split_whitespace().next().unwrap().parse().unwrap()
    };
    let (force_n, stretch_mm) = (number("gives at most "), number("from a stretch of "));
    // Two digits of each.
    assert!((force_n / 400.0 / (stretch_mm * 1e-3) - 1.0).abs() < 0.1, "{shown}");
    assert!(number("meets the surface at up to ") <= number("it follows at up to "), "{shown}");
    // A smaller tool is pressed with less.
    let smaller = spring.replace("radius_mm = 10", "radius_mm = 3");
    let small = run("check", &block(4, 0.3, NEO_HOOKEAN, &smaller), &[]).shown;
    let small_n: f64 =
        small.split("gives at most ").nth(1).unwrap().split_whitespace().next().unwrap().parse().unwrap();
    assert!(small_n < 0.5 * force_n, "{small_n} {force_n}");
}

/// At ν = 0.45 a block of 20 mm tets is 149 % too stiff under a sphere of 10 mm, and nothing was said below 0.495.
#[test]
fn how_much_too_stiffly_tets_answer_is_told_by_their_size_and_their_compressibility() {
    let coarse = run("check", &block(4, 0.45, NEO_HOOKEAN, RIGID), &[]).shown;
    let words = "warning: pressed by the tool \"ball\", 10 mm in radius, half of that deep, the body answers about 150 % too stiffly, mostly since linear tets lock";
    assert!(coarse.contains(words), "{coarse}");
    for command in ["simulate", "static"] {
        let ended = run(command, &block(4, 0.45, NEO_HOOKEAN, RIGID), &["--json"]);
        assert!(ended.said.contains("about 150 % too stiffly"), "{command}: {}", ended.said);
        assert!(json(&ended)["warnings"].to_string().contains("about 150 % too stiffly"), "{command}");
    }
    // Finer, it is a limit that is told; the smaller, the finer, and the more compressible.
    let finer = run("check", &block(16, 0.45, NEO_HOOKEAN, RIGID), &["--strict"]);
    assert_eq!(finer.code, Some(0), "{}", finer.shown);
    assert!(
        finer.shown.contains("limit      pressed by") && finer.shown.contains("about 30 % too stiffly"),
        "{}",
        finer.shown
    );
    let compressible = run("check", &block(8, 0.3, NEO_HOOKEAN, RIGID), &["--strict"]).shown;
    assert!(compressible.contains("mostly since so few tets are under the tool"), "{compressible}");
    let stiffer = run("check", &block(8, 0.499, NEO_HOOKEAN, RIGID), &[]).shown;
    assert!(stiffer.contains("times as stiffly as it should") && stiffer.contains("many substeps"), "{stiffer}");
    // Without a tool only what anything would feel.
    assert!(run("check", &block(4, 0.499, NEO_HOOKEAN, ""), &[]).shown.contains("at which linear tets lock"));
    assert!(!run("check", &block(4, 0.45, NEO_HOOKEAN, ""), &[]).shown.contains("stiffly"));
    // Particles do not lock.
    let particles = "[body.particles]\nspacing_mm = 5\n[[material]]";
    let hybrid = not_linear(&block(4, 0.499, NEO_HOOKEAN, RIGID)).replace("[[material]]", particles);
    assert!(!run("check", &hybrid, &[]).shown.contains("stiffly"));
    // Nor do smoothed tets, the default; where few of them are under the tool they are stiffer between nodes.
    let smoothed = run("check", &not_linear(&block(8, 0.499, NEO_HOOKEAN, RIGID)), &["--strict"]);
    let words = "the body answers up to about 19 % too stiffly between the corners of its triangles";
    assert!(smoothed.code == Some(0) && smoothed.shown.contains(words), "{}", smoothed.shown);
    assert!(!run("check", &not_linear(&block(4, 0.499, NEO_HOOKEAN, "")), &[]).shown.contains("stiffly"));
}

/// The same scene without linear tets.
fn not_linear(scene: &str) -> String {
    scene.replace("elements = \"linear\"\n", "")
}

/// A sphere of 3 mm that was dragged over particles of 2.5 mm felt each of them (its force swung by half), and nothing was said.
#[test]
fn how_much_a_tool_feels_single_particles_is_told_with_the_spacing_that_serves_it() {
    let on = |spacing_mm: f64, tool: &str| {
        let particles = format!("[body.particles]\nspacing_mm = {spacing_mm}\nmost_active = 50\n[[material]]");
        not_linear(&block(4, 0.45, NEO_HOOKEAN, tool)).replace("[[material]]", &particles)
    };
    let small = RIGID.replace("radius_mm = 10", "radius_mm = 3");
    let coarse = run("check", &on(5.0, &small), &[]).shown;
    let words = "warning: dragged over particles 5 mm apart, the tool \"ball\", 3 mm in radius, feels them: its force swings by about 72 % of its mean 1.5 mm deep, \
                 and by about 90 % 0.3 mm deep. It is smooth to 2 % on particles 0.83 mm apart at the one depth, 0.37 mm apart at the other; with smooth_skin = true, on particles 1.9 mm apart";
    assert!(coarse.contains(words), "{coarse}");
    for command in ["simulate", "static"] {
        let ended = run(command, &on(5.0, &small), &["--json"]);
        assert!(ended.said.contains("feels them"), "{command}: {}", ended.said);
        assert!(json(&ended)["warnings"].to_string().contains("feels them"), "{command}");
    }
    let smooth = on(5.0, &small).replace("spacing_mm = 5", "spacing_mm = 5\nsmooth_skin = true");
    let smooth = run("check", &smooth, &[]).shown;
    assert!(
        smooth.contains("swings by about 14 % of its mean 1.5 mm deep") && !smooth.contains("with smooth_skin"),
        "{smooth}"
    );
    // Where only a light touch feels them, it is a limit that is told.
    let large = run("check", &on(2.5, RIGID), &["--strict"]);
    assert_eq!(large.code, Some(0), "{}", large.shown);
    assert!(large.shown.contains("limit      dragged over particles 2.5 mm apart"), "{}", large.shown);
    // Tets are no particles, and there is nothing to tell without a tool.
    for scene in [block(4, 0.3, NEO_HOOKEAN, &small), on(5.0, "")] {
        assert!(!run("check", &scene, &[]).shown.contains("feels them"));
    }
}

/// A block between two plates that come nearer by so much (mm) of its 10, its faces free to slide.
fn squeezed(by_mm: f64, law: &str) -> String {
    format!(
        "[scene]\nname = \"squeezed\"\n[body]\nelements = \"linear\"\n[body.box]\nsize_mm = [20, 20, 10]\ncells = [4, 4, 4]\n\
         [[material]]\nlaw = \"{law}\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0\ndensity_kg_per_m3 = 1000\nviscosity_psi_pa_s = 0.3\n\
         [[fixed]]\nregion = \"z_min\"\n[[prescribed]]\nregion = \"z_max\"\ndisplacement_mm = [0, 0, -{by_mm}]\n\
         amplitude.smooth_step.duration_s = 0.2\n[output]\nduration_s = 0.25\n"
    )
}

#[test]
fn check_tells_until_where_stvk_holds_and_what_to_take_instead() {
    let shown = run("check", &block(4, 0.45, "stvk", ""), &[]).shown;
    for part in
        ["holds until it is pressed to 58 % of its length", "below 90 % already", "law = \"stable-neo-hookean\""]
    {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    assert!(!run("check", &block(4, 0.2, "stvk", ""), &[]).shown.contains("sideways"));
    assert!(!run("check", &block(4, 0.45, NEO_HOOKEAN, ""), &[]).shown.contains("58 %"));
    // The papers' hybrid has no other: it is told, and is no warning.
    let seed =
        Command::new(env!("CARGO_BIN_EXE_palpated")).args(["check", "seed-hybrid", "--strict"]).output().unwrap();
    assert!(seed.status.success() && String::from_utf8(seed.stdout).unwrap().contains("58 % of its length"));
}

/// A body of StVK that gave way under a press stayed so, and nothing was said until it was inside out.
#[test]
fn a_body_that_is_pressed_beyond_its_law_is_told_by_runs_and_equilibria() {
    let beyond = run("simulate", &squeezed(4.6, "stvk"), &["--json"]);
    println!("{}", beyond.said);
    assert!(beyond.said.contains("below 58 % the law \"stvk\" bears less the more it is pressed"), "{}", beyond.said);
    let summary = json(&beyond);
    let least = &summary["least_stretch_beyond_law"];
    assert!((0.2..0.577).contains(&least["value"].as_f64().unwrap()), "{summary}");
    assert!(least["time_s"].as_f64() > Some(0.1), "{summary}");
    assert!(summary["warnings"].to_string().contains("was pressed to"), "{summary}");
    let at_rest = run("static", &squeezed(4.6, "stvk"), &[]);
    assert!(at_rest.said.contains("the body was pressed to"), "{}", at_rest.said);
    for command in ["simulate", "static"] {
        for scene in [squeezed(4.0, "stvk"), squeezed(4.6, NEO_HOOKEAN)] {
            let ended = run(command, &scene, &["--json"]);
            assert_eq!((ended.code, ended.said.contains("was pressed to")), (Some(0), false), "{}", ended.said);
            assert!(json(&ended)["least_stretch_beyond_law"].is_null());
        }
    }
}

/// A block of 40 × 40 × 20 mm whose lattice of 3 mm does not end in its sides; those at a held side cannot be covered.
fn lattice(spacing_mm: f64, held: &str, tets: &str) -> String {
    format!(
        "[scene]\nname = \"block\"\n[body]\n{tets}\n[body.particles]\nspacing_mm = {spacing_mm}\n\
         [[material]]\nlaw = \"stable-neo-hookean\"\nyoung_modulus_pa = 10e3\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n\
         {held}\n[output]\nduration_s = 0.02\n"
    )
}

/// Particles that lie outside of the coarse tets, whose surface stays where it is held, never wake. Only `check` said so.
#[test]
fn particles_outside_the_coarse_tets_are_told_with_their_place_by_every_command() {
    let few = lattice(
        3.0,
        "[[fixed]]\nregion = \"x_min\"\n[[load]]\nregion = \"x_max\"\ntotal_force_n = [0, 0, -0.002]\namplitude.constant = 1",
        "[body.box]\nsize_mm = [40, 40, 20]\ncells = [4, 4, 2]",
    );
    let many = lattice(
        2.0,
        "[[region]]\nname = \"half\"\nselect = { region = \"outer\", half_space = { point_mm = [0, 0, 0], normal = [-1, 0, 0] } }\n\
         [[fixed]]\nregion = \"half\"\n[[load]]\nregion = \"inner\"\npressure_pa = 10\nfollower = false\namplitude.constant = 1",
        "[body.sphere_shell]\ninner_radius_mm = 12\nouter_radius_mm = 30\ntarget_tets = 60",
    );
    for (scene, sign, strict) in [(&few, "note: ", 0), (&many, "warning: ", 1)] {
        let check = run("check", scene, &["--strict"]);
        assert_eq!((check.code, check.said.as_str()), (Some(strict), ""), "{}", check.shown);
        let words = "are outside the coarse tets, whose surface cannot be moved further there, as where it is held: they never wake";
        assert!(check.shown.contains(words), "{}", check.shown);
        for command in ["simulate", "static"] {
            let ended = run(command, scene, &["--json"]);
            assert_eq!(ended.code, Some(0), "{command}: {}", ended.said);
            assert!(ended.said.contains(sign) && ended.said.contains(words), "{command}: {}", ended.said);
            let particles = &json(&ended)["body"]["particles"];
            let outside = particles["outside"].as_u64().unwrap();
            assert!(
                outside > 0
                    && ended.said.contains(&format!("{outside} of {} particles, between (", particles["count"]))
            );
        }
    }
    let none = run("check", &few.replace("spacing_mm = 3", "spacing_mm = 2.5"), &["--strict"]).shown;
    assert!(none.contains("and none is outside") && !none.contains("never wake"), "{none}");
}

#[test]
fn a_summary_tells_what_particles_are_awake_for() {
    let load = "[[load]]\nregion = \"spot\"\ntotal_force_n = [0, 0, -0.01]\namplitude.constant = 1\n\
                [[region]]\nname = \"spot\"\nselect = { region = \"z_max\", sphere = { centre_mm = [8, 8, 20], radius_mm = 4 } }\n\
                [[fixed]]\nregion = \"z_min\"\n";
    let tool = "[[tool]]\nname = \"ball\"\nradius_mm = 6\ncoupling = \"rigid\"\ndriver = \"script\"\n\
                keyframe = [{ time_s = 0, position_mm = [32, 32, 27] }, { time_s = 0.1, position_mm = [32, 32, 25] }]\n";
    let tets = "[body.box]\nsize_mm = [40, 40, 20]\ncells = [4, 4, 2]";
    let active = |held: &str| {
        let scene = lattice(2.5, held, tets).replace("duration_s = 0.02", "duration_s = 0.15");
        let shown = run("simulate", &scene, &[]).shown;
        let particles = json(&run("simulate", &scene, &["--json"]))["body"]["particles"].clone();
        let of = |what: &str| particles["active_for"][what].as_u64().unwrap();
        let counts = ["tools", "loads", "injected_forces", "nothing"].map(of);
        assert_eq!(counts.iter().sum::<u64>(), particles["active"].as_u64().unwrap(), "{particles}");
        (counts, shown)
    };
    let ([tools, loads, ..], shown) = active(&format!("{load}{tool}"));
    assert!(tools > 20 && loads > 20 && shown.contains(&format!("{tools} for tools, {loads} for loads")), "{shown}");
    let ([tools, loads, ..], _) = active(load);
    assert!(tools == 0 && loads > 20, "{tools} {loads}");
    // Shared ones count for the tool.
    let ([both, rest, ..], _) = active(&format!("{load}{}", tool.replace("32, 32", "8, 8")));
    assert!(both > 20 && rest < loads, "{both} {rest}");
}

/// Pressed as deep, a body of Poisson's ratio 0.499 answers nearly the same whether its waves of volume are slowed or not. Where they are it takes up to two
/// and a half times the substeps of one of 0.45 (`docs/adr/poisson-limit.md` tells what that costs).
#[test]
fn a_body_that_keeps_its_volume_is_as_stiff_with_slower_waves_of_volume() {
    let tool = "[[tool]]\nname = \"ball\"\nradius_mm = 8\ncoupling = \"rigid\"\ndriver = \"script\"\n\
                keyframe = [{ time_s = 0, position_mm = [20, 20, 28.5] }, { time_s = 0.1, position_mm = [20, 20, 26] }]\n\
                [[probe]]\nname = \"force\"\nmeasure = \"contact-force\"\ntool = \"ball\"\n[numerics]\nmass_damping_per_s = 60\n";
    let held = format!("[[fixed]]\nregion = \"z_min\"\n{tool}");
    let scene = lattice(2.5, &held, "[body.box]\nsize_mm = [40, 40, 20]\ncells = [4, 4, 2]")
        .replace("duration_s = 0.02", "duration_s = 0.25");
    let pressed = |nu: &str, most: &str| {
        let scene =
            scene.replace("poisson_ratio = 0.3", &format!("poisson_ratio = {nu}")).replace("spacing_mm = 2.5", most);
        let ended = run("simulate", &scene, &["--json"]);
        assert_eq!(ended.code, Some(0), "{}", ended.said);
        let told = json(&ended);
        let number = |value: &Value| value.as_f64().unwrap();
        let force_n = number(&told["probes"]["force"]["values"]["z"]);
        let warned = ended.said.contains("has Poisson's ratio");
        (force_n, number(&told["time"]["substeps_per_tick"]), warned)
    };
    let (usual, slowed) = (pressed("0.45", "spacing_mm = 2.5"), pressed("0.499", "spacing_mm = 2.5"));
    let exact = pressed("0.499", "spacing_mm = 2.5\nmost_poisson_ratio = 0.5");
    println!("{usual:?} {slowed:?} {exact:?}");
    assert!((slowed.0 / exact.0 - 1.0).abs() < 0.01, "{slowed:?} {exact:?}");
    assert!(slowed.1 <= 2.5 * usual.1 && exact.1 > 2.0 * slowed.1, "{usual:?} {slowed:?} {exact:?}");
    assert_eq!([usual.2, slowed.2, exact.2], [false, true, false]);
}
