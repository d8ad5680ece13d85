//! Decides before a tick what of a mass-spring surface is refined and awake in it.
use super::{
    AwakeNodes, MassSpringBody, MassSpringState, Refinement, SpringScratch, SteppedMassSpring, Wanted,
    body::rings_for,
    skin::{Carried, SpringSkin},
    state::{About, ActivationQuery, Found},
};
use crate::{
    contact::{Known, Near, Skin, ToolState},
    tick::{Environment, ListedVertices, MechanicalState, PointForce},
};
use glam::DVec3;
use std::ops::Range;

/// Number of ticks between two queries of where the tools are.
const QUERY_EVERY_TICKS: u32 = 8;
/// Gap over the tool's radius below which the surface is refined, besides half an edge and the distance that the tool
/// moves until the next query.
const GAP: f64 = 0.25;
/// Distance from the rest position, and distance in a tick, over the length of coarse edges, below which a node is at
/// rest.
const STILL: f64 = 1e-6;
/// Time (s) in which spring constants follow the displacement of the touched vertex.
const CONSTANTS_FOLLOW_S: f64 = 0.02;
/// Distance that a tool moves, over the length of coarse edges, in which levels change completely, however slowly they
/// change beneath a tool that stands still.
const BLEND_DISTANCE: f64 = 1.0;

/// Buffers, which are allocated once.
#[derive(Debug, Clone)]
pub(crate) struct MassSpringScratch {
    pub(super) springs: SpringScratch,
    pub(super) skin: ListedVertices<Carried>,
    query: ActivationQuery,
    /// Masses (kg) of the awake nodes on each axis; 0 where they are held.
    pub(super) mass_kg: Vec<DVec3>,
    /// Inverse masses (1/kg) of the awake nodes on each axis; 0 where they are held.
    pub(super) inverse_mass_per_kg: Vec<DVec3>,
    /// Layout that these masses belong to.
    layout: u64,
}

