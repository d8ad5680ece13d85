//! Hybrid bodies in scenes: what regions choose of coarse tets and skin, where the lattice lies, what probes measure.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use glam::DVec3;
use palpate_physics::{
    LoadSpec, Model, Scratch, State, TickInput,
    bodies::hybrid::{ParticleSpec, Waking},
    contact::ToolTarget,
    step,
};
use palpate_scene::{Limits, Scene, parse};
use std::f64::consts::PI;

const TAIL: &str = r#"[[material]]
law = "stable-neo-hookean"
young_modulus_pa = 1e4
poisson_ratio = 0.3
density_kg_per_m3 = 1000
[[probe]]
name = "top"
measure = "displacement"
point_mm = [20, 20, 20]
[numerics]
mass_damping_per_s = 40
"#;

fn scene(body: &str) -> Scene {
    let text = format!("[scene]\nname = \"t\"\n{body}\n{TAIL}");
    parse(&text, "t.toml", None, &Limits::local(), &mut |_, _| {})
        .unwrap_or_else(|error| panic!("{}", error.one_line()))
}

const BLOCK: &str = r#"
[body]
offset_mm = [0, 0, 1]
[body.box]
size_mm = [40, 40, 20]
cells = [2, 2, 1]
[body.particles]
spacing_mm = 2.5
most_active = 200
[[region]]
name = "patch"
select = { region = "z_max", box = { min_mm = [14, 14, 0], max_mm = [26, 26, 40] } }
[[fixed]]
region = "z_min"
[[load]]
region = "patch"
traction_pa = [0, 0, -100]
amplitude.constant = 1
[[load]]
region = "z_max"
total_force_n = [0, 0, -0.01]
amplitude.constant = 0
[[probe]]
name = "table"
measure = "reaction"
region = "z_min"
"#;

/// Held are coarse nodes, loaded is the skin, and what is on one side of the body is on the other.
#[test]
fn regions_choose_nodes_of_the_tets_and_triangles_of_the_skin() {
    let scene = scene(BLOCK);
    let particles = &scene.model.body.as_hybrid().unwrap().particles;
    let held = &scene.model.prescribed[0].nodes;
    assert_eq!(held.len(), 9);
    assert!(held.iter().all(|&node| scene.model.body.solid().unwrap().mesh.positions_m()[node as usize].z == 1e-3));
    let LoadSpec::Traction { triangles, .. } = &scene.model.loads[0] else { panic!("a traction") };
    let area = |&triangle: &u32| {
        let [a, b, c] = particles.skin.corners_m(triangle as usize);
        0.5 * (b - a).cross(c - a).length()
    };
    // Triangles are in by their centroids.
    let loaded_m2: f64 = triangles.iter().map(area).sum();
    assert!((loaded_m2 / 144e-6 - 1.0).abs() < 0.25, "{loaded_m2}");
    let LoadSpec::NodalForces(forces) = &scene.model.loads[1] else { panic!("forces") };
    let total: DVec3 = forces.iter().map(|(_, force_n)| *force_n).sum();
    assert!(forces.len() > 200 && (total.z + 0.01).abs() < 1e-12);
    assert!(forces.iter().all(|&(v, _)| (particles.skin.positions_m()[v as usize].z - 21e-3).abs() < 1e-12));
    assert!((particles.lattice_through_m - DVec3::Z * 1e-3).length() < 1e-12);
    let Waking::ByTools { reach_m } = particles.waking else { panic!("tools wake them") };
    // Half a ball of this radius holds as many as may be awake.
    let held = 2.0 / 3.0 * PI * (reach_m / 2.5e-3).powi(3);
    assert!((held - 200.0).abs() < 1e-9, "{held}");
    assert!((scene.summary.mass_kg - 0.032).abs() < 1e-12);
}

