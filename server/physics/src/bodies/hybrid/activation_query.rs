//! The activation query: the balls of the tools, and the particles that are to be awake in them.
use super::{
    body::HybridBody,
    carried_skin::SkinView,
    crushed_cells::CrushedCells,
    load_claims::{LoadClaims, NearestParticles},
    partition::NONE,
    projection::Projection,
    running::RunningPatch,
    scratch::HybridScratch,
    spec::{ParticleSpec, Waking},
    state::{HybridState, axis_sample_counts},
    switching::{Ball, FOLLOW, GAP, LOOK_EVERY_TICKS, QUERY_EVERY_TICKS},
};
use crate::{
    contact::{Known, Near, Skin},
    tick::{Environment, MechanicalState, PointForce},
};
use glam::DVec3;

/// Time (s) before its contact at which an approaching tool wakes particles.
const AHEAD_S: f64 = 0.05;
/// Time (s) before its contact at which a tool wakes particles at once, which is longer than it takes from one look to the
/// next.
const ARRIVES_S: f64 = 5e-3;
/// Number of ticks for which a tool has to be away until its ball is given up.
const AWAY_TICKS: u32 = 100;
/// Deviation over the spacing below which a particle may fall asleep.
const SETTLED: f64 = 0.04;
/// Deviation over the spacing from which a particle does not fall asleep, even where its room is needed: crushed cells
/// would change so much in the instant that the body is driven by it rather than by the tool.
const FAR_OFF: f64 = 0.5;

/// Updates the tools' balls.
pub(super) fn update_balls(
    environment: &Environment,
    view: &mut SkinView<'_>,
    body: &HybridBody,
    own: &mut HybridState,
    nearest_before: &mut [u32],
    state: &MechanicalState,
) {
    let MechanicalState { tools, contact, force_is_current, .. } = state;
    let spacing_m = body.particles.spacing_m;
    let fitted = force_is_current.then(|| contact.boxes());
    view.begin();
    let samples = tools.iter().zip(&environment.tools).zip(axis_sample_counts(body, &environment.tools));
    let samples =
        samples.flat_map(|((tool, spec), count)| tool.axis_samples(spec, count).map(move |sample| (sample, spec)));
    for (((sample, spec), ball), before) in samples.zip(&mut own.balls).zip(nearest_before) {
        let near_m = (GAP * spec.radius_m).max(GAP * spacing_m) + AHEAD_S * sample.speed_m_per_s;
        let known = Known { fitted, vertex: known_vertex(*before) };
        let Near { vertex, gap_m, .. } = sample.look(view, (near_m, environment.contact.covering_radius_m), known);
        *before = vertex.map_or(NONE, |(vertex, _)| vertex);
        match (ball.as_mut(), vertex) {
            (_, Some((vertex, _))) if gap_m < near_m => {
                let rest_m = body.skin_rest_m()[vertex as usize];
                let moved = ball.is_none_or(|ball| ball.rest_m.distance(rest_m) > FOLLOW * spacing_m);
                let rest_m = if moved { rest_m } else { ball.map_or(rest_m, |ball| ball.rest_m) };
                *ball = Some(Ball { rest_m, away_ticks: 0 });
            }
            (Some(own), _) if gap_m > 2.0 * near_m => {
                own.away_ticks += QUERY_EVERY_TICKS as u32;
                if own.away_ticks >= AWAY_TICKS {
                    *ball = None;
                }
            }
            (Some(own), _) => own.away_ticks = 0,
            (None, _) => {}
        }
    }
}

fn known_vertex(before: u32) -> Option<u32> {
    (before != NONE).then_some(before)
}

/// Returns whether a part of a tool moves by half a spacing between two looks.
pub(super) fn moves_quickly(environment: &Environment, body: &HybridBody, state: &MechanicalState) -> bool {
    let between_looks_s = LOOK_EVERY_TICKS as f64 * environment.settings.tick_period_s;
    let quick_m_per_s = 0.5 * body.particles.spacing_m / between_looks_s;
    let counts = axis_sample_counts(body, &environment.tools);
    state
        .tools
        .iter()
        .zip(&environment.tools)
        .zip(counts)
        .any(|((tool, spec), count)| tool.axis_samples(spec, count).any(|sample| sample.speed_m_per_s > quick_m_per_s))
}

