//! Every kind of bad scene gets a message that says what is wrong, where, and what to do: the whole message is looked at.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_physics::material::Law;
use palpate_scene::{Limits, SceneError, load_file, parse};
use std::path::Path;

const GOOD: &str = r#"[scene]
name = "t"
[body.box]
size_mm = [10, 10, 10]
cells = [2, 2, 2]
[[material]]
law = "stvk"
young_modulus_pa = 1e4
poisson_ratio = 0.3
density_kg_per_m3 = 1000
[[fixed]]
region = "z_min"
[[load]]
region = "z_max"
pressure_pa = 10
follower = true
amplitude.constant = 1
[[tool]]
name = "ball"
radius_mm = 2
coupling = "rigid"
driver = "script"
keyframe = [{ time_s = 0, position_mm = [5, 5, 20] }]
[[probe]]
name = "force"
measure = "contact-force"
tool = "ball"
"#;

fn scene(text: &str) -> Result<palpate_scene::Scene, SceneError> {
    parse(text, "t.toml", None, &Limits::local(), &mut |_, _| {})
}

/// The message for the good scene with one thing replaced.
fn refused(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "{from}");
    scene(&GOOD.replace(from, to)).unwrap_err().one_line()
}

#[test]
fn the_good_scene_is_good() {
    let scene = scene(GOOD).unwrap_or_else(|error| panic!("{}", error.one_line()));
    assert_eq!(scene.warnings, Vec::<String>::new());
    assert_eq!(scene.summary.tets, 48);
}

/// A name with escape codes was printed raw, and cleared the terminal of whoever looked.
#[test]
fn names_hold_no_escape_codes() {
    for (from, to, place) in [
        ("name = \"t\"", "name = \"t\\u001b[2J\"", "t.toml:2:8: "),
        ("name = \"t\"", "name = \"t\"\ndescription = \"fine\\nas lines go, \\u0007 is not\"", "t.toml:3:15: "),
        ("name = \"ball\"", "name = \"ball\\n\"", "t.toml:19:8: "),
        ("name = \"force\"", "name = \"\\u0085force\"", "t.toml:25:8: "),
    ] {
        let message = refused(from, to);
        assert!(message.starts_with(place) && message.contains("control character U+00"), "{message}");
    }
}

/// A mesh in millimetres taken for metres loaded without a word.
#[test]
fn a_body_in_the_wrong_unit_is_told_with_the_key_to_change() {
    let warnings = |from: &str, to: &str| scene(&GOOD.replace(from, to)).unwrap().warnings;
    let far = ("position_mm = [5, 5, 20]", "position_m = [5, 5, 20]");
    let text = GOOD.replace(far.0, far.1).replace("radius_mm = 2", "radius_m = 2");
    assert_eq!(
        scene(&text.replace("size_mm", "size_m")).unwrap().warnings,
        ["the body is 10.0000 m long: if millimetres were meant in [body.box], write `size_mm`"]
    );
    let small = warnings("size_mm = [10, 10, 10]", "size_mm = [0.02, 0.01, 0.01]");
    assert_eq!(small[0], "the body is 2.000e-2 mm long: if metres were meant in [body.box], write `size_m`");

    let folder = tempfile::tempdir().unwrap();
    let nodes = "4 3 0 0\n0 0 0 0\n1 80 0 0\n2 0 80 0\n3 0 0 80\n";
    std::fs::write(folder.path().join("heart.node"), nodes).unwrap();
    std::fs::write(folder.path().join("heart.ele"), "1 4 0\n0 0 1 2 3\n").unwrap();
    let of_unit = |unit: &str| {
        let head = "[scene]\nname = \"t\"\n[body.mesh]\nfile = \"heart.node\"\n";
        let material =
            "[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";
        let text = format!("{head}unit = \"{unit}\"\n{material}");
        parse(&text, "t.toml", Some(folder.path()), &Limits::local(), &mut |_, _| {}).unwrap().warnings
    };
    assert_eq!(of_unit("mm"), Vec::<String>::new());
    let wanted = "the body is 80.0000 m long: [body.mesh] says unit = \"m\"; should it be unit = \"mm\"?";
    assert_eq!(of_unit("m"), [wanted]);
    let wanted = "the body is 8.000e-2 mm long: [body.mesh] says unit = \"um\"; should it be unit = \"mm\"?";
    assert_eq!(of_unit("um"), [wanted]);
}

