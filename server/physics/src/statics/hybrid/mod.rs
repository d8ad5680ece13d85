//! Equilibrium of a hybrid body: coarse nodes, the particles that are awake, and tools on springs.
//!
//! As for bodies of tets the goal is reached in stages. After each stage the solver finds which particles are to be
//! awake; where those are others, it finds the stage's equilibrium again with them. So the result does not depend on
//! what was awake on the way, but for where a tool's ball stays.
//!
//! - `awake.rs`: which particles
//! - `awakened.rs`: the body with them
//! - `stage.rs`: forces, tangent and potential at a fraction of the goal
//! - `newton.rs`: Newton's method at one stage
mod awake;
mod awakened;
mod newton;
mod stage;

use super::{
    Progress, SolveError, StaticSettings, StaticSolution,
    equilibrium::Goal,
    load_path,
    newton::{Failure, Stop},
};
use crate::{bodies::hybrid::HybridBody, contact::RestingContact, settings::PrescribedSpec, tick::Environment};
use awake::Claims;
use awakened::Awakened;
use glam::{BVec3, DVec3};
use newton::Solver;
use stage::Stage;
use std::ops::ControlFlow;

/// Largest number of sets of awake particles that are tried at one stage.
const MAX_LOOKS: usize = 20;

/// An equilibrium on the way to the goal.
#[derive(Clone)]
struct Reached {
    unknowns: Vec<DVec3>,
    claims: Claims,
    ids: Vec<u32>,
    contact: RestingContact,
}

/// Solves from rest to the goal.
pub(super) fn solve(
    environment: &Environment,
    body: &HybridBody,
    goal: &Goal<'_>,
    settings: &StaticSettings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> Result<StaticSolution, SolveError> {
    let largest = load_path::largest_step(environment, goal)?;
    let mut solver = Solver { settings, history: Vec::new(), linear_systems: 0, progress };
    let asleep = Awakened::new(environment, body, &[]);
    let mut claims = Claims::of(environment, body, goal);
    let ids = claims.look(&asleep, &asleep.at_rest(), &vec![DVec3::ZERO; environment.tools.len()]);
    let mut awakened = Awakened::new(environment, body, &ids);
    let unknowns = awakened.at_rest();
    let contact = RestingContact::appear(&environment.contact, &awakened.configuration(&unknowns));
    let mut at = Reached { unknowns, claims, ids, contact };
    let (stage, load_steps) = load_path::raise(largest, settings, |fraction| {
        let found = stage_from(&mut awakened, &mut solver, goal, fraction, &at);
        let (next, stage) = found.map_err(|stop| (stop, solver.history.len() as u32))?;
        at = next;
        Ok(stage)
    })?;
    Ok(solution(&awakened, solver, &stage, at, load_steps))
}

/// Finds the equilibrium at a fraction of the goal, with the particles awake that it keeps awake itself.
fn stage_from(
    awakened: &mut Awakened<'_>,
    solver: &mut Solver<'_>,
    goal: &Goal<'_>,
    fraction: f64,
    from: &Reached,
) -> Result<(Reached, Stage), Stop> {
    let mut now = from.clone();
    if awakened.patch.active() != now.ids {
        *awakened = Awakened::new(awakened.environment, awakened.body, &now.ids);
    }
    // A tool may be deepest at one vertex with these awake, and at another with those: it keeps what it came to first.
    let mut tried = vec![now.ids.clone()];
    loop {
        let (mut stage, begin) = Stage::enter(awakened, goal, fraction, &now.unknowns, &now.contact);
        now.unknowns = settle(awakened, solver, goal, &mut stage, &begin)?;
        now.contact = stage.contact.clone();
        let pressing = stage.forces(awakened, &now.unknowns).tools;
        let contact_n: Vec<DVec3> = pressing.iter().map(|pressing| pressing.force_n).collect();
        let wanted = now.claims.look(awakened, &now.unknowns, &contact_n);
        if tried.contains(&wanted) || tried.len() == MAX_LOOKS {
            return Ok((now, stage));
        }
        tried.push(wanted.clone());
        let next = Awakened::new(awakened.environment, awakened.body, &wanted);
        now.unknowns = next.taking_over(awakened, &now.unknowns);
        now.ids = wanted;
        *awakened = next;
    }
}

/// Finds the equilibrium of a stage. A coupled tool that moves may come upon samples that it was not in front of when
/// it set out.
fn settle(
    awakened: &Awakened<'_>,
    solver: &mut Solver<'_>,
    goal: &Goal<'_>,
    stage: &mut Stage,
    begin: &[DVec3],
) -> Result<Vec<DVec3>, Stop> {
    let before = awakened.configuration(begin);
    let mut found = solver.equilibrate(awakened, goal, stage, begin.to_vec())?;
    for _ in 0..load_path::MAX_WIDENINGS {
        let now = awakened.configuration(&found);
        let Some(wider) = stage.contact.widened(&awakened.environment.contact, &before, &now) else { return Ok(found) };
        stage.contact = wider;
        found = solver.equilibrate(awakened, goal, stage, found)?;
    }
    Err(Stop::Step(Failure::Contact))
}

fn solution(
    awakened: &Awakened<'_>,
    solver: Solver<'_>,
    stage: &Stage,
    found: Reached,
    load_steps: u32,
) -> StaticSolution {
    let environment = awakened.environment;
    let forces = stage.forces(awakened, &found.unknowns);
    let (_, residual_n, relative_residual) = forces.residual(awakened);
    // The holder supplies what the other forces lack.
    let hold = |(free, f): (&BVec3, &DVec3)| DVec3::select(*free, DVec3::ZERO, -*f);
    let mut node_reactions_n: Vec<DVec3> = awakened.body.free().iter().zip(&forces.total_n()).map(hold).collect();
    awakened.body.move_reactions_to_faces(&mut node_reactions_n);
    let of_set = |set: &PrescribedSpec| {
        let sum: DVec3 = set.nodes.iter().map(|&n| node_reactions_n[n as usize]).sum();
        DVec3::select(BVec3::from_array(set.axes), sum, DVec3::ZERO)
    };
    StaticSolution {
        reactions_n: environment.prescribed.iter().map(of_set).collect(),
        tools: stage.tools_at_rest(awakened, &forces, &found.unknowns),
        iterations: solver.history.len() as u32,
        factorisations: 0,
        load_steps,
        residual_n,
        relative_residual,
        reference_n: forces.reference_n(),
        rounding_n: newton::rounding_n(awakened, &found.unknowns),
        stable: Solver::is_stable(awakened, stage, &found.unknowns),
        inverted_tets: awakened.patch.inverted(&awakened.field(&found.unknowns)),
        awake: found.claims.awake(environment, found.ids),
        history: solver.history,
        x: found.unknowns[..awakened.entries()].to_vec(),
        node_reactions_n,
    }
}
