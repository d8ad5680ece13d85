//! Finds which particles are awake in an equilibrium.
//!
//! They are those that a tool would keep awake where it rests, by the rules of the loop (`hybrid::switching`): a ball
//! about the vertex of the skin nearest to the tool, or nearest to where it is deepest. So are those that loads want
//! (`hybrid::load_claims`). Where there is no room for all of a claim, the nearest are awake.
use super::awakened::Awakened;
use crate::{
    bodies::hybrid::{
        HybridBody, Waking,
        load_claims::{LoadClaims, NearestParticles},
        switching::{FOLLOW, GAP},
    },
    contact::{ToolSpec, deepest_m},
    statics::{AwakeParticles, equilibrium::Goal},
    tick::Environment,
};
use glam::DVec3;
use std::collections::BTreeSet;

/// What keeps particles awake.
#[derive(Debug, Clone)]
pub(super) enum Claims {
    /// These particles are awake, whatever acts on the body.
    Given(Vec<u32>),
    /// Tools keep particles awake, by the middles of their balls at rest (m), and so do loads with these factors.
    ByRule { reach_m: f64, balls: Vec<Option<DVec3>>, loads: LoadClaims, load_factors: Vec<f64> },
}

impl Claims {
    /// Returns the claims of the loads and tools of a goal, before a tool came near.
    pub(super) fn of(environment: &Environment, body: &HybridBody, goal: &Goal<'_>) -> Self {
        if let Some(given) = goal.awake {
            let mut ids: Vec<u32> = given.iter().copied().filter(|&particle| body.may_wake(particle)).collect();
            ids.sort_unstable();
            ids.dedup();
            return Self::Given(ids);
        }
        let reach_m = match body.particles().waking {
            Waking::ByTools { reach_m } => reach_m,
            Waking::ByHand => return Self::Given(Vec::new()),
        };
        let loads = LoadClaims::new(environment, body, reach_m);
        let (balls, load_factors) = (vec![None; environment.tools.len()], goal.load_factors.to_vec());
        Self::ByRule { reach_m, balls, loads, load_factors }
    }

    /// Looks at where tools are in an equilibrium, with these forces (N) on them; returns the particles that are to be
    /// awake, ascending.
    pub(super) fn look(&mut self, awakened: &Awakened<'_>, unknowns: &[DVec3], contact_n: &[DVec3]) -> Vec<u32> {
        let (environment, body) = (awakened.environment, awakened.body);
        let (most, spacing_m) = (body.particles().most_active, body.particles().spacing_m);
        let (reach_m, balls, loads, load_factors) = match self {
            Self::Given(ids) => return ids.clone(),
            Self::ByRule { reach_m, balls, loads, load_factors } => (*reach_m, balls, loads, load_factors),
        };
        let configuration = awakened.configuration(unknowns);
        let (skin_m, tools_m) = configuration.split_at(awakened.vertices());
        let all = balls.iter_mut().zip(tools_m).zip(&environment.tools).zip(contact_n);
        for (((ball, centre_m), tool), contact_n) in all {
            let near_m = (GAP * tool.radius_m).max(GAP * spacing_m);
            let touch = TouchingTool { centre_m: *centre_m, radius_m: tool.radius_m, contact_force_n: *contact_n };
            *ball = ball_of(*ball, body, skin_m, touch, near_m, FOLLOW * spacing_m);
        }
        let claims = (balls.iter().flatten().count() + loads.count(load_factors)).max(1);
        let room = most / claims;
        let mut wanted = BTreeSet::new();
        for middle_m in balls.iter().flatten() {
            let mut found = Vec::new();
            body.partition().particles_within(*middle_m, reach_m, |particle, distance_sq| {
                if body.may_wake(particle) {
                    found.push((distance_sq, particle));
                }
            });
            take_nearest(&mut found, room, &mut wanted);
        }
        let mut of_loads = Vec::new();
        loads.want(
            load_factors,
            room,
            &mut NearestParticles::with_room(body.partition().particle_count()),
            &mut of_loads,
        );
        wanted.extend(of_loads);
        wanted.into_iter().collect()
    }

    /// Returns these particles with what keeps them awake. Every sample of a tool's axis has the ball of its tool.
    pub(super) fn awake(&self, environment: &Environment, ids: Vec<u32>) -> AwakeParticles {
        let Self::ByRule { reach_m, balls, loads, load_factors } = self else {
            return AwakeParticles { ids, ..AwakeParticles::default() };
        };
        let of_tool =
            |(ball, tool): (&Option<DVec3>, &ToolSpec)| std::iter::repeat_n(*ball, tool.axis_sample_count(*reach_m));
        let middles_m = balls.iter().zip(&environment.tools).flat_map(of_tool).collect();
        AwakeParticles { ids, middles_m, spread_loads: loads.spread_loads(load_factors) }
    }
}

fn take_nearest(found: &mut [(f64, u32)], room: usize, wanted: &mut BTreeSet<u32>) {
    found.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    wanted.extend(found.iter().take(room).map(|(_, particle)| *particle));
}

/// A tool at rest, and the force of the body on it.
#[derive(Debug, Clone, Copy)]
struct TouchingTool {
    centre_m: DVec3,
    radius_m: f64,
    contact_force_n: DVec3,
}

/// Returns the middle (m) of the ball of a tool at rest: the loop's ball, for a tool that stands still.
fn ball_of(
    ball: Option<DVec3>,
    body: &HybridBody,
    skin_m: &[DVec3],
    TouchingTool { centre_m, radius_m, contact_force_n }: TouchingTool,
    near_m: f64,
    follow_m: f64,
) -> Option<DVec3> {
    let deepest_m = deepest_m(centre_m, radius_m, contact_force_n);
    let from_m = deepest_m.unwrap_or(centre_m);
    let distances = skin_m.iter().map(|y| y.distance(from_m)).zip(body.skin_rest_m());
    let (distance_m, rest_m) = distances.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let gap_m = if deepest_m.is_some() { 0.0 } else { distance_m - radius_m };
    match ball {
        Some(_) if gap_m > 2.0 * near_m => None,
        Some(own_m) if gap_m >= near_m || own_m.distance(*rest_m) <= follow_m => Some(own_m),
        None if gap_m >= near_m => None,
        _ => Some(*rest_m),
    }
}