/// Returns whether a tool touches skin whose particles sleep but may wake, or will touch it before a switch that began
/// with the next query would be done.
pub(super) fn meets_sleeping_skin(
    environment: &Environment,
    body: &HybridBody,
    scratch: &mut HybridScratch,
    state: &MechanicalState,
) -> bool {
    let MechanicalState { tools, contact, force_is_current, .. } = state;
    let fitted = force_is_current.then(|| contact.boxes());
    scratch.patch.displace(body, &state.x);
    let patch = &scratch.patch;
    let is_asleep = |vertex: u32| {
        let cell = body.vertex_point(vertex).cell;
        !patch.is_awake(cell) && body.partition.corners(cell as usize).iter().any(|&corner| body.may_wake(corner))
    };
    let mut view = SkinView::new(body, patch);
    view.begin();
    let counts = axis_sample_counts(body, &environment.tools);
    let mut first = 0;
    tools.iter().zip(&environment.tools).zip(counts).enumerate().any(|(index, ((tool, spec), count))| {
        let nearest_before = &mut scratch.query.nearest_before[first..first + count];
        first += count;
        let near_of = |speed_m_per_s: f64| (ARRIVES_S * speed_m_per_s).max(0.1 * body.particles.spacing_m);
        let fastest_m_per_s = tool.axis_samples(spec, count).map(|sample| sample.speed_m_per_s).fold(0.0, f64::max);
        let listed = contact.listed_within(index, near_of(fastest_m_per_s)).filter(|_| *force_is_current);
        let triangles = environment.contact.triangles();
        if listed.is_some_and(|list| !list.iter().any(|&listed| triangles[listed as usize].into_iter().any(is_asleep)))
        {
            return false;
        }
        tool.axis_samples(spec, count).zip(nearest_before).any(|(sample, before)| {
            let near_m = near_of(sample.speed_m_per_s);
            let known = Known { fitted, vertex: known_vertex(*before) };
            let near = sample.look(&view, (near_m, environment.contact.covering_radius_m), known);
            *before = near.vertex.map_or(*before, |(vertex, _)| vertex);
            near.gap_m < near_m && near.vertex.is_some_and(|(vertex, _)| is_asleep(vertex))
        })
    })
}

/// Returns whether a load or an injected force acts on skin whose particles sleep but may wake, where none did in the tick
/// before.
pub(super) fn begins_to_act(
    environment: &Environment,
    body: &HybridBody,
    own: &mut HybridState,
    scratch: &HybridScratch,
    state: &MechanicalState,
    points: &[PointForce],
) -> bool {
    let patch = &scratch.patch;
    let sleeps = |particle: u32| patch.active().binary_search(&particle).is_err();
    let is_asleep = |vertex: u32| {
        let corners = body.partition.corners(body.vertex_point(vertex).cell as usize);
        corners.iter().any(|&corner| body.may_wake(corner)) && corners.iter().all(|&corner| sleeps(corner))
    };
    let acts = scratch.query.load_claims.any_first(&state.load_factors, sleeps)
        || points.iter().any(|point| environment.accepts(point) && is_asleep(point.node));
    let did = std::mem::replace(&mut own.acts_on_sleeping_skin, acts);
    acts && !did
}

/// Returns the squared distance (m²) of a point `p` to the middles of balls, and to the lines between those of
/// neighbours, `a` and `b`:
/// ```text
/// |p − a − s (b − a)|²,   s = (p − a)·(b − a)/|b − a|², limited to 0 to 1
/// ```
fn distance_to_balls_sq(balls: &[Option<Ball>], at_m: DVec3) -> f64 {
    let (mut nearest_sq, mut before_m) = (f64::INFINITY, None);
    for ball in balls {
        let middle_m = ball.map(|ball| ball.rest_m);
        if let Some(to_m) = middle_m {
            let from_m = before_m.unwrap_or(to_m);
            let along_m = to_m - from_m;
            let part = (at_m - from_m).dot(along_m) / along_m.length_squared().max(f64::MIN_POSITIVE);
            nearest_sq = nearest_sq.min(at_m.distance_squared(from_m + along_m * part.clamp(0.0, 1.0)));
        }
        before_m = middle_m;
    }
    nearest_sq
}

/// What acts on a body beside tools.
#[derive(Debug, Clone, Copy)]
pub(super) struct Acting<'a> {
    /// Factor of every load.
    pub(super) load_factors: &'a [f64],
    /// Injected forces.
    pub(super) points: &'a [PointForce],
}

