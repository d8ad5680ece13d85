//! Random mass-spring surfaces beneath tools that press, drag, jump and leave: stiff and soft, of uneven masses,
//! refined in any way, most of them asleep or none.
use super::{
    Measured, Options, Outcome,
    rig::{Drive, Rig, hold},
};
use crate::random::Random;
use glam::DVec3;
use miette::{IntoDiagnostic, Result, bail};
use palpate_physics::{
    BodySpec, ModelSpec, PointForce, Settings,
    bodies::mass_spring::{
        AnchorLaw, MassSpringSpec, Refinement, Refining, SpringSpec, anchor::Layer, net::hexagonal_patch,
        region::Constants,
    },
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
};
use std::f64::consts::PI;

pub(super) const CRITERION: &str = "random surfaces of springs (K_m/K_h 1e-2 to 1e2): no NaN or quarantine, energy balance within 5 % of what moved, at rest again and coarse when tools have left";

const BALANCE: f64 = 0.05;
const TICKS: u32 = 400;
/// After which all is to be at rest.
const LATER_TICKS: u32 = 2500;

#[derive(Debug, Default)]
struct Found {
    /// Energy out of nowhere, and to nowhere, over what moved.
    gain: f64,
    loss: f64,
    /// What is held at last, over the most that moved.
    left: f64,
    refined: usize,
    refined_at_last: usize,
    refused: Option<u32>,
    touched: bool,
    substeps: u32,
}

pub(super) fn run(options: &Options) -> Result<Outcome> {
    let bodies = options.pick(12, 150, 5000);
    let mut outcome = Outcome::passing();
    let (mut gain, mut loss, mut left, mut touched, mut refined, mut substeps) = (0.0_f64, 0.0_f64, 0.0_f64, 0, 0, 0);
    for number in 0..bodies {
        let seed = options.seed.wrapping_add(number);
        let found = one(seed)?;
        outcome.demand(found.refused.is_none(), || format!("seed {seed}: tick {:?} was refused", found.refused));
        outcome.demand(found.refined_at_last == 0, || format!("seed {seed}: still refined when tools have left"));
        (gain, loss, left) = (gain.max(found.gain), loss.max(found.loss), left.max(found.left));
        touched += u32::from(found.touched);
        refined = refined.max(found.refined);
        substeps = substeps.max(found.substeps);
        if found.gain.max(found.loss) > BALANCE {
            outcome.broken.push(format!("seed {seed}: balance {:.1e}, {:.1e}", found.gain, -found.loss));
        }
    }
    outcome.push(Measured::value("bodies", bodies as f64, "1"));
    outcome.push(Measured::value("bodies that a tool touched", f64::from(touched), "1"));
    outcome.push(Measured::value("most refined nodes", refined as f64, "1"));
    outcome.push(Measured::value("most substeps", f64::from(substeps), "1/tick"));
    outcome.push(Measured::bounded("most energy from nowhere over what moved", gain, "1", BALANCE));
    outcome.push(Measured::bounded("most energy to nowhere over what moved", loss, "1", BALANCE));
    outcome.push(Measured::bounded("energy left when tools have left, over what moved", left, "1", 1e-6));
    Ok(outcome)
}

fn one(seed: u64) -> Result<Found> {
    let mut random = Random::new(seed);
    let edge_m = random.log_within(1e-3, 1e-2);
    let spec = body(edge_m, &mut random)?;
    let BodySpec::MassSpring(springs) = &spec.body else { bail!("the body is not one of springs") };
    let anchor_n_per_m = springs.springs.coarse.anchor_n_per_m;
    let mut rig = Rig::new(spec.clone())?;
    let mut drive = Drive::still(&rig.model);
    let jumps = random.chance(0.3);
    let ways: Vec<[DVec3; 2]> = spec
        .tools
        .iter()
        .map(|tool| {
            let along = random.vector() * DVec3::new(5.0, 5.0, 0.0) * edge_m;
            let down = -DVec3::Z
                * (tool.start_position_m.z - tool.radius_m + random.within(0.1, 0.6) * edge_m.min(tool.radius_m));
            [down, along]
        })
        .collect();
    let mut found = Found { substeps: rig.model.substeps(), ..Found::default() };
    let (mut moved_j, mut gain_j, mut loss_j) = (f64::MIN_POSITIVE, 0.0_f64, 0.0_f64);
    for tick in 1..=TICKS + LATER_TICKS {
        let phase = (f64::from(tick) / f64::from(TICKS)).min(1.0);
        for ((target, tool), [down, along]) in drive.tools.iter_mut().zip(&spec.tools).zip(&ways) {
            let pressed = if jumps { f64::from(u32::from((0.2..0.8).contains(&phase))) } else { (PI * phase).sin() };
            let way = *down * pressed.min(1.0) + *along * (3.0 * PI * phase).sin() * f64::from(u32::from(phase < 1.0));
            *target = ToolTarget::at(tool.start_position_m + way);
        }
        drive.point_forces.clear();
        if tick <= TICKS && random.chance(0.05) {
            let node = random.below(rig.model.surface().nodes.len()) as u32;
            drive.point_forces.push(PointForce { node, force_n: random.vector() * (0.1 * anchor_n_per_m * edge_m) });
        }
        if let Some(quarantine) = rig.tick(&drive).quarantined {
            found.refused = Some(quarantine.tick as u32);
            return Ok(found);
        }
        let energies = rig.energies();
        for energy_j in [energies.kinetic_j, energies.elastic_j, energies.external_work_j, energies.dissipated_j] {
            moved_j = moved_j.max(energy_j.abs());
        }
        (gain_j, loss_j) = (gain_j.max(energies.balance_j()), loss_j.max(-energies.balance_j()));
        found.touched |= rig.state.mechanical.tools.iter().any(|tool| tool.contacts > 0);
        found.refined = found.refined.max(refined_nodes(&rig));
    }
    found.refined_at_last = refined_nodes(&rig);
    (found.gain, found.loss) = (gain_j / moved_j, loss_j / moved_j);
    found.left = rig.energies().held_j() / moved_j;
    Ok(found)
}

