//! `solve_static` and `step` come to the same rest, with tools that are rigid, on a spring, and on a saturated spring.
#![allow(clippy::unwrap_used)]
use crate::common;
use common::{block, held, material, spec};
use glam::DVec3;
use palpate_physics::{
    Energies, Model, Scratch, State, Substeps, TickInput,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    material::Law,
    statics::{Goal, SolveError, StaticSettings, StaticSolution, solve_static},
    step,
};
use std::ops::ControlFlow;

const SIZE_M: f64 = 0.06;
/// Off every symmetry of the mesh.
const ABOVE: DVec3 = DVec3::new(0.0313, 0.0287, 0.0);
const START_Z_M: f64 = 0.042;

fn spring(stiffness_n_per_m: f64) -> Coupling {
    let mass_kg = 0.02;
    Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m: 2.0 * (stiffness_n_per_m * mass_kg).sqrt(), mass_kg }
}

/// A block under its weight, held on the floor, a sphere of 10 mm radius 2 mm above it.
fn pressed_block(coupling: Coupling) -> Model {
    let mesh = block(DVec3::new(SIZE_M, SIZE_M, 0.03), [6, 6, 3]);
    let prescribed = vec![held(&mesh, "floor", [true; 3], |p| p.z == 0.0)];
    let mut wanted = spec(mesh, material(Law::StableNeoHookean, 10e3, 0.45), prescribed, vec![]);
    wanted.tools = vec![ToolSpec {
        name: "sphere".into(),
        shape: ToolShape::Sphere,
        radius_m: 0.01,
        coupling,
        friction_coefficient: 0.0,
        start_position_m: ABOVE + DVec3::Z * START_Z_M,
    }];
    wanted.gravity_m_per_s2 = DVec3::new(0.0, 0.0, -9.81);
    wanted.settings.substeps = Substeps::Measured;
    wanted.settings.mass_damping_per_s = 150.0;
    Model::build(wanted).unwrap()
}

fn at(position_m: DVec3) -> ToolTarget {
    ToolTarget::at(position_m)
}

