//! Switching wakes particles near where a tool touches the skin or is about to, and lets others fall asleep once they
//! have come to rest.
//!
//! A tool wants the particles within a ball at rest, about the vertex of the skin nearest to it, or nearest to where it
//! is deepest in the body. The ball exists from when the gap is less than `g₀ + v·50 ms` until the gap has been twice
//! that for 100 ms, and follows the tool in steps of a spacing. A capsule has several such balls, one for each sample
//! of its axis. A particle that no tool wants any more falls asleep once it is nearly where it would be asleep, or when
//! its room is needed and it is not far from there.
//!
//! A switch keeps momentum. What wakes moves as it was moved (`mass_matrix`). What falls asleep transfers impulses to the
//! coarse nodes, and all of it together a couple: with `m = (1 − ε) m_p`, the position `x_p = Σ_i ζ_pi x_i` that a
//! particle has then, and the free nodes of its tets, of masses `M_i` about their middle `x̄`,
//! ```text
//! J_i = Σ_p m ζ_pi (w_p − Σ_j ζ_pj v_j) + M_i α × (x_i − x̄)
//! Σ_i M_i (x_i − x̄) × (α × (x_i − x̄)) = Σ_p m (y_p − x_p) × w_p
//! v ← v + M''⁻¹ J
//! ```
//! with the matrix `M''` of what stays awake. So linear and angular momentum are kept. Coarse nodes are moved by `Δ_i`
//! then (`projection`), for which `−Σ_i Δ_i × P_i`, with the momenta `P = M'' v + J`, is added to the couple on the
//! right.
use super::{
    activation_query::{Acting, ActivationQuery, begins_to_act, meets_sleeping_skin, moves_quickly, update_balls},
    body::HybridBody,
    carried_skin::SkinView,
    patch::KEPT,
    running::RunningMassMatrix,
    running::RunningPatch,
    scratch::HybridScratch,
    spec::Waking,
    state::HybridState,
    state_transfer::{NodeShifts, PatchSwitch},
    stepped::SteppedHybrid,
    transition_force::{Turn, turn_of},
};
use crate::tick::{Environment, MechanicalState, PointForce};
use glam::{BVec3, DVec3};
use serde::{Deserialize, Serialize};

/// Number of ticks in which a switch is prepared and done.
const SWITCH_TICKS: u64 = 2 + RunningPatch::SLICES as u64;
/// Number of ticks between two activation queries. After each, what is to sleep falls asleep, and then what is to wake
/// wakes: both in one tick would take too long.
pub(super) const QUERY_EVERY_TICKS: u64 = 2 * SWITCH_TICKS;
/// Number of times that room is made in a query for what may not fall asleep.
const MOST_WANTS: usize = 4;
/// Number of ticks between two switches that are done at once.
const AT_ONCE_EVERY_TICKS: u32 = 4;
/// Number of ticks between two looks for tools that arrive at sleeping skin, if none is quick.
pub(super) const LOOK_EVERY_TICKS: u64 = 4;
/// Gap, over the tool's radius and over the spacing, below which a tool's particles are awake.
pub(crate) const GAP: f64 = 0.25;
/// Distance, over the spacing, that the skin's nearest vertex moves at rest before a ball follows.
pub(crate) const FOLLOW: f64 = 0.9;

/// The ball whose particles a tool keeps awake, about one of the samples of its axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Ball {
    /// Its middle at rest (m).
    pub(super) rest_m: DVec3,
    /// Number of ticks for which the tool has been away.
    pub(super) away_ticks: u32,
}

