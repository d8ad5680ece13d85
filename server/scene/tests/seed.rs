//! The papers' hybrid in scenes: the shipped ones are the papers' models, and what a seed body cannot have is told at its key.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use glam::DVec3;
use palpate_physics::{
    LoadSpec, Model, Scratch, State, TickInput,
    bodies::seed::{PaperModel, SeedParameters, SeedSpec},
    material::{Convention, Lame, Viscosity},
    step,
};
use palpate_scene::{Limits, Scene, builtin, parse, probes::Measure, shapes::seeds::paper_model};

fn loaded(text: &str) -> Result<Scene, String> {
    parse(text, "t.toml", None, &Limits::local(), &mut |_, _| {}).map_err(|error| error.one_line())
}

const SHIPPED: [(&str, PaperModel); 3] = [
    ("seed-ellipsoids", PaperModel::Ellipsoids),
    ("seed-full-fem", PaperModel::FullFem),
    ("seed-hybrid", PaperModel::Hybrid),
];

/// Meshes, held nodes, layer and every parameter of the papers' tables.
#[test]
fn the_shipped_scenes_are_the_papers_models() {
    for (name, paper) in SHIPPED {
        let text = builtin(name).unwrap();
        for (convention, parameters) in [
            ("paper-2006", SeedParameters::paper_2006(paper)),
            ("paper-2005", SeedParameters::paper_2005(paper)),
            ("consistent", SeedParameters { convention: Convention::Consistent, ..SeedParameters::paper_2006(paper) }),
        ] {
            let changed = text.replace("convention = \"paper-2006\"", &format!("convention = \"{convention}\""));
            let spec = loaded(&changed).unwrap().model;
            let wanted = paper_model(paper, parameters).unwrap();
            let seed = spec.body.as_seed().unwrap();
            assert_eq!(seed.core.mesh, wanted.core, "{name}");
            assert_eq!(spec.prescribed[0].nodes, wanted.held_nodes, "{name}");
            let SeedSpec { layer, parameters, .. } = wanted;
            assert_eq!((&seed.layer, seed.parameters), (&layer, parameters), "{name} {convention}");
            assert_eq!(spec.settings.tick_period_s, parameters.dt_s);
        }
        let model = Model::build(loaded(text).unwrap().model).unwrap();
        assert_eq!(model.substeps(), 1);
        let mass_kg: f64 = model.body().mass_kg().iter().sum();
        let told_kg = loaded(text).unwrap().summary.mass_kg;
        assert!((mass_kg / told_kg - 1.0).abs() < 1e-2, "{name}: {mass_kg} of {told_kg} kg");
    }
}

/// Each of them run as it is shipped, to the deepest press: the body is dented and pushes back.
#[test]
fn the_shipped_scenes_run_and_push_back() {
    for (name, _) in SHIPPED {
        let scene = loaded(builtin(name).unwrap()).unwrap();
        let model = Model::build(scene.model.clone()).unwrap();
        let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
        let (mut row, mut most_n, mut most_m) = ([0.0; 3], 0.0_f64, 0.0_f64);
        while state.time_s(&model) < 0.6 * scene.output.duration_s {
            let time_s = (state.mechanical.tick + 1) as f64 * model.settings().tick_period_s;
            let input = TickInput {
                tools: &[scene.offline_target(0, time_s)],
                load_factors: &[],
                prescribed_displacements_m: &[DVec3::ZERO],
                point_forces: &[],
            };
            let report = step(&model, &mut state, &mut scratch, &input);
            assert_eq!((report.quarantined, report.inputs_rejected), (None, 0), "{name}");
            let mut value = |probe: &str| {
                let probe = scene.probes.iter().find(|known| known.name() == probe).unwrap();
                probe.evaluate(&model, &state, &scratch, &mut row);
                row[0]
            };
            most_n = most_n.max(value("force"));
            most_m = most_m.max(-value("wall"));
        }
        println!("{name}: {:.3} µN, {:.3} mm", most_n * 1e6, most_m * 1e3);
        assert!(most_n > 1e-8 && (0.5e-3..3e-3).contains(&most_m), "{name}: {most_n} N {most_m} m");
    }
}

