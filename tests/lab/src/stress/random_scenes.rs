//! Scenes made at random: meshes, materials, loads, tools and blows. Scene k of a run has the seed `--seed` + k, so that
//! `palpate-lab stress random-scenes --seed N` begins with the scene that failed as N.
use super::{Measured, Options, Outcome, meshes, rig, rig::Drive, rig::Rig};
use crate::bodies::material;
use crate::methods::tet_body;
use crate::random::Random;
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    LoadSpec, ModelSpec, PointForce, TetMesh,
    contact::{Coupling, LARGEST_TRIANGLE, ToolShape, ToolSpec},
    material::{Law, Viscosity},
};
use palpate_scene::shapes;
use std::panic::{AssertUnwindSafe, catch_unwind};

pub(super) const CRITERION: &str = "random meshes, materials, loads, tools: no panic, no NaN, no quarantine, energy balance within 5 % of what moved, leapfrog's own second-order term apart";

/// Largest error of the energy balance over the largest energy that moved.
const BALANCE: f64 = 0.05;

/// What one scene did.
#[derive(Debug, Clone, Default)]
struct Found {
    /// What it was, for messages.
    what: String,
    /// Most energy that came from nowhere, over the largest energy that moved.
    gain: f64,
    /// Most energy that went nowhere, over the same.
    loss: f64,
    /// Tick that was refused.
    refused: Option<u32>,
    finite: bool,
    touched: bool,
    min_j: f64,
    substeps: u32,
    repeated: u32,
}

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let scenes = options.pick(12, 150, 10_000);
    let mut outcome = Outcome::passing();
    let (mut gain, mut loss, mut touched, mut inverted, mut most_substeps) = (0.0_f64, 0.0_f64, 0, 0, 0);
    let mut repeated = 0;
    for scene in 0..scenes {
        let seed = options.seed.wrapping_add(scene);
        match catch_unwind(AssertUnwindSafe(|| one(options, seed))) {
            Ok(found) => {
                let found = found?;
                (gain, loss) = (gain.max(found.gain), loss.max(found.loss));
                touched += u32::from(found.touched);
                inverted += u32::from(found.min_j <= 0.0);
                repeated += found.repeated;
                most_substeps = most_substeps.max(found.substeps);
                outcome.demand(found.finite, || format!("seed {seed}: not finite"));
                outcome.demand(found.refused.is_none(), || {
                    format!("seed {seed}: quarantined at tick {}", found.refused.unwrap_or(0))
                });
                outcome.demand(found.gain <= BALANCE && found.loss <= BALANCE, || {
                    format!(
                        "seed {seed}: gains {:.3}, loses {:.3} of what moved ({})",
                        found.gain, found.loss, found.what
                    )
                });
            }
            Err(_) => outcome.demand(false, || format!("seed {seed}: panicked")),
        }
    }
    outcome.push(Measured::value("scenes", scenes as f64, "1"));
    outcome.push(Measured::value("scenes in which a tool touched", f64::from(touched), "1"));
    outcome.push(Measured::value("scenes with an inverted tet at the end", f64::from(inverted), "1"));
    outcome.push(Measured::value("most substeps", f64::from(most_substeps), "1/tick"));
    outcome.push(Measured::value("ticks taken back", f64::from(repeated), "ticks"));
    outcome.push(Measured::bounded("most energy from nowhere over what moved", gain, "1", BALANCE));
    outcome.push(Measured::bounded("most energy to nowhere over what moved", loss, "1", BALANCE));
    Ok(outcome)
}

/// Ticks of a scene.
const TICKS: u32 = 150;