/// Only `check` said that nothing holds a body; `simulate` and `serve` let it fly.
#[test]
fn a_body_that_nothing_holds_is_told() {
    let free = GOOD.replace("[[fixed]]\nregion = \"z_min\"\n", "");
    let told = |text: &str| scene(text).unwrap().warnings;
    let warnings = told(&free);
    assert!(warnings[0].starts_with("nothing holds the body: a load may move it as a whole"), "{warnings:?}");
    let falling = free.replace("name = \"t\"", "name = \"t\"\ngravity_m_per_s2 = [0, 0, -9.81]");
    assert!(told(&falling)[0].contains("gravity will move it"));
    let alone = &free[..free.find("[[load]]").unwrap()];
    assert_eq!(told(alone), Vec::<String>::new(), "it rests");
}

#[test]
fn material_constants_outside_their_range() {
    assert_eq!(
        refused("poisson_ratio = 0.3", "poisson_ratio = 0.5"),
        "t.toml:9:17: poisson_ratio = 0.5: must be larger than -1 and smaller than 0.5 (0.5 is incompressible: use 0.49 or 0.499)"
    );
    assert_eq!(
        refused("young_modulus_pa = 1e4", "young_modulus_pa = 0"),
        "t.toml:8:20: young_modulus_pa = 0: must be finite and larger than 0"
    );
    assert_eq!(
        refused("density_kg_per_m3 = 1000", "density_kg_per_m3 = -1"),
        "t.toml:10:21: density_kg_per_m3 = -1: must be finite and larger than 0"
    );
    assert_eq!(
        refused("density_kg_per_m3 = 1000", "density_kg_per_m3 = 1000\nviscosity_phi_pa_s = -2"),
        "t.toml:11:22: viscosity_phi_pa_s = -2: must be finite and not negative"
    );
    assert_eq!(
        refused("poisson_ratio = 0.3", "mu_pa = 1"),
        "t.toml:6:1: a material needs young_modulus_pa with poisson_ratio, or lambda_pa with mu_pa, and not both pairs"
    );
    assert_eq!(
        refused("young_modulus_pa = 1e4", "young_modulus_pa = inf"),
        "t.toml:8:20: material[0].young_modulus_pa = inf: must be a finite number"
    );
}

#[test]
fn unknown_keys_with_the_nearest_known_one() {
    assert_eq!(
        refused("density_kg_per_m3", "density_kg_m3"),
        "t.toml:10:1: unknown key `density_kg_m3` in [material[0]] (did you mean `density_kg_per_m3`?)"
    );
    assert_eq!(refused("[[fixed]]", "[[fix]]"), "t.toml:11:3: unknown key `fix` in the scene (did you mean `fixed`?)");
    assert_eq!(
        refused("radius_mm = 2", "diameter_mm = 2"),
        "t.toml:20:1: unknown key `diameter_mm` in [tool[0]] (known: name, shape, radius_m, half_length_m, axis, coupling, stiffness_n_per_m, damping_n_s_per_m, mass_kg, turn_stiffness_nm_per_rad, turn_damping_nm_s_per_rad, inertia_kg_m2, friction_coefficient, driver, start_m, trajectory_file, keyframe, interpolation, repeat)"
    );
    assert_eq!(
        refused("law = \"stvk\"", "law = \"neo-hooke\""),
        format!("t.toml:7:7: material[0].law = \"neo-hooke\" is not known (known: {})", Law::NAMES.join(", "))
    );
}