const BODY: &str = "[scene]\nname = \"t\"\ntick_period_s = 7e-3\n[body]\noffset_mm = [0, 0, 5]\n[body.sphere_shell]\ninner_radius_mm = 12\n\
                    outer_radius_mm = 20\ntarget_tets = 188\n";
const SEED: &str = "[body.seed]\nstep_ms = 3.5\n[body.seed.layer]\nouter_semi_axes_mm = [30, 30, 30]\ntriangles = 300\nparticles = 8000\n";
const MATERIAL: &str =
    "[[material]]\nlaw = \"stvk\"\nlambda_pa = 6\nmu_pa = 3\nviscosity_phi_pa_s = 1e-3\ndensity_kg_per_m3 = 900\n";

fn text(seed: &str, material: &str, rest: &str) -> String {
    format!("{BODY}{}{material}{rest}", seed.replace("step_ms = 3.5", "step_s = 3.5e-3"))
}

/// Parameters that a scene gives are those of the body; the layer moves with it, and carries loads and probes.
#[test]
fn a_scene_of_ones_own_gives_its_parameters() {
    let rest = "[[fixed]]\nregion = \"inner\"\n[[load]]\nregion = \"outer\"\ntotal_force_n = [0, 0, 1e-4]\namplitude.constant = 1\n\
                [[probe]]\nname = \"top\"\nmeasure = \"displacement\"\npoint_mm = [0, 0, 35]\n\
                [[probe]]\nname = \"core\"\nmeasure = \"displacement\"\npoint_mm = [0, 0, 21]\n\
                [[probe]]\nname = \"holder\"\nmeasure = \"reaction\"\nregion = \"inner\"\n";
    let scene = loaded(&text(SEED, MATERIAL, rest)).unwrap();
    assert_eq!(scene.warnings, Vec::<String>::new());
    let seed = scene.model.body.as_seed().unwrap().clone();
    let SeedParameters { convention, lame, viscosity, dt_s, density_kg_per_m3, .. } = seed.parameters;
    assert_eq!((convention, lame), (Convention::Consistent, Lame { lambda_pa: 6.0, mu_pa: 3.0 }));
    assert_eq!(viscosity, Viscosity { phi_pa_s: 1e-3, psi_pa_s: 0.0 });
    assert_eq!((dt_s, density_kg_per_m3), (3.5e-3, 900.0));
    let layer = seed.layer.unwrap();
    assert!(layer.skin_m.iter().all(|p| ((*p - DVec3::Z * 5e-3).length() - 0.03).abs() < 1e-12));
    let model = Model::build(scene.model.clone()).unwrap();
    assert_eq!(model.substeps(), 2);
    // Forces are at the skin's vertices, which are numbered after the core's nodes.
    let LoadSpec::NodalForces(forces) = &scene.model.loads[0] else { panic!("{:?}", scene.model.loads) };
    let loaded_nodes: Vec<u32> = forces.iter().map(|force| force.0).collect();
    assert_eq!(loaded_nodes, model.surface().nodes);
    let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
    for _ in 0..400 {
        let held = [DVec3::ZERO];
        let input =
            TickInput { tools: &[], load_factors: &[1.0], prescribed_displacements_m: &held, point_forces: &[] };
        assert_eq!(step(&model, &mut state, &mut scratch, &input).inputs_rejected, 0);
    }
    let value = |probe: usize| {
        let mut row = [0.0; 3];
        scene.probes[probe].evaluate(&model, &state, &scratch, &mut row);
        row[2]
    };
    assert!(matches!(scene.probes[0].measure(), Measure::Displacement(_)));
    assert!(value(0) > value(1) && value(1) > 0.0, "top {} m, core {} m", value(0), value(1));
    assert!(value(2) < -3e-5, "{} N", value(2));
}