fn solved(model: &Model, device_m: DVec3) -> Result<StaticSolution, SolveError> {
    let settings = StaticSettings { relative_residual: 1e-12, ..StaticSettings::default() };
    solve_static(
        model,
        &Goal { prescribed_displacements_m: &[DVec3::ZERO], tools: &[at(device_m)], ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
}

/// Ticks with the device going from its start to its place in `way_ticks`, then resting.
fn stepped(model: &Model, mut state: State, device_m: DVec3, way_ticks: u32, ticks: u32) -> State {
    let mut scratch = Scratch::new(model);
    let start = state.mechanical.tools[0].target.position_m;
    for tick in 1..=ticks {
        let way = (f64::from(tick) / f64::from(way_ticks)).min(1.0);
        let input = TickInput {
            tools: &[at(start.lerp(device_m, way))],
            load_factors: &[],
            prescribed_displacements_m: &[DVec3::ZERO],
            point_forces: &[],
        };
        step(model, &mut state, &mut scratch, &input);
    }
    state
}

fn largest_distance_m(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max)
}

/// Both solved; they agree in every node, the tool's place and its force to 1e-9 of body and force.
fn agree(coupling: Coupling, device_m: DVec3) -> (Model, StaticSolution) {
    let model = pressed_block(coupling);
    let found = solved(&model, device_m).unwrap();
    let state = stepped(&model, State::at_rest(&model), device_m, 100, 1500);
    let (still, moving) = (found.tools[0], &state.mechanical.tools[0]);
    let nodes_m = largest_distance_m(&state.mechanical.x, &found.x);
    let tool_m = still.centre_m.distance(moving.centre_m);
    let force = still.contact_force_n.distance(moving.contact_force_n) / still.contact_force_n.length();
    let device = still.device_force_n.distance(moving.device_force_n) / still.contact_force_n.length();
    println!(
        "{coupling:?}: force {:.6} N of at most {:.3}, centre {}; apart: nodes {nodes_m:.1e} m, tool {tool_m:.1e} m, force {force:.1e}, \
         device {device:.1e}; {} iterations, {} factorisations, {} load steps",
        still.contact_force_n.length(),
        model.contact().force_limit_n(0),
        still.centre_m,
        found.iterations,
        found.factorisations,
        found.load_steps,
    );
    assert!(found.stable && found.relative_residual <= 1e-12, "{found:?}");
    assert!(nodes_m < 1e-9 * SIZE_M && tool_m < 1e-9 * SIZE_M);
    assert!(force < 1e-9 && device < 1e-9);
    assert_eq!(still.contacts, moving.contacts);
    assert!((still.penetration_m - moving.penetration_m).abs() < 1e-9 * SIZE_M);
    assert!((still.contact_energy_j / moving.contact_energy_j - 1.0).abs() < 1e-8);
    // The tool rests, and the floor carries the weight and what the device gives.
    assert!((still.contact_force_n - still.device_force_n).length() < 1e-9 * still.contact_force_n.length());
    let weight = model.body().mass_kg().iter().sum::<f64>() * 9.81;
    let sum = found.reactions_n[0] - still.device_force_n - DVec3::Z * weight;
    assert!(sum.length() < 1e-9 * still.contact_force_n.length(), "{sum}");
    (model, found)
}

#[test]
fn a_rigid_tool_rests_where_its_device_is() {
    let device = ABOVE + DVec3::Z * 0.036;
    let (_, found) = agree(Coupling::Rigid, device);
    assert_eq!(found.tools[0].centre_m, device);
    assert!(found.tools[0].contact_force_n.z > 0.1);
}

#[test]
fn a_tool_on_a_spring_rests_where_the_spring_balances_the_contact() {
    let device = ABOVE + DVec3::new(0.001, -0.002, 0.036);
    let (model, found) = agree(spring(200.0), device);
    let (tool, limit_n) = (found.tools[0], model.contact().force_limit_n(0));
    assert!(tool.contact_force_n.length() < 0.9 * limit_n, "not saturated: {} {limit_n}", tool.contact_force_n);
    assert!(((device - tool.centre_m) * 200.0 + tool.contact_force_n).length() < 1e-9);
    assert!(tool.centre_m.distance(device) > 1e-4, "the spring gives");
}

#[test]
fn a_tool_on_a_saturated_spring_rests_with_its_limit() {
    let device = ABOVE + DVec3::new(0.004, 0.001, 0.01);
    let (model, found) = agree(spring(1000.0), device);
    let (tool, limit_n) = (found.tools[0], model.contact().force_limit_n(0));
    assert!((tool.contact_force_n.length() / limit_n - 1.0).abs() < 1e-9);
    assert!(tool.centre_m.distance(device) > 0.01, "the device is deep inside, the tool is not");
}

#[test]
fn a_tool_that_touches_nothing_is_at_its_device() {
    for (coupling, device) in [(spring(50.0), DVec3::new(0.3, 0.2, 0.1)), (spring(5000.0), ABOVE + DVec3::Z * 0.06)] {
        let model = pressed_block(coupling);
        let tool = solved(&model, device).unwrap().tools[0];
        assert!(tool.centre_m.distance(device) < 1e-12 && tool.contacts == 0, "{tool:?}");
        assert!(tool.device_force_n.length() < 1e-9);
    }
}

#[test]
fn time_goes_on_from_a_static_solution_without_moving() {
    for (coupling, device_z_m) in [(Coupling::Rigid, 0.037), (spring(200.0), 0.034), (spring(1000.0), 0.01)] {
        let device = ABOVE + DVec3::Z * device_z_m;
        let model = pressed_block(coupling);
        let found = solved(&model, device).unwrap();
        let start = found.state(&model, &[]);
        let energies = Energies::of(&model, &start);
        assert!(energies.elastic_j > 0.0 && energies.balance_j().abs() < 1e-15, "{energies:?}");
        let state = stepped(&model, start, device, 1, 200);
        let moved = largest_distance_m(&state.mechanical.x, &found.x)
            .max(state.mechanical.tools[0].centre_m.distance(found.tools[0].centre_m));
        println!("{coupling:?}: moved {moved:.1e} m in 200 ticks");
        assert!(moved < 1e-10 * SIZE_M, "{moved:e}");
    }
}

#[test]
fn a_tool_too_far_away_is_an_error_not_an_endless_way() {
    let model = pressed_block(Coupling::Rigid);
    let error = solved(&model, DVec3::Z * 1e3).unwrap_err();
    println!("{error}");
    assert!(matches!(error, SolveError::ToolTooFar { .. }), "{error}");
}
