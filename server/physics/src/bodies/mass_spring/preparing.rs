//! What of a mass-spring surface is refined and awake in the next tick.
use super::{
    MassSpringBody, MassSpringState, Refinement, SpringScratch, SteppedMassSpring, Wanted,
    body::rings_for,
    skin::{Carried, SpringSkin},
    state::{About, ActivationQuery, Found},
};
use crate::{
    contact::{Near, Skin, ToolState},
    tick::{Environment, ListedVertices, MechanicalState, PointForce},
};
use glam::DVec3;
use std::ops::Range;

/// Ticks between two looks at where the tools are.
const LOOK_EVERY_TICKS: u32 = 8;
/// Gap over the tool's radius from which the surface is refined, besides half an edge and what the tool goes until the next look.
const GAP: f64 = 0.25;
/// Way home, and way in a tick, over the coarse edges' length, below which a node is at rest.
const QUIET: f64 = 1e-6;
/// How fast (s) spring constants follow what a tool displaces.
const CONSTANTS_FOLLOW_S: f64 = 0.02;
/// Way of a tool over the coarse edges' length in which levels go all their way, however slowly they do beneath one that stands still.
const FADE_WAY: f64 = 1.0;

/// Buffers, sized once.
#[derive(Debug, Clone)]
pub(crate) struct MassSpringScratch {
    pub(super) springs: SpringScratch,
    pub(super) skin: ListedVertices<Carried>,
    looking: ActivationQuery,
    /// Of awake nodes, on each axis; 0 where they are held, as is the inverse.
    pub(super) mass_kg: Vec<DVec3>,
    pub(super) inverse_mass_per_kg: Vec<DVec3>,
    /// Of which layout these are.
    layout: u64,
}

impl SteppedMassSpring<'_> {
    /// Before a tick: looks now and then where the tools are, wakes what they and injected forces want, and brings levels on their way. Allocates nothing.
    pub(crate) fn prepare(&mut self, environment: &Environment, state: &mut MechanicalState, forces: &[PointForce]) {
        let Self { body, own, scratch } = self;
        let tick_period_s = environment.settings.tick_period_s;
        scratch.springs.follow(body.model(), &own.motion);
        let is_due = state.tick.is_multiple_of(u64::from(LOOK_EVERY_TICKS));
        // Not by what contact lists, which depends on when it was listed.
        let is_new =
            |(tool, places): (&ToolState, Range<usize>)| tool.contacts > 0 && !About::is_fine(&own.about[places]);
        let looks = is_due || state.tools.iter().zip(body.places()).any(is_new);
        if looks {
            scratch.look(environment, body, own, state, if is_due { LOOK_EVERY_TICKS } else { 0 });
        }
        let MechanicalState { x, v, .. } = state;
        if looks {
            own.want_refined(body, &mut scratch.looking);
        }
        if !body.is_all_awake() {
            let mut forced = false;
            for point in forces.iter().filter(|point| environment.accepts(point) && point.force_n != DVec3::ZERO) {
                let vertex = body.ends(point.node)[0];
                if scratch.springs.place(vertex).is_none() {
                    own.force(vertex);
                    forced = true;
                }
            }
            if looks || forced {
                let is_quiet = forces.is_empty() && is_quiet(body, &own.motion.ids, (x, v), tick_period_s);
                own.want_awake(body, &mut scratch.looking, forced, is_quiet);
            }
        }
        let away_m = |vertex: u32| {
            let place = scratch.springs.place(vertex);
            place.map_or(0.0, |place| x[place].distance(body.model().rest_m()[vertex as usize]))
        };
        let fine = own.next_fine(body, tick_period_s / CONSTANTS_FOLLOW_S, away_m);
        // A moving tool leaves levels no time to lag behind: what is refined too late at its front and coarse too late at its back would drive it on.
        let places = state.tools.iter().zip(&environment.tools).zip(body.places());
        let places =
            places.flat_map(|((tool, spec), places)| tool.axis_samples(spec, places.len()).zip(&own.about[places]));
        let touching = places.filter(|(_, about)| about.touched.is_some());
        let fastest_m_per_s = touching.map(|(place, _)| place.speed_m_per_s).fold(0.0, f64::max);
        let rate_hz = |r: Refinement| r.fade_s.recip() + fastest_m_per_s / (FADE_WAY * body.edge_m());
        let step = body.refinement().map_or(1.0, |r| tick_period_s * rate_hz(r));
        let wanted = Wanted { refined: &own.refined, step, fine, awake: &own.awake };
        if let Some(changed) = scratch.springs.go_on(body.model(), &mut own.motion, (x, v), &wanted) {
            own.given_j += changed.elastic_j + changed.kinetic_j;
            state.ledger.dissipated_j -= changed.elastic_j + changed.kinetic_j;
            for forces in [&mut state.force_n, &mut state.external_n] {
                forces.clear();
                forces.resize(state.x.len(), DVec3::ZERO);
            }
            state.contact.travelled_at_a_change(changed.moved_m, state.force_is_current);
            state.force_is_current = false;
        }
        scratch.weigh();
    }
}