#[test]
fn what_a_seed_body_cannot_have_is_told_at_its_key() {
    let lines = |text: &str| text.lines().count();
    let material_at = lines(BODY) + lines(SEED) + 1;
    let rest_at = material_at + lines(MATERIAL);
    let at = |line: usize, column: usize, message: &str| format!("t.toml:{line}:{column}: {message}");
    let cases: [(String, String); 13] = [
        (
            text(SEED, &MATERIAL.replace("stvk", "stable-neo-hookean"), ""),
            at(material_at + 1, 7, "a seed body is of St. Venant-Kirchhoff material (write law = \"stvk\")"),
        ),
        (
            text(SEED, &format!("{MATERIAL}{MATERIAL}"), ""),
            at(rest_at, 1, "a seed body has one material, of core and layer (leave one [[material]])"),
        ),
        (
            text(SEED, MATERIAL, "[numerics]\nmass_damping_per_s = 3\n"),
            at(rest_at, 2, "a seed body is integrated as the papers do"),
        ),
        (
            text(SEED, MATERIAL, "[[fixed]]\nregion = \"inner\"\naxes = \"xy\"\n"),
            at(rest_at + 2, 8, "nodes of a seed body are held along all axes or none (leave `axes` out)"),
        ),
        (
            text(
                SEED,
                MATERIAL,
                "[[prescribed]]\nregion = \"inner\"\ndisplacement_mm = [1, 0, 0]\namplitude.constant = 1\n",
            ),
            at(rest_at, 1, "what holds a seed body does not move (use [[fixed]])"),
        ),
        (
            text(SEED, MATERIAL, "").replacen("tick_period_s", "gravity_m_per_s2 = [0, 0, -9.81]\ntick_period_s", 1),
            at(3, 20, "a seed body has no gravity: its particles are made without (leave it out)"),
        ),
        (
            text(
                SEED,
                MATERIAL,
                "[[tool]]\nname = \"shaft\"\nshape = \"capsule\"\nradius_mm = 2\nhalf_length_mm = 4\ncoupling = \"rigid\"\n\
                 driver = \"script\"\nkeyframe = [{ time_s = 0, position_mm = [0, 0, 40] }]\n",
            ),
            at(
                rest_at + 2,
                9,
                "a capsule does not press a seed body, which is touched at one triangle (make the tool a sphere)",
            ),
        ),
        (
            text(SEED, MATERIAL, "[body.particles]\nspacing_mm = 4\n"),
            at(lines(BODY) + 1, 7, "[body.particles] and [body.seed] are two kinds of hybrid body"),
        ),
        (
            text(&SEED.replace("3.5", "-1"), MATERIAL, "").replace("step_ms = -1", "step_s = -1"),
            at(lines(BODY) + 2, 10, "body.seed.step_s = -1: must be larger than 0"),
        ),
        (
            text(&SEED.replace("[30, 30, 30]", "[30, 0, 30]"), MATERIAL, ""),
            at(lines(BODY) + 4, 22, "body.seed.layer.outer_semi_axes_m = [0.03, 0, 0.03]: all must be larger than 0"),
        ),
        (
            text(&SEED.replace("= 300", "= 3"), MATERIAL, ""),
            at(lines(BODY) + 5, 13, "body.seed.layer.triangles = 3: must be 20 to 10000000 here"),
        ),
        (
            text(&SEED.replace("= 8000", "= 0"), MATERIAL, ""),
            at(lines(BODY) + 6, 13, "body.seed.layer.particles = 0: must be 1 to 10000000 here"),
        ),
        (
            text(&SEED.replace("step_ms", "stepp_s"), MATERIAL, ""),
            at(lines(BODY) + 2, 1, "unknown key `stepp_s` in [body.seed] (did you mean `step_s`?)"),
        ),
    ];
    for (scene, wanted) in cases {
        let message = loaded(&scene).unwrap_err();
        assert!(message.starts_with(&wanted), "{message}\n{wanted}");
    }
}

/// What only the physics can tell names the cause: a skin inside its core.
#[test]
fn a_layer_without_room_is_refused_by_the_physics() {
    let small = loaded(&text(&SEED.replace("[30, 30, 30]", "[15, 15, 15]"), MATERIAL, "")).unwrap();
    let message = Model::build(small.model).unwrap_err().to_string();
    assert!(message.contains("particle") || message.contains("voxels"), "{message}");
}
