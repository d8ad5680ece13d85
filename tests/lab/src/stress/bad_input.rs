//! What is not finite, at random places of every input: refused at the door, or replaced and counted; the last good state stays.
//!
//! That the arm's force ramps to zero within 5 ms is the control law's and the daemon's (`palpate-control`, `palpated` test it); physics
//! takes the force of a refused tick away at once.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::methods::tet_body;
use crate::random::Random;
use glam::DVec3;
use miette::Result;
use palpate_physics::{
    BodySpec, LoadSpec, Model, ModelSpec, PointForce, TetMesh,
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    material::{Lame, Law, Viscosity},
};

pub(super) const CRITERION: &str = "NaN and infinity at random places of every input: refused with a clear error; last good state kept; no force from it";

const BAD: [f64; 3] = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let rounds = options.pick(30, 300, 30_000);
    let mut outcome = Outcome::passing();
    let mut random = Random::new(options.seed);
    let good = pressed(options)?;
    let refused = ticks(&good, rounds, &mut random, &mut outcome);
    outcome.push(Measured::value("inputs of ticks tried", f64::from(rounds), "1"));
    outcome.push(Measured::bounded("of them not refused", f64::from(rounds - refused), "1", 0.0));
    blows(&good, &mut outcome);
    let (mut tried, mut taken) = (0, 0);
    for _ in 0..rounds.div_ceil(10) {
        for field in 0..FIELDS.len() {
            tried += 1;
            let bad = BAD[random.below(BAD.len())];
            let built = spoilt(&good.spec, field, bad, &mut random);
            taken += u32::from(built.is_ok());
            match built {
                Ok(()) => outcome.demand(false, || format!("{} = {bad} was accepted", FIELDS[field])),
                Err(text) => {
                    outcome.demand(text.len() > 10, || format!("{} = {bad}: says only \"{text}\"", FIELDS[field]));
                }
            }
        }
    }
    outcome.broken.sort();
    outcome.broken.dedup();
    outcome.push(Measured::value("specifications tried", f64::from(tried), "1"));
    outcome.push(Measured::bounded("of them accepted", f64::from(taken), "1", 0.0));
    Ok(outcome)
}

/// A held block with every kind of load and two tools that press it.
fn pressed(options: &Options) -> Result<Rig> {
    let mesh = meshes::block(4)?;
    let floor = meshes::nodes_where(&mesh, |p| p.z < -0.0199);
    let top = meshes::triangles_where(&mesh, |p| p.z > -1e-9)?;
    let corner = meshes::nodes_where(&mesh, |p| p.z > -1e-9 && p.x > 0.0199);
    let mut spec = rig::body(options, mesh, material(Law::StableNeoHookean, 10e3, 0.4)?);
    rig::solid_mut(&mut spec).regions[0].material.viscosity = Viscosity { phi_pa_s: 0.2, psi_pa_s: 0.2 };
    spec.prescribed = vec![rig::hold("floor", floor)];
    spec.gravity_m_per_s2 = DVec3::NEG_Z * 9.81;
    spec.loads = vec![
        LoadSpec::NodalForces(corner.iter().map(|&n| (n, DVec3::X * 1e-3)).collect()),
        LoadSpec::Traction { triangles: top[..2].to_vec(), traction_pa: DVec3::Y * 20.0 },
        LoadSpec::Pressure { triangles: top[2..4].to_vec(), pressure_pa: 50.0, follower: true },
    ];
    let sphere = |name: &str, x: f64, coupling| ToolSpec {
        name: name.into(),
        shape: ToolShape::Sphere,
        radius_m: 0.008,
        coupling,
        friction_coefficient: 0.3,
        start_position_m: DVec3::new(x, 0.001, 0.008),
    };
    let coupled = Coupling::Spring { stiffness_n_per_m: 200.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 };
    spec.tools = vec![sphere("rigid", -0.01, Coupling::Rigid), sphere("coupled", 0.01, coupled)];
    let mut rig = Rig::new(spec)?;
    let drive = pressing(&rig.model);
    for _ in 0..30 {
        rig.tick(&drive);
    }
    Ok(rig)
}

fn pressing(model: &Model) -> Drive {
    let mut drive = Drive::still(model);
    for tool in &mut drive.tools {
        tool.position_m.z -= 0.002;
    }
    drive.load_factors.fill(1.0);
    drive
}

/// How many of the rounds counted what was wrong in them and went on without it.
fn ticks(good: &Rig, rounds: u32, random: &mut Random, outcome: &mut Outcome) -> u32 {
    let mut refused = 0;
    for round in 0..rounds {
        let mut drive = pressing(&good.model);
        let node = random.below(good.state.mechanical.x.len()) as u32;
        drive.point_forces.push(PointForce { node, force_n: DVec3::ZERO });
        let what = spoil(&mut drive, random);
        let mut rig = good.clone();
        let report = rig.tick(&drive);
        let sound = report.quarantined.is_none() && rig.is_finite();
        outcome.demand(sound, || format!("round {round}: {what} spoilt the state"));
        // What follows is as if it had not been: the body goes on.
        let after = rig.tick(&pressing(&good.model));
        outcome.demand(after.inputs_rejected == 0 && rig.is_finite(), || format!("round {round}: {what} left a mark"));
        refused += u32::from(report.inputs_rejected == 1);
    }
    refused
}

