//! Which particles loads and injected forces want awake, in the loop as in an equilibrium.
//!
//! A load presses as locally as a tool: it wants the particles within the reach of a ball of the vertices that it acts on,
//! the nearest first. Loads that want the same particles are one claim, so that a press which is given as a load per
//! vertex wakes what one load on the whole region wakes; injected forces are another claim together. A load that is spread
//! so wide that there is no room even for the particles within a spacing of it is left to the coarse tets: some of the
//! particles beneath it, chosen by nothing, would make a pattern of it.
use super::body::HybridBody;
use crate::{
    mesh::Surface,
    settings::LoadSpec,
    tick::{Environment, PointForce},
};
use std::collections::BTreeSet;

/// The claims of a body's loads.
#[derive(Debug, Clone, Default)]
pub(crate) struct LoadClaims {
    /// Loads that want the same particles, in groups; loads that are spread wide are in none.
    groups: Vec<Vec<LoadClaim>>,
    /// Loads that are spread wide.
    spread: Vec<usize>,
}

#[derive(Debug, Clone)]
struct LoadClaim {
    load: usize,
    /// Particles that the load wants, each with its squared distance (m²) from the nearest vertex that the load acts on.
    near: Vec<(f64, u32)>,
}

/// A set of particles, each with the smallest squared distance that was given for it, in buffers that are kept.
#[derive(Debug, Clone, Default)]
pub(crate) struct NearestParticles {
    /// Squared distance (m²) of every particle that is in the set, infinite for others.
    distance_sq: Vec<f64>,
    found: Vec<(f64, u32)>,
}

impl NearestParticles {
    /// Makes buffers for a body with so many particles.
    pub(crate) fn with_room(particles: usize) -> Self {
        Self { distance_sq: vec![f64::INFINITY; particles], found: Vec::with_capacity(particles) }
    }

    fn add(&mut self, particle: u32, distance_sq: f64) {
        let known = &mut self.distance_sq[particle as usize];
        if *known == f64::INFINITY {
            self.found.push((distance_sq, particle));
        }
        *known = known.min(distance_sq);
    }

    /// Adds the nearest `room` particles to a list, and empties the set.
    pub(crate) fn take(&mut self, room: usize, wanted: &mut Vec<u32>) {
        for (distance_sq, particle) in &mut self.found {
            *distance_sq = std::mem::replace(&mut self.distance_sq[*particle as usize], f64::INFINITY);
        }
        if self.found.len() > room {
            self.found.select_nth_unstable_by(room, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            self.found.truncate(room);
        }
        wanted.extend(self.found.iter().map(|(_, particle)| *particle));
        self.found.clear();
    }
}

impl LoadClaims {
    /// Finds the claims of all loads on a body whose balls reach so far (m).
    pub(crate) fn new(environment: &Environment, body: &HybridBody, reach_m: f64) -> Self {
        let (most, spacing_m) = (body.particles.most_active, body.particles.spacing_m);
        let mut claims = Self::default();
        // The group of every particle that is claimed.
        let mut group_of = vec![usize::MAX; body.partition.particle_count()];
        let mut nearest = NearestParticles::with_room(body.partition.particle_count());
        for (load, spec) in environment.loads.iter().enumerate() {
            for vertex in vertices(&environment.surface, spec) {
                nearest.add_near(body, vertex, reach_m);
            }
            let near = nearest.drain();
            let touching_sq = (spacing_m * (1.0 + 1e-9)).powi(2);
            if near.iter().filter(|(distance_sq, _)| *distance_sq <= touching_sq).count() > most {
                claims.spread.push(load);
                continue;
            }
            let others: BTreeSet<usize> = near
                .iter()
                .map(|(_, particle)| group_of[*particle as usize])
                .filter(|group| *group != usize::MAX)
                .collect();
            let group = others.first().copied().unwrap_or(claims.groups.len());
            if group == claims.groups.len() {
                claims.groups.push(Vec::new());
            }
            for other in others.into_iter().skip(1) {
                let joined = std::mem::take(&mut claims.groups[other]);
                for (_, particle) in joined.iter().flat_map(|claim| &claim.near) {
                    group_of[*particle as usize] = group;
                }
                claims.groups[group].extend(joined);
            }
            for (_, particle) in &near {
                group_of[*particle as usize] = group;
            }
            claims.groups[group].push(LoadClaim { load, near });
        }
        claims.groups.retain(|group| !group.is_empty());
        claims
    }

    /// Returns the number of loads with these factors that are spread too wide for particles to wake beneath them.
    pub(crate) fn spread_loads(&self, factors: &[f64]) -> u32 {
        self.spread.iter().filter(|&&load| acts(factors, load)).count() as u32
    }

    /// Returns the number of claims of loads with these factors.
    pub(crate) fn count(&self, factors: &[f64]) -> usize {
        self.groups.iter().filter(|group| group.iter().any(|claim| acts(factors, claim.load))).count()
    }

    /// Adds the particles that loads with these factors want, of each claim as many as there is room for.
    pub(crate) fn want(&self, factors: &[f64], room: usize, nearest: &mut NearestParticles, wanted: &mut Vec<u32>) {
        for group in &self.groups {
            for claim in group.iter().filter(|claim| acts(factors, claim.load)) {
                for &(distance_sq, particle) in &claim.near {
                    nearest.add(particle, distance_sq);
                }
            }
            nearest.take(room, wanted);
        }
    }

    /// Calls `tell` with the particle that each acting load wants most, until it returns true; returns whether it did.
    pub(crate) fn any_first(&self, factors: &[f64], mut tell: impl FnMut(u32) -> bool) -> bool {
        let acting = self.groups.iter().flatten().filter(|claim| acts(factors, claim.load));
        acting.filter_map(|claim| claim.near.first()).any(|(_, particle)| tell(*particle))
    }
}

impl NearestParticles {
    /// Adds the particles that may wake within a reach (m) of a vertex of the skin.
    fn add_near(&mut self, body: &HybridBody, vertex: u32, reach_m: f64) {
        body.partition.particles_within(body.skin_rest_m()[vertex as usize], reach_m, |particle, distance_sq| {
            if body.may_wake(particle) {
                self.add(particle, distance_sq);
            }
        });
    }

    /// Empties the set, and returns what was in it, the nearest first.
    fn drain(&mut self) -> Vec<(f64, u32)> {
        let of = |(_, particle): (f64, u32)| {
            (std::mem::replace(&mut self.distance_sq[particle as usize], f64::INFINITY), particle)
        };
        let mut near: Vec<(f64, u32)> = self.found.drain(..).map(of).collect();
        near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near
    }

    /// Adds the particles that injected forces want.
    pub(crate) fn add_points(
        &mut self,
        environment: &Environment,
        body: &HybridBody,
        points: &[PointForce],
        reach_m: f64,
    ) {
        for point in points.iter().filter(|point| environment.accepts(point)) {
            self.add_near(body, point.node, reach_m);
        }
    }
}

fn acts(factors: &[f64], load: usize) -> bool {
    factors.get(load).is_some_and(|factor| *factor != 0.0)
}

fn vertices(surface: &Surface, load: &LoadSpec) -> BTreeSet<u32> {
    match load {
        LoadSpec::NodalForces(forces) => forces.iter().map(|(vertex, _)| *vertex).collect(),
        LoadSpec::Traction { triangles, .. } | LoadSpec::Pressure { triangles, .. } => {
            triangles.iter().flat_map(|&triangle| surface.triangle_nodes(triangle as usize)).collect()
        }
    }
}