fn one(options: &Options, seed: u64) -> Result<Found> {
    let mut random = Random::new(seed);
    let spec = scene(options, &mut random)?;
    let (young_pa, size_m) =
        (rig::solid(&spec).regions[0].material.lame.young_modulus_pa(), size_m(&rig::solid(&spec).mesh));
    let mut rig = Rig::new(spec)?;
    let mut drive = Drive::still(&rig.model);
    let ways: Vec<DVec3> = rig.model.tools().iter().map(|tool| way(tool, size_m, &mut random)).collect();
    let mut found = Found { finite: true, substeps: rig.model.substeps(), what: what(&rig), ..Found::default() };
    let mut moved_j = f64::MIN_POSITIVE;
    let (mut gain_j, mut loss_j) = (0.0_f64, 0.0_f64);
    for tick in 1..=TICKS {
        let phase = f64::from(tick) / f64::from(TICKS);
        for ((target, tool), way) in drive.tools.iter_mut().zip(rig.model.tools()).zip(&ways) {
            let before = target.position_m;
            target.position_m = tool.start_position_m + *way * (std::f64::consts::PI * phase).sin();
            target.velocity_m_per_s = (target.position_m - before) / 1e-3;
        }
        drive.load_factors.fill((3.0 * phase).min(1.0));
        drive.point_forces.clear();
        if random.chance(0.2) {
            let node = random.below(rig.state.mechanical.x.len()) as u32;
            let force_n = random.vector() * 1e-4 * young_pa * size_m * size_m;
            drive.point_forces.push(PointForce { node, force_n });
        }
        let report = rig.tick(&drive);
        found.repeated += u32::from(report.repeated > 0);
        let energies = rig.energies();
        found.finite &= energies.balance_j().is_finite() && rig.is_finite();
        if report.quarantined.is_some() {
            found.refused = Some(tick);
            break;
        }
        for energy_j in [energies.kinetic_j, energies.elastic_j, energies.external_work_j, energies.dissipated_j] {
            moved_j = moved_j.max(energy_j.abs());
        }
        // What leapfrog holds in the moment beyond the work is no gain.
        let own_j = rig.leapfrog_excess_j().max(0.0);
        (gain_j, loss_j) = (gain_j.max(energies.balance_j() - own_j), loss_j.max(-energies.balance_j()));
        found.touched |= rig.state.mechanical.tools.iter().any(|tool| tool.contacts > 0);
    }
    (found.gain, found.loss) = (gain_j / moved_j, loss_j / moved_j);
    found.min_j = rig.min_volume_ratio();
    Ok(found)
}

fn what(rig: &Rig) -> String {
    let (model, substeps) = (&rig.model, rig.model.substeps());
    let body = tet_body(model);
    let material = body.material_of(0);
    let (law, poisson, psi) = (material.law, material.lame.poisson_ratio(), material.viscosity.psi_pa_s);
    let (loads, tools, tets) = (model.loads().len(), model.tools().len(), body.mesh().tets().len());
    format!(
        "{law:?}, nu {poisson:.2}, psi {psi:.2} Pa s, {loads} loads, {tools} tools, {tets} tets, {substeps} substeps"
    )
}

fn size_m(mesh: &TetMesh) -> f64 {
    let (low, high) = mesh.bounds_m();
    (high - low).min_element()
}

/// Block, jittered block, slivered block, ellipsoid shell or ventricle, of 10 to 100 mm.
fn mesh(random: &mut Random) -> Result<TetMesh> {
    let scale = random.log_within(0.5, 2.0);
    let shell = |mesh: Result<shapes::Shape, shapes::ShapeError>| mesh.map(|shape| shape.mesh).into_diagnostic();
    let tets = 300 + random.below(500) as u32;
    match random.below(5) {
        0 => {
            let mut axis = || meshes::even(0.0, 0.04 * scale, 2 + random.below(4));
            meshes::bricks(&axis(), &axis(), &axis())
        }
        1 => meshes::jittered(&meshes::block(4)?, 3e-3, random),
        2 => meshes::with_sliver(&meshes::block(4)?, random.within(1.0, 10.0)),
        3 => {
            let outer = DVec3::new(random.within(15e-3, 30e-3), random.within(15e-3, 30e-3), 30e-3) * scale;
            shell(shapes::ellipsoid_shell(outer * random.within(0.5, 0.7), outer, tets))
        }
        _ => shell(shapes::ventricle(
            (20e-3 * scale, 40e-3 * scale),
            (13e-3 * scale, 33e-3 * scale),
            random.within(0.0, 10e-3) * scale,
            tets,
        )),
    }
}