impl SteppedHybrid<'_> {
    /// Prepares a tick: makes the patch that of the state's active particles, and every few ticks queries which should
    /// be active, and switches to them. Allocates nothing.
    pub(super) fn switch_if_due(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        points: &[PointForce],
    ) {
        let Self { body, own, scratch } = self;
        let tick_period_s = environment.settings.tick_period_s;
        scratch.follow(body, own);
        own.long_steps.follow_coarse_forces(tick_period_s, &mut state.force_n);
        if !own.prestrain.is_empty() || !own.transition_force_n.is_empty() {
            scratch.decay(own, state, tick_period_s);
        }
        let particles = &body.particles;
        let Waking::ByTools { reach_m } = particles.waking else { return };
        own.ticks_to_at_once = own.ticks_to_at_once.saturating_sub(1);
        let looks = state.tick.is_multiple_of(LOOK_EVERY_TICKS) || moves_quickly(environment, body, state);
        if own.ticks_to_at_once == 0
            && (looks && meets_sleeping_skin(environment, body, scratch, state)
                || begins_to_act(environment, body, own, scratch, state, points))
        {
            self.wake_at_once(environment, state, points, reach_m);
            return;
        }
        match state.tick % QUERY_EVERY_TICKS {
            0 => {
                scratch.query(environment, body, own, state, points, reach_m);
                own.want(&scratch.query.wanted);
            }
            SWITCH_TICKS => own.next.clone_from(&own.wanted),
            since_query if own.is_switching() => {
                self.go_on_switching(environment, state, since_query % SWITCH_TICKS);
            }
            _ => {}
        }
    }

    /// Queries and switches in this tick: something presses skin whose particles sleep.
    fn wake_at_once(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        points: &[PointForce],
        reach_m: f64,
    ) {
        let Self { body, own, scratch } = self;
        scratch.query(environment, body, own, state, points, reach_m);
        own.wanted.clone_from(&scratch.query.wanted);
        own.next.clone_from(&scratch.query.wanted);
        // What sleeps although it is pressed, for want of room, sleeps on.
        own.ticks_to_at_once = if own.is_switching() { AT_ONCE_EVERY_TICKS } else { QUERY_EVERY_TICKS as u32 };
        if own.is_switching() {
            self.switch_now(environment, state);
        }
    }

    /// Lays the staged patch out, a slice per tick, then switches to it.
    fn go_on_switching(&mut self, environment: &Environment, state: &mut MechanicalState, slice: u64) {
        let Self { body, own, scratch } = &mut *self;
        if slice <= u64::from(RunningPatch::SLICES) {
            scratch.staged.go_on(body, &own.next);
            return;
        }
        self.switch_now(environment, state);
    }

    /// Switches to the particles that are to be active next.
    fn switch_now(&mut self, environment: &Environment, state: &mut MechanicalState) {
        let Self { body, own, scratch } = self;
        let were_current = state.force_is_current;
        let moved_m = scratch.switch(body, environment.gravity_m_per_s2, own, state);
        state.contact.travelled_at_a_change(moved_m, were_current);
    }

    /// Wakes these particles and no others, as tools would: what was active stays as it is, what wakes moves as the
    /// coarse nodes have moved it. Particles that may not wake ([`HybridBody::may_wake`]), and those for which there is
    /// no room, are left out.
    pub(crate) fn wake_only(
        &mut self,
        environment: &Environment,
        state: &mut MechanicalState,
        particles: impl IntoIterator<Item = u32>,
    ) {
        let Self { body, own, scratch } = self;
        scratch.follow(body, own);
        let next = &mut own.next;
        next.clear();
        next.extend(particles.into_iter().filter(|&particle| body.may_wake(particle)));
        next.sort_unstable();
        next.dedup();
        next.truncate(body.particles.most_active);
        own.wanted.clone_from(&own.next);
        if own.is_switching() {
            scratch.switch(body, environment.gravity_m_per_s2, own, state);
        }
    }
}

impl HybridScratch {
    /// Finds the particles that are to be awake.
    fn query(
        &mut self,
        environment: &Environment,
        body: &HybridBody,
        own: &mut HybridState,
        state: &MechanicalState,
        points: &[PointForce],
        reach_m: f64,
    ) {
        let Self { patch, query, .. } = self;
        patch.displace(body, &state.x);
        update_balls(environment, &mut SkinView::new(body, patch), body, own, &mut query.nearest_before, state);
        let acting = Acting { load_factors: &state.load_factors, points };
        query.want(environment, body, own, reach_m, acting, 0);
        // What has no room any more may be far off itself.
        for _ in 0..MOST_WANTS {
            let far_off = query.far_off(patch, &body.particles);
            if query.wanted.len() + far_off <= body.particles.most_active {
                break;
            }
            query.want(environment, body, own, reach_m, acting, far_off);
        }
        query.crushed_cells.leave_asleep(body, patch, &state.x, &mut query.wanted);
        query.keep_unsettled(patch, &body.particles);
    }

    /// Lets the transition force decay over a tick, and leaves the prestrain out, which decays with the substeps, once
    /// nearly nothing is left of it.
    fn decay(&mut self, own: &mut HybridState, state: &mut MechanicalState, tick_period_s: f64) {
        own.decay_transition_force(tick_period_s);
        if own.prestrain.has_decayed() {
            state.ledger.dissipated_j += own.prestrain.along_j();
            own.given_j -= own.prestrain.along_j();
            own.prestrain.clear();
            self.patch.put_prestrains(&own.prestrain);
        }
    }