/// The reaction is what was loaded, once the block is at rest; the probe follows the lattice.
#[test]
fn the_table_bears_what_the_skin_is_loaded_with() {
    let scene = scene(BLOCK);
    let model = Model::build(scene.model).unwrap();
    let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
    for _ in 0..1500 {
        let input = TickInput {
            tools: &[],
            load_factors: &[1.0, 0.0],
            prescribed_displacements_m: &[DVec3::ZERO],
            point_forces: &[],
        };
        step(&model, &mut state, &mut scratch, &input);
    }
    let value = |name: &str| {
        let probe = scene.probes.iter().find(|probe| probe.name() == name).unwrap();
        let mut values = [0.0; 5];
        probe.evaluate(&model, &state, &scratch, &mut values);
        DVec3::new(values[0], values[1], values[2])
    };
    let mut surface_m = Vec::new();
    model.surface_positions_m(&state, &mut surface_m);
    let rest = model.surface_rest_positions_m();
    let point = DVec3::new(0.02, 0.02, 0.021);
    let nearest = (0..rest.len()).min_by(|&a, &b| rest[a].distance(point).total_cmp(&rest[b].distance(point))).unwrap();
    let moved = surface_m[nearest] - rest[nearest];
    assert!(moved.z < -1e-5 && (value("top") - moved).length() < 0.1 * moved.length(), "{moved} {}", value("top"));
    let reaction = value("table");
    assert!(reaction.z > 0.01 && reaction.truncate().length() < 1e-2 * reaction.z, "{reaction}");
    let LoadSpec::Traction { triangles, .. } = &model.loads()[0] else { panic!("a traction") };
    let skin = &model.body().as_hybrid().unwrap().particles().skin;
    let area: f64 = triangles
        .iter()
        .map(|&t| {
            let [a, b, c] = skin.corners_m(t as usize);
            0.5 * (b - a).cross(c - a).length()
        })
        .sum();
    assert!((reaction.z / (100.0 * area) - 1.0).abs() < 1e-3, "{} {}", reaction.z, 100.0 * area);
}

/// Particles of a plate lie in faces of tets that are as thin as particles are apart: coarse nodes between the faces are
/// followed by rounding alone. The plate died two ticks after the gentlest touch, by the rounding of single precision.
#[test]
fn a_plate_of_cells_as_thin_as_particles_are_apart_bears_a_touch() {
    let body = "[body]\noffset_mm = [-20, -10, -8]\n[body.box]\nsize_mm = [40, 20, 8]\ncells = [4, 2, 4]\n[body.particles]\n\
                spacing_mm = 2\n[[fixed]]\nregion = \"z_min\"\n[[tool]]\nname = \"finger\"\nradius_mm = 5\ncoupling = \"rigid\"\n\
                driver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [0, 0, 5.5] }]";
    let force_n = |body: &str, precision: &str| {
        let text = format!("[scene]\nname = \"t\"\n{body}\n{TAIL}precision = \"{precision}\"\n");
        let scene = loaded(&text.replace("[20, 20, 20]", "[0, 0, 0]")).unwrap();
        let model = Model::build(scene.model).unwrap();
        let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
        let start = model.tools()[0].start();
        let mut force_n = DVec3::ZERO;
        for tick in 1..=150 {
            let depth_m = 1e-3 * f64::min(0.01 * f64::from(tick), 1.0);
            let target = ToolTarget { position_m: start.position_m - DVec3::Z * (0.5e-3 + depth_m), ..start };
            let input = TickInput {
                tools: &[target],
                load_factors: &[],
                prescribed_displacements_m: &[DVec3::ZERO],
                point_forces: &[],
            };
            let report = step(&model, &mut state, &mut scratch, &input);
            assert!(report.quarantined.is_none() && report.repeated == 0, "{precision}, {tick}: {report:?}");
            force_n = state.mechanical.tools[0].contact_force_n;
        }
        force_n
    };
    let [single, double] = ["single", "double"].map(|precision| force_n(body, precision));
    assert!(single.z > 0.02 && (single - double).length() < 1e-3 * double.length(), "{single} {double}");
    let thick = force_n(&body.replace("cells = [4, 2, 4]", "cells = [4, 2, 2]"), "double");
    assert!((double.z / thick.z - 1.0).abs() < 0.05, "{double} {thick}");
}

/// The lattice lies in the plane of the cut, which is held, and its middle on the axis.
#[test]
fn the_ventricles_lattice_lies_in_its_cut() {
    let scene = scene(
        "[body.ventricle]\nouter_semi_axes_mm = [45, 90]\ninner_semi_axes_mm = [31.5, 76.5]\ncut_z_mm = 22.5\ntarget_tets = 188\n\
         [body.particles]\nspacing_mm = 5\n[[fixed]]\nregion = \"base\"\n[[load]]\nregion = \"inner\"\npressure_pa = 10\n\
         follower = true\namplitude.constant = 1\n",
    );
    let particles = &scene.model.body.as_hybrid().unwrap().particles;
    assert!((particles.lattice_through_m - DVec3::new(0.0, 0.0, 0.0225)).length() < 1e-9);
    let LoadSpec::Pressure { triangles, .. } = &scene.model.loads[0] else { panic!("a pressure") };
    let axes = DVec3::new(0.0315, 0.0315, 0.0765);
    for &triangle in triangles {
        assert!(particles.skin.corners_m(triangle as usize).iter().all(|p| ((*p / axes).length() - 1.0).abs() < 1e-9));
    }
    Model::build(scene.model).unwrap();
}