#[test]
fn missing_keys_and_wrong_types() {
    assert_eq!(
        refused("radius_mm = 2\n", ""),
        "t.toml:18:1: the tool \"ball\" lacks the key `radius_m` (or `radius_mm`)"
    );
    assert_eq!(
        refused("cells = [2, 2, 2]", "cells = [2, 2]"),
        "t.toml:5:9: body.box.cells: invalid length 2, expected an array of length 3"
    );
    assert_eq!(
        refused("pressure_pa = 10", "pressure_pa = \"10 Pa\""),
        "t.toml:15:15: load[0].pressure_pa: invalid type: string \"10 Pa\", expected a number"
    );
    assert_eq!(
        refused("cells = [2, 2, 2]", "cells = [2, 2, -2]"),
        "t.toml:5:16: body.box.cells[2]: invalid value: integer `-2`, expected a whole number, not negative"
    );
    assert_eq!(
        refused("amplitude.constant = 1", "amplitude = 1"),
        "t.toml:17:13: load[0].amplitude: invalid type: integer `1`, expected a table"
    );
    assert_eq!(
        refused("[[fixed]]", "[fixed]"),
        "t.toml:11:2: fixed is a table, and should be a list of them (write [[fixed]])"
    );
    assert_eq!(refused("law = \"stvk\"", "law = 3"), "t.toml:7:7: material[0].law: must be a text in quotes");
    assert_eq!(refused("[scene]", "[scene"), "t.toml:1:7: this is not TOML: unclosed table, expected `]`");
}

#[test]
fn regions_that_select_nothing_or_do_not_exist() {
    let far = "[[region]]\nname = \"far\"\nselect.sphere = { centre_mm = [90, 0, 0], radius_mm = 1 }\n[[fixed]]\nregion = \"far\"";
    assert_eq!(
        refused("[[fixed]]\nregion = \"z_min\"", far),
        "t.toml:13:1: the region \"far\" selects nothing: no node, surface triangle or tet (the body reaches from (0.0000, 0.0000, 0.0000) to (10.0000, 10.0000, 10.0000) mm)"
    );
    assert_eq!(
        refused("region = \"z_max\"\n", "region = \"z_mx\"\n"),
        "t.toml:14:10: there is no region \"z_mx\" (did you mean `z_max`?)"
    );
    let inside = "[[region]]\nname = \"core\"\nselect.sphere = { centre_mm = [5, 5, 5], radius_mm = 1 }\n[[load]]\nregion = \"core\"";
    assert_eq!(
        refused("[[load]]\nregion = \"z_max\"", inside),
        "t.toml:17:10: the region \"core\" selects no surface triangles (it has 1 nodes, 0 surface triangles and 0 tets) (the body reaches from (0.0000, 0.0000, 0.0000) to (10.0000, 10.0000, 10.0000) mm)"
    );
    let group = "[[region]]\nname = \"g\"\nselect.physical_group = \"wall\"\n[[fixed]]";
    assert_eq!(
        refused("[[fixed]]", group),
        "t.toml:13:25: there is no physical group \"wall\" (the mesh has no physical groups)"
    );
    let own = "[[region]]\nname = \"x_min\"\nselect.region = \"whole\"\n[[fixed]]";
    assert_eq!(
        refused("[[fixed]]", own),
        "t.toml:12:8: the region \"x_min\" exists already: it is a part of the body (give your region another name)"
    );
}