    /// Switches to the particles that are to be active next. Returns a bound of how far (m) that moves any vertex of
    /// the skin: particles that fall asleep move to where they follow, and coarse nodes, with what follows them, to the
    /// projection of those.
    fn switch(&mut self, body: &HybridBody, gravity: DVec3, own: &mut HybridState, state: &mut MechanicalState) -> f64 {
        self.staged.finish(body, &own.next);
        let Self { patch, staged, query, before, momenta, transition, .. } = self;
        let next = &mut staged.patch;
        let nodes = body.node_count();
        patch.displace(body, &state.x);
        query.impulses.clear();
        query.impulses.resize(nodes, DVec3::ZERO);
        query.weights_kg.clear();
        query.weights_kg.resize(nodes, 0.0);
        query.transferred_n.clear();
        query.transferred_n.resize(nodes, DVec3::ZERO);
        query.projection.start(nodes);
        query.were_m.clear();
        query.were_m.extend_from_slice(&state.x[..nodes]);
        transition.take(patch.mass_matrix_mut(), own, state);
        let (mut couple, mut farthest_m) = (DVec3::ZERO, 0.0_f64);
        for (number, id) in own.ids().iter().enumerate() {
            if own.next.binary_search(id).is_err() {
                let (taken, away_m) =
                    query.transfer(body, *id, state.x[nodes + number], state.v[nodes + number], state);
                couple += taken;
                farthest_m = farthest_m.max(away_m);
                transition.transfer(body, number, *id, &mut query.transferred_n);
            }
        }
        let switch = PatchSwitch { before: patch, after: next, is_moved: query.projection.is_moved() };
        let mut held_j = before.take(body, &switch, &state.x, &own.prestrain);
        held_j += patch.mass_matrix_mut().moving_j(body, &state.x, &state.v, gravity, momenta);
        let some_sleep = own.ids().iter().any(|id| own.next.binary_search(id).is_err());
        query.left.clear();
        query.left.extend_from_slice(own.ids());
        own.switch(body, state, &mut query.moved);
        if some_sleep {
            couple -= query.shift(body, next.mass_matrix_mut(), state, momenta);
            query.turn(couple, &state.x);
        }
        query.shifts_m.clear();
        query.shifts_m.extend(query.were_m.iter().zip(&state.x).map(|(were_m, x)| *x - *were_m));
        farthest_m += query.shifts_m.iter().map(|shift| shift.length()).fold(0.0, f64::max);
        next.displace(body, &state.x);
        let moved = NodeShifts { x_before: &query.were_m, shifts_m: &query.shifts_m, x_after: &state.x };
        let switch = PatchSwitch { before: patch, after: next, is_moved: query.projection.is_moved() };
        let (first_moved_j, elastic_j) = before.prestrain_after(body, &switch, &moved, &mut own.prestrain);
        next.put_prestrains(&own.prestrain);
        if some_sleep {
            query.impulses.resize(state.v.len(), DVec3::ZERO);
            next.mass_matrix_mut().accelerate(&mut query.impulses);
            for (v, change) in state.v.iter_mut().zip(&query.impulses[..nodes]) {
                *v += *change;
            }
        }
        held_j += first_moved_j - elastic_j;
        held_j -= next.mass_matrix_mut().moving_j(body, &state.x, &state.v, gravity, momenta);
        state.ledger.dissipated_j += held_j;
        own.given_j -= held_j;
        state.force_is_current = false;
        own.switched_j = own.switched_j.max(elastic_j);
        if own.may_use_transition_force() {
            transition.demand(body, next.mass_matrix_mut(), &query.left, own.ids(), &query.transferred_n, state.tick);
        }
        staged.swap(patch);
        body.amplification() * farthest_m
    }
}

impl ActivationQuery {
    /// Transfers the impulse of a particle at `y` (m) with velocity `w` (m/s), which falls asleep, to the coarse nodes.
    /// Returns its couple (kg m²/s), and its distance (m) from where it will be asleep.
    fn transfer(
        &mut self,
        body: &HybridBody,
        particle: u32,
        y: DVec3,
        w: DVec3,
        state: &MechanicalState,
    ) -> (DVec3, f64) {
        let anchor = body.partition.anchor(particle);
        let mass_kg = (1.0 - KEPT) * body.masses.particle_kg[particle as usize];
        anchor.push((w - anchor.of(&state.v)) * mass_kg, &mut self.impulses);
        let away_m = y - anchor.of(&state.x);
        self.projection.transfer(body, &anchor, mass_kg, away_m);
        for node in body.partition.coarse().tets()[anchor.tet as usize].map(|node| node as usize) {
            if body.free[node] == BVec3::TRUE {
                self.weights_kg[node] = body.masses.node_kg[node];
            }
        }
        (away_m.cross(w) * mass_kg, away_m.length())
    }

    /// Moves the coarse nodes to the projection of what has fallen asleep; returns the angular momentum (kg m²/s) that
    /// they gain.
    fn shift(
        &mut self,
        body: &HybridBody,
        mass_matrix: &mut RunningMassMatrix,
        state: &mut MechanicalState,
        momenta: &mut Vec<DVec3>,
    ) -> DVec3 {
        momenta.clear();
        momenta.resize(state.v.len(), DVec3::ZERO);
        mass_matrix.momenta(body, &state.v, momenta);
        let shifts_m = self.projection.solve(body, mass_matrix);
        let mut gained = DVec3::ZERO;
        for (((x, shift), momentum), impulse) in state.x.iter_mut().zip(shifts_m).zip(&*momenta).zip(&self.impulses) {
            *x += *shift;
            gained += shift.cross(*momentum + *impulse);
        }
        gained
    }

    /// Adds the couple (kg m²/s) of all particles that fell asleep to the impulses; adds nothing where too few nodes
    /// are free.
    fn turn(&mut self, couple: DVec3, x: &[DVec3]) {
        let Turn { turn, middle } = turn_of(&self.weights_kg, x, couple);
        for ((impulse, weight), x) in self.impulses.iter_mut().zip(&self.weights_kg).zip(x) {
            *impulse += turn.cross(*x - middle) * *weight;
        }
    }
}