impl SteppedMassSpring<'_> {
    /// Prepares a tick: queries now and then where the tools are, wakes vertices at tools and injected forces, and
    /// moves levels. Nothing is allocated.
    pub(super) fn wake_and_refine(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        forces: &[PointForce],
    ) {
        let Self { body, own, scratch } = self;
        let tick_period_s = environment.settings.tick_period_s;
        scratch.springs.follow(body.model(), &own.motion);
        let is_due = state.tick.is_multiple_of(u64::from(QUERY_EVERY_TICKS));
        // The vertices that contact lists must not decide this, as they depend on when they were listed.
        let is_new =
            |(tool, samples): (&ToolState, Range<usize>)| tool.contacts > 0 && !About::is_fine(&own.about[samples]);
        let queries = is_due || state.tools.iter().zip(body.axis_samples()).any(is_new);
        if queries {
            scratch.query_tools(environment, body, own, state, if is_due { QUERY_EVERY_TICKS } else { 0 });
        }
        let MechanicalState { x, v, .. } = state;
        if queries {
            own.want_refined(body, &mut scratch.query);
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
            if queries || forced {
                let is_still = forces.is_empty() && is_still(body, &own.motion.ids, x, v, tick_period_s);
                own.want_awake(body, &mut scratch.query, forced, is_still);
            }
        }
        let away_m = |vertex: u32| {
            let place = scratch.springs.place(vertex);
            place.map_or(0.0, |place| x[place].distance(body.model().rest_m()[vertex as usize]))
        };
        let fine = own.next_fine(body, tick_period_s / CONSTANTS_FOLLOW_S, away_m);
        // Levels must not lag behind a moving tool: if the surface were refined too late at its front and coarse too
        // late at its back, it would drive the tool on.
        let tools = state.tools.iter().zip(&environment.tools).zip(body.axis_samples());
        let samples =
            tools.flat_map(|((tool, spec), samples)| tool.axis_samples(spec, samples.len()).zip(&own.about[samples]));
        let touching = samples.filter(|(_, about)| about.touched.is_some());
        let fastest_m_per_s = touching.map(|(sample, _)| sample.speed_m_per_s).fold(0.0, f64::max);
        let rate_hz = |r: Refinement| r.blend_s.recip() + fastest_m_per_s / (BLEND_DISTANCE * body.edge_m());
        let step = body.refinement().map_or(1.0, |r| tick_period_s * rate_hz(r));
        let wanted = Wanted { refined: &own.refined, step, fine, awake: &own.awake };
        let nodes = AwakeNodes { x_m: x, v_m_per_s: v };
        if let Some(changed) = scratch.springs.advance(body.model(), &mut own.motion, nodes, &wanted) {
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
    /// Returns buffers for a body.
    pub(crate) fn new(body: &MassSpringBody) -> Self {
        Self {
            springs: SpringScratch::new(body.model()),
            skin: ListedVertices::new(body.model().rest_m().len()),
            query: ActivationQuery::new(body),
            mass_kg: Vec::with_capacity(body.model().most_nodes()),
            inverse_mass_per_kg: Vec::with_capacity(body.model().most_nodes()),
            layout: u64::MAX,
        }
    }

    /// Returns the place of a node among the awake nodes, where it is awake.
    pub(super) fn place(&self, node: u32) -> Option<usize> {
        self.springs.place(node)
    }

    fn weigh(&mut self) {
        if self.layout != self.springs.layout() {
            self.layout = self.springs.layout();
            self.mass_kg.clear();
            self.inverse_mass_per_kg.clear();
            // The mass of a held node is infinite.
            let masses = self.springs.mass_kg().iter();
            self.inverse_mass_per_kg.extend(masses.clone().map(|mass| DVec3::splat(mass.recip())));
            self.mass_kg.extend(masses.map(|mass| DVec3::splat(if mass.is_finite() { *mass } else { 0.0 })));
        }
    }

    /// Notes which vertices each tool is near to, `ticks` ticks after the last query.
    fn query_tools(
        &mut self,
        environment: &Environment,
        body: &MassSpringBody,
        own: &mut MassSpringState,
        state: &MechanicalState,
        ticks: u32,
    ) {
        let MechanicalState { x, tools, contact, force_is_current, .. } = state;
        let known = Known { fitted: force_is_current.then(|| contact.boxes()), vertex: None };
        let tick_period_s = environment.settings.tick_period_s;
        let MassSpringState { motion, about, .. } = own;
        let mut skin = SpringSkin::new(body, motion, &self.springs, x);
        skin.begin();
        for ((tool, spec), samples) in tools.iter().zip(&environment.tools).zip(body.axis_samples()) {
            let about = &mut about[samples];
            if ticks == 0 && About::is_fine(about) {
                continue;
            }
            for (sample, about) in tool.axis_samples(spec, about.len()).zip(about) {
                // Distance that the sample moves until the next query.
                let ahead_m = f64::from(QUERY_EVERY_TICKS) * tick_period_s * sample.speed_m_per_s;
                let near_m = GAP * spec.radius_m + 0.5 * body.edge_m() + ahead_m;
                let cover_m = environment.contact.covering_radius_m;
                let Near { from_m, vertex, gap_m } = sample.look(&skin, (near_m, cover_m), known);
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
                about.note(near, near_m, spec.radius_m, ticks);
            }
        }
    }
}

/// Returns whether all awake nodes are at rest at their rest positions, up to the tolerance [`STILL`].
fn is_still(body: &MassSpringBody, ids: &[u32], x: &[DVec3], v: &[DVec3], tick_s: f64) -> bool {
    let most_m = STILL * body.edge_m();
    let moved = |(id, x): (&u32, &DVec3)| x.distance(body.model().rest_m()[*id as usize]) > most_m;
    !ids.iter().zip(x).any(moved) && v.iter().all(|v| v.length() * tick_s <= most_m)
}