/// Returns the balls of every tool.
fn balls_of_tools<'a>(
    environment: &'a Environment,
    body: &'a HybridBody,
    own: &'a HybridState,
) -> impl Iterator<Item = &'a [Option<Ball>]> {
    axis_sample_counts(body, &environment.tools).scan(0, |first, count| {
        *first += count;
        Some(&own.balls[*first - count..*first])
    })
}

/// An activation query, which finds the particles that are to be awake, and buffers of switches.
#[derive(Debug, Clone, Default)]
pub(super) struct ActivationQuery {
    /// The vertex that each axis sample was nearest to last, [`NONE`] where none is known. It only tells where to search first.
    pub(super) nearest_before: Vec<u32>,
    /// Particles in a tool's balls, each with its squared distance (m²).
    pub(super) found: Vec<(f64, u32)>,
    /// Whether each particle is among these.
    pub(super) is_found: Vec<bool>,
    /// What loads want.
    pub(super) load_claims: LoadClaims,
    /// A buffer of what loads and injected forces want.
    pub(super) nearest: NearestParticles,
    /// Particles that are to be awake.
    pub(super) wanted: Vec<u32>,
    /// Active particles that no tool wants, each with its distance (m) from where it would be asleep.
    pub(super) unwanted: Vec<(f64, u32)>,
    pub(super) crushed_cells: CrushedCells,
    pub(super) moved: Vec<DVec3>,
    /// Impulses (kg m/s) transferred to coarse nodes.
    pub(super) impulses: Vec<DVec3>,
    /// Forces (N) transferred to coarse nodes.
    pub(super) transferred_n: Vec<DVec3>,
    pub(super) projection: Projection,
    /// Positions (m) of the coarse nodes before a switch, and their displacements (m) by it.
    pub(super) were_m: Vec<DVec3>,
    pub(super) shifts_m: Vec<DVec3>,
    /// Particles that were active before a switch.
    pub(super) left: Vec<u32>,
    /// Masses (kg) of the free nodes of tets in which particles fall asleep, 0 of others.
    pub(super) weights_kg: Vec<f64>,
}

impl ActivationQuery {
    pub(super) fn new(body: &HybridBody, environment: &Environment) -> Self {
        let (particles, tools) = (&body.particles, &environment.tools[..]);
        let load_claims = match particles.waking {
            Waking::ByHand => LoadClaims::default(),
            Waking::ByTools { reach_m } => LoadClaims::new(environment, body, reach_m),
        };
        let in_ball = match particles.waking {
            Waking::ByHand => 0,
            Waking::ByTools { reach_m } => (2.0 * reach_m / particles.spacing_m + 2.0).powi(3) as usize,
        };
        let most = particles.most_active;
        let most_wanted = tools.len().max(1) * most;
        Self {
            nearest_before: vec![NONE; axis_sample_counts(body, tools).sum()],
            found: Vec::with_capacity(
                in_ball
                    .saturating_mul(axis_sample_counts(body, tools).max().unwrap_or_default())
                    .min(body.partition.particle_count()),
            ),
            is_found: vec![false; body.partition.particle_count()],
            load_claims,
            nearest: NearestParticles::with_room(body.partition.particle_count()),
            wanted: Vec::with_capacity(most_wanted),
            unwanted: Vec::with_capacity(most),
            crushed_cells: CrushedCells::new(body),
            moved: Vec::with_capacity(most),
            impulses: Vec::with_capacity(body.node_count() + most),
            transferred_n: Vec::with_capacity(body.node_count()),
            projection: Projection::with_room(body, most),
            were_m: Vec::with_capacity(body.node_count()),
            shifts_m: Vec::with_capacity(body.node_count()),
            left: Vec::with_capacity(most),
            weights_kg: Vec::with_capacity(body.node_count()),
        }
    }

    /// Finds the particles that tools, loads and injected forces want, ascending. Where there is no room for all, each
    /// claim gets as many: of a tool those nearest to the middles of its balls, and to the lines between those of
    /// neighbours; of loads those nearest to where they act (see [`super::load_claims`]). The room of `occupied` particles
    /// is left free.
    pub(super) fn want(
        &mut self,
        environment: &Environment,
        body: &HybridBody,
        own: &HybridState,
        reach_m: f64,
        acting: Acting<'_>,
        occupied: usize,
    ) {
        self.wanted.clear();
        let room = self.room(environment, body, own, acting, occupied);
        self.want_for_tools(environment, body, own, reach_m, room);
        self.want_for_loads(acting, room);
        self.want_for_points(environment, body, acting, reach_m, room);
        self.wanted.sort_unstable();
        self.wanted.dedup();
    }