fn scene(options: &Options, random: &mut Random) -> Result<ModelSpec> {
    let mesh = mesh(random)?;
    let (low, high) = mesh.bounds_m();
    let young_pa = random.log_within(1e3, 100e3);
    let law = [Law::StableNeoHookean, Law::FixedCorotated, Law::StVenantKirchhoff][random.below(3)];
    let mut spec = rig::body(options, mesh, material(law, young_pa, random.within(0.0, 0.49))?);
    if random.chance(0.5) {
        // Relaxation times of up to a millisecond.
        let most = 1e-3 * young_pa;
        let viscosity = Viscosity { phi_pa_s: most * random.unit(), psi_pa_s: most * random.unit() };
        rig::solid_mut(&mut spec).regions[0].material.viscosity = viscosity;
    }
    rig::solid_mut(&mut spec).regions[0].density_kg_per_m3 = random.within(500.0, 2000.0);
    let held = meshes::nodes_where(&rig::solid(&spec).mesh, |p| p.z < low.z + 0.15 * (high.z - low.z));
    spec.prescribed = vec![rig::hold("below", held)];
    if random.chance(0.5) {
        spec.gravity_m_per_s2 = random.vector() * 9.81;
    }
    if random.chance(0.7) {
        let above = low.z + random.within(0.5, 0.8) * (high.z - low.z);
        let triangles = meshes::triangles_where(&rig::solid(&spec).mesh, |p| p.z > above)?;
        let most_pa = 0.05 * young_pa;
        spec.loads.push(if random.chance(0.5) {
            LoadSpec::Traction { triangles, traction_pa: random.vector() * most_pa }
        } else {
            LoadSpec::Pressure {
                triangles,
                pressure_pa: random.within(-most_pa, most_pa),
                follower: random.chance(0.5),
            }
        });
    }
    tools(&mut spec, random)?;
    Ok(spec)
}

/// Up to two spheres beside the body, as small as its surface allows or larger.
fn tools(spec: &mut ModelSpec, random: &mut Random) -> Result<()> {
    let surface = palpate_physics::Surface::of(&rig::solid(spec).mesh).into_diagnostic()?;
    let longest_m = (0..rig::solid(spec).mesh.tets().len())
        .map(|tet| rig::solid(spec).mesh.longest_edge_m(tet))
        .fold(0.0, f64::max);
    let least_m = longest_m / LARGEST_TRIANGLE;
    let (low, high) = rig::solid(spec).mesh.bounds_m();
    for index in 0..random.below(3) {
        let radius_m = (least_m * 1.01).max(0.2 * size_m(&rig::solid(spec).mesh)) * random.within(1.0, 2.0);
        let side = DVec3::new(random.within(-1.0, 1.0), random.within(-1.0, 1.0), random.within(0.3, 1.0)).normalize();
        // Away from the middle until it is clear of every vertex.
        let middle = 0.5 * (low + high);
        let vertices = surface.nodes.iter().map(|&n| rig::solid(spec).mesh.positions_m()[n as usize]);
        let far_m = vertices.map(|p| (p - middle).dot(side)).fold(0.0, f64::max) + 1.05 * radius_m;
        let mass_kg = random.log_within(0.01, 0.1);
        let stiffness_n_per_m = random.log_within(50.0, 1000.0);
        let damping_n_s_per_m = random.within(0.2, 1.5) * (stiffness_n_per_m * mass_kg).sqrt();
        spec.tools.push(ToolSpec {
            name: format!("tool {index}"),
            shape: ToolShape::Sphere,
            radius_m,
            coupling: if random.chance(0.5) {
                Coupling::Rigid
            } else {
                Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg }
            },
            friction_coefficient: random.within(0.0, 0.8),
            start_position_m: middle + side * far_m,
        });
    }
    Ok(())
}

/// How far a tool goes and comes back: towards the body's middle, up to a third of the body deep.
fn way(tool: &ToolSpec, size_m: f64, random: &mut Random) -> DVec3 {
    let depth_m = 0.05 * tool.radius_m + random.within(0.0, 0.15) * size_m;
    // Start positions are off the middle along the side they came from; the body's middle is near the origin's plane.
    let towards = -tool.start_position_m.normalize_or(DVec3::Z);
    towards * depth_m + random.vector() * 0.02 * size_m
}