/// A ventricle's wall between two surface files.
fn between_surfaces(unit: &str, target_tets: u32, particles: &str) -> Result<Scene, String> {
    let data = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes/data");
    let text = format!(
        "[scene]\nname = \"t\"\n[body.surfaces]\ninner_file = \"ventricle-inner.stl\"\nouter_file = \"ventricle-outer.ply\"\nunit = \"{unit}\"\n\
         target_tets = {target_tets}\n[body.particles]\n{particles}\n[[fixed]]\nregion = \"base\"\n[[load]]\nregion = \"inner\"\n\
         pressure_pa = 10\nfollower = true\namplitude.constant = 1\n{TAIL}"
    );
    parse(&text, "t.toml", Some(&data), &Limits::local(), &mut |_, _| {}).map_err(|error| error.one_line())
}

fn longest_m([a, b, c]: [DVec3; 3]) -> f64 {
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// The skin between two surfaces is as fine as the scene says, as it is around any other body.
#[test]
fn edges_of_the_skin_between_two_surfaces_are_as_short_as_told() {
    let scene = between_surfaces("mm", 500, "spacing_mm = 4\nskin_edge_mm = 2.5").unwrap();
    let skin = &scene.model.body.as_hybrid().unwrap().particles.skin;
    let longest = (0..skin.triangles().len()).map(|triangle| longest_m(skin.corners_m(triangle))).fold(0.0, f64::max);
    assert!(longest > 2e-3 && longest <= 2.5e-3 * 1.000_001, "{longest}");
}

/// A body in another unit than its lattice is told of as such, whether the lattice is far too fine or far too coarse for it.
#[test]
fn a_wrong_unit_is_told_where_the_lattice_does_not_fit() {
    for unit in ["m", "um"] {
        let message = between_surfaces(unit, 500, "spacing_mm = 4").unwrap_err();
        let told = format!("[body.surfaces] says unit = \"{unit}\"; should it be unit = \"mm\"?");
        assert!(message.contains("spacing_m") && message.contains(&told), "{message}");
    }
    let message = between_surfaces("mm", 20, "spacing_mm = 4").unwrap_err();
    assert!(message.starts_with("t.toml:7:15: 20 tets cannot fill this wall well"), "{message}");
    assert!(message.contains("or more; a thin wall needs many"), "{message}");
}

/// The stable neo-Hookean law stores ½λ where a body is crushed to a point, which is less than at rest with a negative λ.
#[test]
fn a_law_that_would_collapse_is_refused_at_its_constant() {
    let text = |law: &str, constants: &str| {
        let text = small("spacing_mm = 1.25", "").replace("stable-neo-hookean", law);
        text.replace("young_modulus_pa = 1e4\npoisson_ratio = 0.3", constants)
    };
    let by_ratio = "young_modulus_pa = 10e3\npoisson_ratio = -0.1";
    let by_lame = "lambda_pa = -1e3\nmu_pa = 4e3";
    for (constants, key) in [(by_ratio, "poisson_ratio = -0.1"), (by_lame, "lambda_pa = -1000")] {
        let refused = loaded(&text("stable-neo-hookean", constants)).unwrap_err();
        assert!(refused.contains(&format!("material[0].{key}")) && refused.contains("would collapse"), "{refused}");
        loaded(&text("fixed-corotated", constants)).unwrap();
    }
    loaded(&text("stable-neo-hookean", "young_modulus_pa = 10e3\npoisson_ratio = 0")).unwrap();
}

/// Two surface files: the skin is both of them, the inner one turned, and the strip between their rims.
#[test]
fn two_surfaces_become_a_skin_and_coarse_tets() {
    let scene = between_surfaces("mm", 500, "spacing_mm = 4").unwrap();
    let skin = &scene.model.body.as_hybrid().unwrap().particles.skin;
    let volume = scene.model.body.solid().unwrap().mesh.total_volume_m3();
    assert!((skin.volume_m3() / volume - 1.0).abs() < 0.02, "{} {volume}", skin.volume_m3());
    for triangle in 0..skin.triangles().len() {
        assert!(longest_m(skin.corners_m(triangle)) <= 4e-3 * 1.000_001);
    }
    let parts = |name: &str| scene.summary.parts.iter().find(|part| part.name == name).unwrap();
    let total: usize = ["inner", "outer", "base"].iter().map(|name| parts(name).triangles).sum();
    assert_eq!(total, skin.triangles().len());
    assert!(parts("base").nodes > 4 && parts("base").triangles > 20);
    Model::build(scene.model).unwrap();
}

/// A small block with particles, and one line of theirs more.
fn small(spacing: &str, more: &str) -> String {
    let body = "[body.box]\nsize_mm = [10, 10, 10]\ncells = [2, 2, 2]\n[body.particles]";
    format!("[scene]\nname = \"t\"\n{body}\n{spacing}\n{more}\n{}", &TAIL[..TAIL.find("[[probe]]").unwrap()])
}

fn loaded(text: &str) -> Result<Scene, String> {
    parse(text, "t.toml", None, &Limits::local(), &mut |_, _| {}).map_err(|error| error.one_line())
}

#[test]
fn particles_that_cannot_be_are_told_at_their_key() {
    let good = loaded(&small("spacing_mm = 1.25", "")).unwrap();
    let particles = good.model.body.as_hybrid().unwrap().particles.clone();
    assert_eq!(particles.most_active, 600);
    assert_eq!(good.summary.surface_triangles, particles.skin.triangles().len());
    assert!((particles.skin.volume_m3() - 1e-6).abs() < 1e-15);
    let refused = |spacing: &str, more: &str| loaded(&small(spacing, more)).unwrap_err();
    let cases = [
        ("spacing_mm = 0", "", "t.toml:7:14: body.particles.spacing_m = 0: must be larger than 0"),
        ("spacing_m = -1", "", "t.toml:7:13: body.particles.spacing_m = -1: must be larger than 0"),
        (
            "spacing_mm = 11",
            "",
            "t.toml:7:14: body.particles.spacing_m = 0.011: the lattice is coarser than the body, whose smallest extent is \
             1.000e-2 m (take a spacing with several particles through the thinnest part)",
        ),
        (
            "spacing_mm = 0.01",
            "",
            "t.toml:7:14: body.particles.spacing_m = 0.00001 gives about 1.0e9 particles; at most 1e7 are allowed here (take a \
             larger spacing)",
        ),
        ("spacing_mm = 1", "most_active = 0", "t.toml:8:15: body.particles.most_active = 0: must be 1 to 20000"),
        (
            "spacing_mm = 1",
            "skin_edge_mm = 1.5",
            "t.toml:8:16: body.particles.skin_edge_m = 0.0015: must be larger than 0 and no larger than the spacing",
        ),
        (
            "spacing_mm = 1",
            "skin_edge_mm = 0.01",
            "t.toml:8:16: body.particles.skin_edge_m = 0.00001 gives about 2.4e7 triangles of the skin; at most 1e7 are allowed here \
             (take a larger edge)",
        ),
        (
            "spacing_mm = 1",
            "fine_depth_mm = -1",
            "t.toml:8:17: body.particles.fine_depth_m = -0.001: must not be negative",
        ),
        (
            "spacing_mm = 1",
            "reach_mm = 0",
            "t.toml:8:12: body.particles.reach_m = 0: must be no smaller than the spacing, or no particle would wake",
        ),
        (
            "spacing_mm = 1",
            "reach_mm = 0.9",
            "t.toml:8:12: body.particles.reach_m = 0.0009: must be no smaller than the spacing, or no particle would wake",
        ),
        (
            "spacing_mm = 1",
            "most_poisson_ratio = 0.6",
            "t.toml:8:22: body.particles.most_poisson_ratio = 0.6: must be larger than 0 and at most 0.5",
        ),
        (
            "spacing_mm = 1",
            "spaceing = 2",
            "t.toml:8:1: unknown key `spaceing` in [body.particles] (did you mean `spacing_m` or `spacing_mm`?)",
        ),
        (
            "",
            "",
            "t.toml:6:7: [body.particles] lacks the key `spacing_m` (or `spacing_mm`) (docs/scenes.md describes every key; \
             of a body with particles `palpated fit-budget` chooses it, by what a tick may take)",
        ),
    ];
    for (spacing, more, wanted) in cases {
        assert_eq!(refused(spacing, more), wanted);
    }
    let implicit = format!("{}[numerics]\nintegrator = \"backward-euler\"\n", small("spacing_mm = 1", ""));
    let message = loaded(&implicit).unwrap_err();
    assert!(message.ends_with(
        "a body with particles is integrated by leapfrog only (leave `integrator` out, or [body.particles])"
    ));
    let sleeping = format!("{}[numerics]\nsleep_tolerance_um = 1\n", small("spacing_mm = 1", ""));
    assert!((loaded(&sleeping).unwrap().model.settings.sleep_tolerance_m - 1e-6).abs() < 1e-20);
}

#[test]
fn materials_that_keep_their_volume_are_limited_and_told() {
    let scene = |nu: &str, more: &str| {
        let text = small("spacing_mm = 1.25", more).replace("poisson_ratio = 0.3", &format!("poisson_ratio = {nu}"));
        assert!(text.contains(&format!("poisson_ratio = {nu}")), "{text}");
        loaded(&text).unwrap()
    };
    let ratio = |scene: &Scene| scene.model.body.solid().unwrap().regions[0].material.lame.poisson_ratio();
    for (nu, more, taken) in [
        ("0.488", "", 0.488),
        ("0.499", "", 0.488),
        ("0.499", "most_poisson_ratio = 0.5", 0.499),
        ("0.4", "most_poisson_ratio = 0.25", 0.25),
    ] {
        let scene = scene(nu, more);
        assert!((ratio(&scene) - taken).abs() < 1e-12, "{nu} {more}: {}", ratio(&scene));
        let told = scene
            .warnings
            .iter()
            .any(|warning| warning.contains(&format!("has Poisson's ratio {nu}; it is taken to have {taken}")));
        assert_eq!(told, nu != taken.to_string(), "{nu} {more}: {:?}", scene.warnings);
    }
}

#[test]
fn a_finer_skin_and_larger_cells_deep_down_are_what_was_asked_for() {
    let of = |more: &str| {
        loaded(&small("spacing_mm = 1.25", more)).unwrap().model.body.as_hybrid().unwrap().particles.clone()
    };
    let (same, two_sizes, finer) = (of(""), of("fine_depth_mm = 1.25"), of("skin_edge_mm = 0.6"));
    assert_eq!((same.fine_depth_m, two_sizes.fine_depth_m), (None, Some(1.25e-3)));
    assert_eq!((same.smooth_skin, of("smooth_skin = true").smooth_skin), (false, true));
    let longest_m = |particles: &ParticleSpec| {
        let edges = (0..particles.skin.triangles().len()).flat_map(|t| {
            let [a, b, c] = particles.skin.corners_m(t);
            [a.distance(b), b.distance(c), c.distance(a)]
        });
        edges.fold(0.0, f64::max)
    };
    assert!(longest_m(&same) > 0.6e-3 && longest_m(&same) < 1.2501e-3, "{}", longest_m(&same));
    assert!(longest_m(&finer) > 0.3e-3 && longest_m(&finer) < 0.6001e-3, "{}", longest_m(&finer));
    // Half a ball that holds as many particles reaches farther: 600 in 1.25³ mm³ each down to 1.25 mm, in eight times that below.
    let reach_mm = |particles: &ParticleSpec| match particles.waking {
        Waking::ByTools { reach_m } => reach_m * 1e3,
        Waking::ByHand => f64::NAN,
    };
    let (small, large) = (reach_mm(&same), reach_mm(&two_sizes));
    let layer_mm3 = |r: f64| PI * 1.25 * (r * r - 1.25 * 1.25 / 3.0);
    let ball_mm3 = |r: f64| 2.0 / 3.0 * PI * r.powi(3);
    assert!((ball_mm3(small) / 1.25_f64.powi(3) - 600.0).abs() < 1e-6, "{small}");
    let count = (layer_mm3(large) + (ball_mm3(large) - layer_mm3(large)) / 8.0) / 1.25_f64.powi(3);
    assert!((count - 600.0).abs() < 1e-6 && large > 1.3 * small, "{count} {small} {large}");
}

#[test]
fn a_mesh_files_boundary_becomes_a_fine_skin() {
    let folder = tempfile::tempdir().unwrap();
    let nodes = "4 3 0 0\n0 0 0 0\n1 80 0 0\n2 0 80 0\n3 0 0 80\n";
    std::fs::write(folder.path().join("heart.node"), nodes).unwrap();
    std::fs::write(folder.path().join("heart.ele"), "1 4 0\n0 0 1 2 3\n").unwrap();
    let text = "[scene]\nname = \"t\"\n[body.mesh]\nfile = \"heart.node\"\nunit = \"mm\"\n[body.particles]\nspacing_mm = 8\n\
                [[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";
    let scene = parse(text, "t.toml", Some(folder.path()), &Limits::local(), &mut |_, _| {}).unwrap();
    let skin = scene.model.body.as_hybrid().unwrap().particles.skin.clone();
    assert!((skin.volume_m3() / (0.08_f64.powi(3) / 6.0) - 1.0).abs() < 1e-12);
    for triangle in 0..skin.triangles().len() {
        let [a, b, c] = skin.corners_m(triangle);
        assert!(a.distance(b).max(b.distance(c)).max(c.distance(a)) <= 8e-3 * 1.000_001);
    }
}