#[test]
fn bodies_that_are_none_or_two_or_out_of_range() {
    assert_eq!(
        refused("size_mm = [10, 10, 10]", "size_mm = [10, -10, 10]"),
        "t.toml:3:7: [body.box]: size_m.y = -0.01: must be finite and larger than 0"
    );
    assert_eq!(
        refused("[[material]]", "[body.ventricle]\ntarget_tets = 500\n[[material]]"),
        "t.toml:6:7: [body] gives `box` and `ventricle`; it needs exactly one of `box`, `sphere_shell`, `ellipsoid_shell`, `ventricle`, `mesh`, `surfaces`, `surface`"
    );
    let bare = "[body]\n";
    assert!(
        refused("[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]\n", bare)
            .contains("[body] gives nothing; it needs exactly one of `box`"),
    );
    let mesh = "[body.mesh]\nfile = \"heart.msh\"\nunit = \"mm\"\n";
    assert_eq!(
        refused("[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]\n", mesh),
        "t.toml:4:8: body.mesh.file refers to the file heart.msh, but this scene came without a folder (send scenes that need no file, or have the daemon load the file from its own disk (`palpate-view load --on-daemon`, below a folder that `palpated --scene-folder` names))"
    );
}

#[test]
fn tools_arms_and_probes_that_contradict_themselves() {
    assert_eq!(
        refused("coupling = \"rigid\"", "coupling = \"spring\""),
        "t.toml:18:1: the tool \"ball\" on a spring lacks the key `stiffness_n_per_m` (a usual start is 500 N/m, 1 N s/m and 0.05 kg)"
    );
    assert_eq!(
        refused("coupling = \"rigid\"", "coupling = \"rigid\"\nmass_kg = 1"),
        "t.toml:22:11: `mass_kg` means nothing to a rigid tool (remove it, or write coupling = \"spring\")"
    );
    assert_eq!(
        refused("driver = \"script\"", "driver = \"device\""),
        "t.toml:18:1: the tool \"ball\" with driver = \"device\" lacks the key `start_m`"
    );
    assert_eq!(refused("radius_mm = 2", "radius_mm = 0"), "t.toml:20:13: tool[0].radius_m = 0: must be larger than 0");
    assert_eq!(
        refused("tool = \"ball\"", "tool = \"bal\""),
        "t.toml:27:8: there is no tool \"bal\" (did you mean `ball`?)"
    );
    assert_eq!(
        refused("tool = \"ball\"", "region = \"whole\""),
        "t.toml:27:10: `region` means nothing to what the probe \"force\" measures (remove it)"
    );
    assert_eq!(
        refused("[[probe]]", "[arm]\ntool = \"ball\"\nkeyframe = [{ time_s = 0, position_mm = [0, 0, 9] }]\n[[probe]]"),
        "t.toml:25:8: the arm cannot drive \"ball\": that tool's driver is not \"device\""
    );
    let back = "keyframe = [{ time_s = 1, position_mm = [5, 5, 20] }, { time_s = 1, position_mm = [5, 5, 19] }]";
    assert_eq!(
        refused("keyframe = [{ time_s = 0, position_mm = [5, 5, 20] }]", back),
        "t.toml:23:66: the path keyframe 1 is at 1 s, not after the one before it (1 s)"
    );
}

#[test]
fn loads_and_prescribed_motions_that_contradict_themselves() {
    assert_eq!(
        refused("follower = true\n", ""),
        "t.toml:13:1: `follower` goes with `pressure_pa`: true for a pressure on the deformed surface, false for one that acts as at rest"
    );
    assert_eq!(
        refused("pressure_pa = 10", "pressure_pa = 10\ntraction_pa = [0, 0, 1]"),
        "t.toml:16:15: [load[0]] gives `pressure_pa` and `traction_pa`; it needs exactly one of `pressure_pa`, `traction_pa`, `total_force_n`, `force_per_node_n`"
    );
    assert_eq!(
        refused("amplitude.constant = 1", "amplitude.ramp.duration_s = 0"),
        "t.toml:17:29: load[0].amplitude.ramp.duration_s = 0: must be larger than 0"
    );
    let twice = "[[prescribed]]\nregion = \"x_min\"\ndisplacement_mm = [0, 0, 1]\namplitude.constant = 1\n[[load]]";
    assert_eq!(
        refused("[[load]]", twice),
        "t.toml:14:10: node 0 is held along x by a [[fixed]] region already (make the regions disjoint, or give each only the axes it needs with `axes`)"
    );
    assert_eq!(
        refused("region = \"z_min\"", "region = \"z_min\"\naxes = \"xyw\""),
        "t.toml:13:8: axes = \"xyw\": must be some of x, y and z, for example \"xy\""
    );
}