    /// Returns how many particles each claim gets, of the room that `occupied` ones leave.
    pub(super) fn room(
        &self,
        environment: &Environment,
        body: &HybridBody,
        own: &HybridState,
        acting: Acting<'_>,
        occupied: usize,
    ) -> usize {
        let of_tools = balls_of_tools(environment, body, own).filter(|balls| balls.iter().any(Option::is_some)).count();
        let of_points = usize::from(acting.points.iter().any(|point| environment.accepts(point)));
        let claims = of_tools + self.load_claims.count(acting.load_factors) + of_points;
        body.particles.most_active.saturating_sub(occupied) / claims.max(1)
    }

    /// Adds what tools want, of each as many as there is room for.
    pub(super) fn want_for_tools(
        &mut self,
        environment: &Environment,
        body: &HybridBody,
        own: &HybridState,
        reach_m: f64,
        room: usize,
    ) {
        for balls in balls_of_tools(environment, body, own) {
            self.found.clear();
            for (number, ball) in balls.iter().enumerate().filter_map(|(number, ball)| Some((number, (*ball)?))) {
                // As samples are no farther from each other than balls reach, balls after the next two have hardly a
                // particle of this one.
                let near = &balls[number.saturating_sub(1)..(number + 4).min(balls.len())];
                body.partition.particles_within(ball.rest_m, reach_m, |particle, distance_sq| {
                    let is_found = &mut self.is_found[particle as usize];
                    if body.may_wake(particle) && !std::mem::replace(is_found, true) {
                        let at_m = body.partition.particle_m(particle);
                        // Of a single ball the distance from its middle is known already.
                        let is_alone = balls.len() == 1;
                        self.found
                            .push((if is_alone { distance_sq } else { distance_to_balls_sq(near, at_m) }, particle));
                    }
                });
            }
            for (_, particle) in &self.found {
                self.is_found[*particle as usize] = false;
            }
            if self.found.len() > room {
                self.found.select_nth_unstable_by(room, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
                self.found.truncate(room);
            }
            self.wanted.extend(self.found.iter().map(|(_, particle)| *particle));
        }
    }

    /// Adds what loads want.
    pub(super) fn want_for_loads(&mut self, acting: Acting<'_>, room: usize) {
        self.load_claims.want(acting.load_factors, room, &mut self.nearest, &mut self.wanted);
    }

    /// Adds what injected forces want.
    pub(super) fn want_for_points(
        &mut self,
        environment: &Environment,
        body: &HybridBody,
        acting: Acting<'_>,
        reach_m: f64,
        room: usize,
    ) {
        self.nearest.add_points(environment, body, acting.points, reach_m);
        self.nearest.take(room, &mut self.wanted);
    }

    /// Returns the number of active particles that are not wanted, but too far from where they would be asleep to fall
    /// asleep now.
    pub(super) fn far_off(&self, patch: &RunningPatch, particles: &ParticleSpec) -> usize {
        let is_far_off = |&(particle, deviation_m): &(u32, f64)| {
            deviation_m > FAR_OFF * particles.spacing_m && self.wanted.binary_search(&particle).is_err()
        };
        patch.deviations_m().filter(is_far_off).count()
    }

    /// Keeps active particles awake that no tool wants but that are not settled, as long as there is room; those that
    /// are farthest from where they would be asleep come first.
    pub(super) fn keep_unsettled(&mut self, patch: &RunningPatch, particles: &ParticleSpec) {
        self.unwanted.clear();
        for (particle, deviation_m) in patch.deviations_m() {
            if deviation_m > SETTLED * particles.spacing_m && self.wanted.binary_search(&particle).is_err() {
                self.unwanted.push((deviation_m, particle));
            }
        }
        self.unwanted.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let room = particles.most_active.saturating_sub(self.wanted.len());
        self.wanted.extend(self.unwanted.iter().take(room).map(|(_, particle)| *particle));
        self.wanted.sort_unstable();
    }
}