impl MassSpringScratch {
    /// For a body.
    pub(crate) fn new(body: &MassSpringBody) -> Self {
        Self {
            springs: SpringScratch::new(body.model()),
            skin: ListedVertices::new(body.model().rest_m().len()),
            looking: ActivationQuery::new(body),
            mass_kg: Vec::with_capacity(body.model().most_nodes()),
            inverse_mass_per_kg: Vec::with_capacity(body.model().most_nodes()),
            layout: u64::MAX,
        }
    }

    /// The place of an awake node.
    pub(super) fn place(&self, node: u32) -> Option<usize> {
        self.springs.place(node)
    }

    fn weigh(&mut self) {
        if self.layout != self.springs.layout() {
            self.layout = self.springs.layout();
            self.mass_kg.clear();
            self.inverse_mass_per_kg.clear();
            // Of what is held the mass is infinite.
            let masses = self.springs.mass_kg().iter();
            self.inverse_mass_per_kg.extend(masses.clone().map(|mass| DVec3::splat(mass.recip())));
            self.mass_kg.extend(masses.map(|mass| DVec3::splat(if mass.is_finite() { *mass } else { 0.0 })));
        }
    }

    /// Notes what each tool is near to, `ticks` after the last time.
    fn look(
        &mut self,
        environment: &Environment,
        body: &MassSpringBody,
        own: &mut MassSpringState,
        state: &MechanicalState,
        ticks: u32,
    ) {
        let MechanicalState { x, tools, contact, force_is_current, .. } = state;
        let fitted = force_is_current.then(|| contact.boxes());
        let tick_period_s = environment.settings.tick_period_s;
        let MassSpringState { motion, about, .. } = own;
        let mut skin = SpringSkin::new(body, (motion, &self.springs), x);
        skin.begin();
        for ((tool, spec), places) in tools.iter().zip(&environment.tools).zip(body.places()) {
            let about = &mut about[places];
            if ticks == 0 && About::is_fine(about) {
                continue;
            }
            for (place, about) in tool.axis_samples(spec, about.len()).zip(about) {
                // What it goes until the next look.
                let ahead_m = f64::from(LOOK_EVERY_TICKS) * tick_period_s * place.speed_m_per_s;
                let near_m = GAP * spec.radius_m + 0.5 * body.edge_m() + ahead_m;
                let cover_m = environment.contact.covering_radius_m;
                let Near { from_m, vertex, gap_m } = place.look(&skin, (near_m, cover_m), fitted);
                let near = vertex.map(|(vertex, _)| {
                    let distance_m = |vertex: u32| skin.position_m(vertex).distance(from_m);
                    let vertex = skin.coarse_vertex(vertex, from_m);
                    let touched = about.touched.unwrap_or(vertex);
                    let depth_m = skin.position_m(touched).distance(body.model().rest_m()[touched as usize]);
                    Found {
                        rings: rings_for(depth_m, spec.radius_m, body.edge_m()),
                        vertex,
                        distance_m: distance_m(vertex),
                        present_m: about.touched.map_or(f64::INFINITY, distance_m),
                        gap_m,
                    }
                });
                about.note(near, (near_m, spec.radius_m, ticks));
            }
        }
    }
}

fn is_quiet(body: &MassSpringBody, ids: &[u32], (x, v): (&[DVec3], &[DVec3]), tick_s: f64) -> bool {
    let most_m = QUIET * body.edge_m();
    let moved = |(id, x): (&u32, &DVec3)| x.distance(body.model().rest_m()[*id as usize]) > most_m;
    !ids.iter().zip(x).any(moved) && v.iter().all(|v| v.length() * tick_s <= most_m)
}