#[test]
fn numerics_and_output_outside_their_range() {
    assert_eq!(
        refused("[[probe]]", "[numerics]\nsubsteps = 0\n[[probe]]"),
        "t.toml:25:12: numerics.substeps = 0: must be 1 to 100000; leave it out to have it measured"
    );
    assert_eq!(
        refused("[[probe]]", "[output]\nduration_s = -1\n[[probe]]"),
        "t.toml:25:14: output.duration_s = -1: must be finite and larger than 0"
    );
    assert_eq!(
        refused("name = \"t\"", "name = \"t\"\ntick_period_s = 0"),
        "t.toml:3:17: scene.tick_period_s = 0: must be between 1e-5 and 10"
    );
}

#[test]
fn files_that_are_missing_or_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let missing = load_file(&folder.path().join("none.toml"), &Limits::local(), &mut |_, _| {}).unwrap_err().one_line();
    assert!(missing.starts_with("cannot read the scene file") && missing.contains("none.toml"), "{missing}");

    let with = |replace: &str, by: &str| {
        let path = folder.path().join("s.toml");
        std::fs::write(&path, GOOD.replace(replace, by)).unwrap();
        let message = load_file(&path, &Limits::local(), &mut |_, _| {}).unwrap_err().one_line();
        message.replace(&folder.path().display().to_string(), "DIR")
    };
    let body = "[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]\n";
    let mesh = "[body.mesh]\nfile = \"heart.msh\"\nunit = \"mm\"\n";
    let message = with(body, mesh);
    assert!(message.starts_with("DIR/s.toml:4:8: DIR/heart.msh: cannot be read: No such file"), "{message}");
    std::fs::write(folder.path().join("heart.msh"), b"\x00\x01garbage\xff").unwrap();
    let message = with(body, mesh);
    assert!(message.starts_with("DIR/s.toml:4:8: DIR/heart.msh"), "{message}");

    let script = "driver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [5, 5, 20] }]";
    let trajectory = "driver = \"trajectory\"\ntrajectory_file = \"path.csv\"";
    std::fs::write(folder.path().join("path.csv"), "time_s,x_m,y_m\n0,0,0\n").unwrap();
    assert_eq!(
        with(script, trajectory),
        "DIR/s.toml:23:19: DIR/path.csv:1: there is no column `z_m` (found: time_s, x_m, y_m) (a trajectory has the columns time_s, x_m, y_m, z_m (or time_ms, x_mm, y_mm, z_mm))"
    );
    std::fs::write(folder.path().join("path.csv"), "time_s,x_mm,y_mm,z_mm\n0,0,0,nan\n").unwrap();
    assert!(with(script, trajectory).contains("path.csv:2: expected a finite number in column `z_mm`, found `nan`"));
}

#[test]
fn surfaces_that_cross_are_refused_with_the_place() {
    let examples = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes");
    let text = std::fs::read_to_string(examples.join("two-surfaces.toml")).unwrap();
    let swapped = text
        .replace("inner_file = \"data/ventricle-inner.stl\"", "inner_file = \"data/ventricle-outer.ply\"")
        .replace("outer_file = \"data/ventricle-outer.ply\"", "outer_file = \"data/ventricle-inner.stl\"");
    let message = parse(&swapped, "s.toml", Some(&examples), &Limits::local(), &mut |_, _| {}).unwrap_err().one_line();
    assert!(message.starts_with("s.toml:") && message.contains("does not lie inside the outer"), "{message}");
    assert!(message.contains("swapped"), "{message}");
}

