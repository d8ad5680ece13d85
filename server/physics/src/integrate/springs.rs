//! Forces and kicks of a mass-spring surface, for leapfrog, and what is refined and awake from one tick to the next.
use super::forces::{Evaluation, Tick, is_usable};
use crate::{
    bodies::mass_spring::{
        Refinement, SpringBody, SpringScratch, SpringState, Wanted,
        body::rings_for,
        skin::{ListedVertices, SpringSkin},
        state::{About, Found, Looking},
    },
    contact::{ContactScratch, Near, SubstepTime, SurfaceNow, ToolState, broad::Skin},
    lanes::kicks::LumpedKick,
    world::{Model, PointForce, State},
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
pub(crate) struct SpringBodyScratch {
    springs: SpringScratch,
    skin: ListedVertices,
    looking: Looking,
    /// Of awake nodes, on each axis; 0 where they are held, as is the inverse.
    mass_kg: Vec<DVec3>,
    inverse_mass_per_kg: Vec<DVec3>,
    /// Of which layout these are.
    layout: u64,
    /// Contact was told how far the last change of layout moved the surface.
    pub(super) skin_is_tracked: bool,
}

impl SpringBodyScratch {
    /// Of a model whose body is a mass-spring surface.
    pub(crate) fn new(model: &Model) -> Option<Self> {
        let body = model.springs()?;
        Some(Self {
            springs: SpringScratch::new(body.model()),
            skin: ListedVertices::new(body),
            looking: Looking::new(body),
            mass_kg: Vec::with_capacity(body.model().most_nodes()),
            inverse_mass_per_kg: Vec::with_capacity(body.model().most_nodes()),
            layout: u64::MAX,
            skin_is_tracked: false,
        })
    }

    /// Before a tick: looks now and then where the tools are, wakes what they and injected forces want, and brings levels on their way. Allocates nothing.
    pub(super) fn prepare(&mut self, model: &Model, body: &SpringBody, state: &mut State, forces: &[PointForce]) {
        self.skin_is_tracked = false;
        let Some(springs) = &state.springs else { return };
        self.springs.follow(body.model(), &springs.motion);
        let is_due = state.tick.is_multiple_of(u64::from(LOOK_EVERY_TICKS));
        // Not by what contact lists, which depends on when it was listed.
        let is_new =
            |(tool, own): (&ToolState, Range<usize>)| tool.contacts > 0 && !About::is_fine(&springs.about[own]);
        let looks = is_due || state.tools.iter().zip(body.places()).any(is_new);
        if looks {
            self.look(model, body, state, if is_due { LOOK_EVERY_TICKS } else { 0 });
        }
        let State { x, v, springs: Some(springs), .. } = state else { return };
        if looks {
            springs.want_refined(body, &mut self.looking);
        }
        if !body.is_all_awake() {
            let mut forced = false;
            for point in forces.iter().filter(|point| is_usable(model, point) && point.force_n != DVec3::ZERO) {
                let vertex = body.ends(point.node)[0];
                if self.springs.place(vertex).is_none() {
                    springs.force(vertex);
                    forced = true;
                }
            }
            if looks || forced {
                let is_quiet = forces.is_empty() && is_quiet(body, &springs.motion.ids, (x, v), model);
                springs.want_awake(body, &mut self.looking, forced, is_quiet);
            }
        }
        let away_m = |vertex: u32| {
            let place = self.springs.place(vertex);
            place.map_or(0.0, |place| x[place].distance(body.model().rest_m()[vertex as usize]))
        };
        let fine = springs.next_fine(body, model.spec().settings.tick_period_s / CONSTANTS_FOLLOW_S, away_m);
        // A moving tool leaves levels no time to lag behind: what is refined too late at its front and coarse too late at its back would drive it on.
        let places = state.tools.iter().zip(&model.spec().tools).zip(body.places());
        let places = places.flat_map(|((tool, spec), own)| tool.places(spec, own.len()).zip(&springs.about[own]));
        let touching = places.filter(|(_, about)| about.touched.is_some());
        let fastest_m_per_s = touching.map(|(place, _)| place.speed_m_per_s).fold(0.0, f64::max);
        let rate_hz = |r: Refinement| r.fade_s.recip() + fastest_m_per_s / (FADE_WAY * body.edge_m());
        let step = body.refinement().map_or(1.0, |r| model.spec().settings.tick_period_s * rate_hz(r));
        let wanted = Wanted { refined: &springs.refined, step, fine, awake: &springs.awake };
        if let Some(changed) = self.springs.go_on(body.model(), &mut springs.motion, (x, v), &wanted) {
            springs.given_j += changed.elastic_j + changed.kinetic_j;
            state.ledger.dissipated_j -= changed.elastic_j + changed.kinetic_j;
            for forces in [&mut state.force_n, &mut state.external_n] {
                forces.clear();
                forces.resize(state.x.len(), DVec3::ZERO);
            }
            state.contact.travelled(changed.moved_m);
            self.skin_is_tracked = state.force_is_current;
            state.force_is_current = false;
        }
        self.weigh();
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
    fn look(&mut self, model: &Model, body: &SpringBody, state: &mut State, ticks: u32) {
        let State { x, tools, contact, force_is_current, springs: Some(springs), .. } = state else { return };
        let fitted = force_is_current.then(|| contact.boxes());
        let tick_period_s = model.spec().settings.tick_period_s;
        let SpringState { motion, about, .. } = springs;
        let mut skin = SpringSkin::new(body, (motion, &self.springs), x);
        skin.begin();
        for ((tool, spec), own) in tools.iter().zip(&model.spec().tools).zip(body.places()) {
            let about = &mut about[own];
            if ticks == 0 && About::is_fine(about) {
                continue;
            }
            for (place, about) in tool.places(spec, about.len()).zip(about) {
                // What it goes until the next look.
                let ahead_m = f64::from(LOOK_EVERY_TICKS) * tick_period_s * place.speed_m_per_s;
                let near_m = GAP * spec.radius_m + 0.5 * body.edge_m() + ahead_m;
                let cover_m = model.contact().covering_radius_m;
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

fn is_quiet(body: &SpringBody, ids: &[u32], (x, v): (&[DVec3], &[DVec3]), model: &Model) -> bool {
    let (most_m, tick_s) = (QUIET * body.edge_m(), model.spec().settings.tick_period_s);
    let moved = |(id, x): (&u32, &DVec3)| x.distance(body.model().rest_m()[*id as usize]) > most_m;
    !ids.iter().zip(x).any(moved) && v.iter().all(|v| v.length() * tick_s <= most_m)
}

/// Total force at the present positions into `state.force_n`, its external part into `state.external_n`.
pub(super) fn evaluate(
    tick: &Tick<'_>,
    body: &SpringBody,
    state: &mut State,
    (own, contact_scratch): (&mut SpringBodyScratch, &mut ContactScratch),
    now: &Evaluation,
) {
    let model = tick.model;
    let State { x, v, springs: Some(SpringState { motion, .. }), .. } = state else { return };
    let SpringBodyScratch { springs, skin, .. } = own;
    let tick_period_s = model.spec().settings.tick_period_s;
    let time = SubstepTime { fraction: now.fraction, dt_s: now.dt_s, tick_period_s };
    let contact = model.contact();
    contact.move_tools(now.fastest_m_per_s, &time, &mut state.tools, &mut state.contact);
    let mut view = SpringSkin::new(body, (motion, springs), x);
    let mut renewed = contact.list_on_skin((&mut view, &mut skin.x), &state.tools, &mut state.contact, contact_scratch);
    renewed |= skin.is_outdated(springs);
    renewed |= tick.usable_points().any(|point| !skin.is_listed(point.node));
    if renewed {
        skin.start(springs);
        tick.list_touched(&state.contact, |vertex| skin.list(body, (motion, springs), vertex));
        skin.finish();
    }
    skin.refresh(x);
    let rest_m = model.surface_rest_positions_m();
    tick.add_given_n(&state.load_factors, now, (rest_m, &skin.x), &mut skin.forces_n);
    let velocity = |vertex: u32| body.velocity_m_per_s((motion, springs), vertex, v);
    let surface = SurfaceNow { x: &skin.x, velocity_m_per_s: &velocity };
    contact.press_tools(&surface, &time, &mut state.tools, &mut state.contact, &mut skin.forces_n, contact_scratch);
    state.external_n.fill(DVec3::ZERO);
    skin.hand_over(&mut state.external_n);
    state.force_n.copy_from_slice(&state.external_n);
    springs.add_forces_n(body.model(), motion, x, &mut state.force_n);
    let gravity = model.gravity_m_per_s2();
    if gravity != DVec3::ZERO {
        for (force, mass) in state.force_n.iter_mut().zip(springs.mass_kg()).filter(|(_, mass)| mass.is_finite()) {
            *force += gravity * *mass;
        }
    }
    state.force_is_current = true;
}

/// A half or whole kick of the awake nodes: `v ← (v e^{−c h/2} + h f/m) e^{−c h/2}`, and the ledger's share of it.
pub(super) fn kick(model: &Model, state: &mut State, own: &SpringBodyScratch, h_s: f64) {
    let damping = model.spec().settings.mass_damping_per_s;
    let [external_w, before_sq, between_sq] = LumpedKick {
        v: &mut state.v,
        forces_n: &state.force_n,
        external_n: &state.external_n,
        mass_kg: &own.mass_kg,
        inverse_mass_per_kg: &own.inverse_mass_per_kg,
        factor: (-0.5 * damping * h_s).exp(),
        h_s,
    }
    .give();
    state.ledger.external_work_j += h_s * external_w;
    // Half of what damping takes is taken before the force, half behind it.
    state.ledger.dissipated_j += 0.5 * (before_sq + between_sq) * -(-damping * h_s).exp_m1();
}