fn refined_nodes(rig: &Rig) -> usize {
    let both = rig.state.body.as_mass_spring().zip(rig.model.body().as_mass_spring());
    both.map_or(0, |(springs, body)| springs.refined_nodes(body))
}

fn body(edge_m: f64, random: &mut Random) -> Result<ModelSpec> {
    let surface = hexagonal_patch(10, edge_m).into_diagnostic()?;
    let vertices = surface.positions_m().len();
    let lift_m = 2.0 * edge_m * random.unit();
    let bent = surface.positions_m().iter().map(|p| *p + DVec3::Z * (lift_m * (p.x / (5.0 * edge_m)).sin()));
    let bent = bent.map(|p| p + random.vector() * (0.15 * edge_m)).collect();
    let surface = surface.moved(bent).into_diagnostic()?;
    let boundary = (0..vertices as u32).filter(|&vertex| surface.is_boundary(vertex)).collect();
    let anchor_n_per_m = random.log_within(1.0, 100.0);
    let coarse = Constants { mesh_n_per_m: anchor_n_per_m * random.log_within(1e-2, 1e2), anchor_n_per_m };
    let [mesh, anchor] = [random.within(0.3, 1.5), random.within(0.1, 1.0)];
    let fine = Constants { mesh_n_per_m: coarse.mesh_n_per_m * mesh, anchor_n_per_m: anchor_n_per_m * anchor };
    let mass_kg = random.log_within(1e-5, 1e-3);
    let uneven = random.within(1.0, 10.0);
    let layers =
        [(0.3, 1.0), (1.0, 5.0)].map(|(part, stiffness_ratio)| Layer { thickness_m: part * edge_m, stiffness_ratio });
    let anchor_law = match random.below(3) {
        0 => AnchorLaw::Linear,
        1 => AnchorLaw::cubic(random.log_within(0.1, 10.0) / (edge_m * edge_m)).into_diagnostic()?,
        _ => AnchorLaw::layers(&layers).into_diagnostic()?,
    };
    let springs = SpringSpec {
        coarse,
        fine,
        anchor_law,
        mass_kg: (0..vertices).map(|_| mass_kg * random.log_within(1.0, uneven + 1e-9)).collect(),
        held: Vec::new(),
        most_awake: if random.chance(0.5) { vertices } else { 100 + random.below(100) },
        most_refined: 400,
        surface,
    };
    let refinement = random.chance(0.8).then(|| Refinement {
        rings: 1 + random.below(4) as u32,
        follows_dent: random.chance(0.3),
        blend_s: random.log_within(5e-3, 0.2),
        by: Refining::ByTools,
    });
    let tools = 1 + random.below(2);
    Ok(ModelSpec {
        body: BodySpec::MassSpring(MassSpringSpec { springs, refinement, table: None }),
        prescribed: vec![hold("boundary", boundary)],
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: (0..tools).map(|number| tool(number, edge_m, random)).collect(),
        settings: Settings { mass_damping_per_s: random.within(20.0, 100.0), ..Settings::default() },
    })
}

fn tool(number: usize, edge_m: f64, random: &mut Random) -> ToolSpec {
    let radius_m = edge_m * random.log_within(0.6, 3.0);
    let coupling = if random.chance(0.7) {
        Coupling::Rigid
    } else {
        Coupling::Spring { stiffness_n_per_m: 200.0, damping_n_s_per_m: 1.0, mass_kg: 0.05 }
    };
    let beside_m = random.vector() * DVec3::new(3.0, 3.0, 0.0) * edge_m;
    ToolSpec {
        name: format!("tool {number}"),
        shape: ToolShape::Sphere,
        radius_m,
        coupling,
        friction_coefficient: random.within(0.0, 0.6),
        start_position_m: beside_m + DVec3::Z * (radius_m + 8.0 * edge_m),
    }
}