/// One line of text could ask for fifty million tets, or for thousands of regions of a whole body each.
#[test]
fn what_is_larger_than_the_limits_is_refused_before_it_is_made() {
    let limits = Limits { tets: 40, entries: 3, tools: 2, file_bytes: 100 };
    let refused = |text: &str| parse(text, "t.toml", None, &limits, &mut |_, _| {}).unwrap_err().one_line();
    assert_eq!(
        refused(GOOD),
        "t.toml:5:9: body.box.cells gives 48 tets; at most 40 are allowed here (coarsen it, or give the scene to palpated on its command line: there 10000000 are allowed)"
    );
    let shell = "[body.sphere_shell]\ninner_radius_mm = 5\nouter_radius_mm = 9\ntarget_tets = 400000";
    let text = GOOD.replace("[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]", shell);
    assert!(refused(&text).starts_with("t.toml:6:15: body.sphere_shell.target_tets gives 400000 tets; at most 40"));
    let text = GOOD.replace("cells = [2, 2, 2]", "cells = [4294967295, 4294967295, 4294967295]");
    let message = scene(&text).unwrap_err().one_line();
    assert!(message.contains("gives 18446744073709551615 tets; at most 10000000 are allowed here"), "{message}");

    let small = GOOD.replace("cells = [2, 2, 2]", "cells = [1, 1, 1]");
    let region = |index: usize| format!("[[region]]\nname = \"r{index}\"\nselect.region = \"whole\"\n");
    let regions = (0..4).map(region).collect::<String>();
    assert_eq!(
        refused(&(small.clone() + &regions)),
        "t.toml:37:1: there are 4 [[region]]; at most 3 are allowed here (leave some out)"
    );
    let nested =
        "[[region]]\nname = \"r\"\nselect.any_of = [{ region = \"whole\" }, { not = { region = \"x_min\" } }]\n";
    let message = refused(&(small + nested));
    assert!(message.contains("the regions have 4 selectors up to here; at most 3 are allowed"), "{message}");

    let tool = |index: usize| {
        format!(
            "[[tool]]\nname = \"t{index}\"\nradius_mm = 1\ncoupling = \"rigid\"\nstart_mm = [0, 0, 20]\ndriver = \"device\"\n"
        )
    };
    let message =
        refused(&(0..3).map(tool).fold(GOOD.replace("cells = [2, 2, 2]", "cells = [1, 1, 1]"), |text, t| text + &t));
    assert!(message.contains("[[tool]]; at most 2 are allowed here"), "{message}");

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.toml");
    std::fs::write(&path, GOOD).unwrap();
    let message = load_file(&path, &limits, &mut |_, _| {}).unwrap_err().one_line();
    assert!(message.contains("cannot read the scene file") && message.contains("more than 100 bytes"), "{message}");
}

#[test]
fn shapes_of_tools_and_what_goes_with_them() {
    let shaped = |keys: &str| refused("radius_mm = 2\n", keys);
    for (keys, message) in [
        (
            "shape = \"capsule\"\nradius_mm = 2\n",
            "the capsule \"ball\" lacks the key `half_length_m` (or `half_length_mm`)",
        ),
        (
            "shape = \"capsule\"\nradius_mm = 2\nhalf_length_mm = 0\n",
            "tool[0].half_length_m = 0: must be larger than 0",
        ),
        ("shape = \"capsule\"\nradius_mm = 2\nhalf_length_mm = 4\naxis = [0, 0, 0]\n", "a direction must not be zero"),
        ("shape = \"point\"\nradius_mm = 2\n", "a point has no radius: it is as small as the surface allows"),
        ("radius_mm = 2\nhalf_length_mm = 4\n", "`half_length_m` goes with shape = \"capsule\""),
        ("radius_mm = 2\ninertia_kg_m2 = 1e-6\n", "`inertia_kg_m2` goes with shape = \"capsule\""),
        ("shape = \"cone\"\nradius_mm = 2\n", "(known: sphere, capsule, point)"),
    ] {
        let said = shaped(keys);
        assert!(said.contains(message), "{said}");
    }
}