/// Puts one bad number into one place; says which.
fn spoil(drive: &mut Drive, random: &mut Random) -> &'static str {
    let (bad, axis) = (BAD[random.below(BAD.len())], random.below(3));
    match random.below(5) {
        0 => {
            let tool = random.below(drive.tools.len());
            drive.tools[tool].position_m[axis] = bad;
            "a tool's position"
        }
        1 => {
            let tool: &mut ToolTarget = &mut drive.tools[random.below(2)];
            tool.velocity_m_per_s[axis] = bad;
            "a tool's velocity"
        }
        2 => {
            let load = random.below(drive.load_factors.len());
            drive.load_factors[load] = bad;
            "a load factor"
        }
        3 => {
            drive.prescribed_m[0][axis] = bad;
            "a prescribed displacement"
        }
        _ => {
            drive.point_forces[0].force_n[axis] = bad;
            "a point force"
        }
    }
}

/// Finite blows whose result is not: the tick is refused, the state is the one before, and tools feel nothing.
fn blows(good: &Rig, outcome: &mut Outcome) {
    for force_n in [DVec3::X * 1e200, DVec3::splat(f64::MAX), DVec3::NEG_Z * 1e300] {
        let mut rig = good.clone();
        let mut drive = pressing(&good.model);
        drive.point_forces.push(PointForce { node: rig.model.surface().triangle_nodes(0)[0], force_n });
        let free = tet_body(&rig.model).inverse_mass_per_kg().iter().position(|inverse| inverse.x > 0.0).unwrap_or(0);
        drive.point_forces[0].node = free as u32;
        let report = rig.tick(&drive);
        outcome.demand(report.quarantined.is_some(), || format!("{force_n} N was not refused"));
        outcome.demand(rig.state.mechanical.x == good.state.mechanical.x, || {
            format!("{force_n} N moved the last good state")
        });
        let silent = rig
            .state
            .mechanical
            .tools
            .iter()
            .all(|tool| tool.device_force_n == DVec3::ZERO && tool.local_model.is_none());
        outcome.demand(silent, || format!("a tool still feels {force_n} N"));
    }
}

const FIELDS: [&str; 23] = [
    "a node's position",
    "young_modulus_pa",
    "poisson_ratio",
    "lambda_pa of a material",
    "mu_pa of a material",
    "phi_pa_s of a material",
    "psi_pa_s of a material",
    "density_kg_per_m3",
    "a nodal force",
    "a traction",
    "a pressure",
    "gravity_m_per_s2",
    "radius_m of a tool",
    "friction_coefficient of a tool",
    "start_position_m of a tool",
    "stiffness_n_per_m of a coupling",
    "damping_n_s_per_m of a coupling",
    "mass_kg of a tool",
    "tick_period_s",
    "step_safety or stretch_allowance",
    "mass_damping_per_s",
    "solver_tolerance",
    "sleep_tolerance_m",
];

/// Builds the model with one bad number in one of [`FIELDS`]; the error's text if it was refused.
fn spoilt(spec: &ModelSpec, field: usize, bad: f64, random: &mut Random) -> Result<(), String> {
    let mut spec = spec.clone();
    let axis = random.below(3);
    let text = |error: &dyn std::fmt::Display| error.to_string();
    match field {
        0 => {
            let mut positions = rig::solid(&spec).mesh.positions_m().to_vec();
            let node = random.below(positions.len());
            positions[node][axis] = bad;
            return TetMesh::new(positions, rig::solid(&spec).mesh.tets().to_vec()).map(|_| ()).map_err(|e| text(&e));
        }
        1 => return Lame::from_young_poisson(bad, 0.3).map(|_| ()).map_err(|e| text(&e)),
        2 => return Lame::from_young_poisson(1e3, bad).map(|_| ()).map_err(|e| text(&e)),
        _ => spoil_field(&mut spec, field, bad, axis, random),
    }
    Model::build(spec).map(|_| ()).map_err(|e| text(&e))
}

fn spoil_field(spec: &mut ModelSpec, field: usize, bad: f64, axis: usize, random: &mut Random) {
    let tool = random.below(spec.tools.len());
    let coupling = &mut spec.tools[1].coupling;
    let Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg } = coupling else { return };
    let BodySpec::Tet(body) = &mut spec.body else { return };
    let region = &mut body.solid.regions[0];
    match field {
        3 => region.material.lame.lambda_pa = bad,
        4 => region.material.lame.mu_pa = bad,
        5 => region.material.viscosity.phi_pa_s = bad,
        6 => region.material.viscosity.psi_pa_s = bad,
        7 => region.density_kg_per_m3 = bad,
        8..=10 => spoil_load(&mut spec.loads[field - 8], bad, axis),
        11 => spec.gravity_m_per_s2[axis] = bad,
        12 => spec.tools[tool].radius_m = bad,
        13 => spec.tools[tool].friction_coefficient = bad,
        14 => spec.tools[tool].start_position_m[axis] = bad,
        15 => *stiffness_n_per_m = bad,
        16 => *damping_n_s_per_m = bad,
        17 => *mass_kg = bad,
        18 => spec.settings.tick_period_s = bad,
        19 if axis == 0 => spec.settings.step_safety = bad,
        19 => spec.settings.stretch_allowance = bad,
        20 => spec.settings.mass_damping_per_s = bad,
        21 => spec.settings.solver_tolerance = bad,
        _ => spec.settings.sleep_tolerance_m = bad,
    }
}

fn spoil_load(load: &mut LoadSpec, bad: f64, axis: usize) {
    match load {
        LoadSpec::NodalForces(forces) => {
            if let Some((_, force_n)) = forces.first_mut() {
                force_n[axis] = bad;
            }
        }
        LoadSpec::Traction { traction_pa, .. } => traction_pa[axis] = bad,
        LoadSpec::Pressure { pressure_pa, .. } => *pressure_pa = bad,
    }
}
