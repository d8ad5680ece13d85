//! Which nodes of a mass-spring surface move, and how nodes wake, fall asleep, enter and leave.
//!
//! A sleeping vertex is at its rest position. A node of type 2 exists while the level of its edge is above 0. It enters
//! at the mean displacement of its edge's ends, with the momentum of the mass that the ends give it; when it leaves,
//! each end gets its part of the mass back with the node's velocity. Momentum is conserved, and kinetic energy falls.
//! The changes of energy by levels and by nodes that enter and leave are returned ([`Changed`]):
//! ```text
//! v_e = (g_a v_a + g_b v_b)/(g_a + g_b),   ΔK = −½ g_a g_b/(g_a + g_b) |v_a − v_b|²        entering, with g_a + g_b = m_e
//! M v ← M v + g v_e,  M ← M + g,           ΔK = −½ M g/(M + g) |v − v_e|² at either end    leaving
//! ```
use super::{
    blend::{self, Levels},
    model::SpringModel,
    region::Constants,
    running::{RunningSprings, vertices_of},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Which nodes are awake, and the levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpringMotion {
    /// Awake nodes, ascending; lists of positions and velocities have an entry for each.
    pub ids: Vec<u32>,
    /// Levels of the triangles.
    pub levels: Levels,
    /// Present constants `K′_m`, `K′_h` of the refined surface.
    pub fine: Constants,
}

/// What the surface is to become.
#[derive(Debug, Clone, Copy)]
pub struct Wanted<'a> {
    /// Triangles that are to be refined, ascending.
    pub refined: &'a [u32],
    /// Change of every triangle's progress in this tick, at most.
    pub step: f64,
    /// Constants `K′_m`, `K′_h` of the refined surface.
    pub fine: Constants,
    /// Coarse vertices that are to be awake, ascending, besides those of triangles that are not coarse.
    pub awake: &'a [u32],
}

/// Positions and velocities of the awake nodes.
#[derive(Debug)]
pub struct AwakeNodes<'a> {
    /// Positions (m).
    pub x_m: &'a mut Vec<DVec3>,
    /// Velocities (m/s).
    pub v_m_per_s: &'a mut Vec<DVec3>,
}

/// Buffers, which are allocated once.
#[derive(Debug, Clone)]
pub struct SpringScratch {
    running: RunningSprings,
    mass_kg: Vec<f64>,
    next_levels: Levels,
    ids: Vec<u32>,
    x_m: Vec<DVec3>,
    v_m_per_s: Vec<DVec3>,
    /// The motion whose springs are laid out, once some are.
    laid_out: SpringMotion,
    is_laid_out: bool,
    /// Number of times that anything was laid out.
    layout: u64,
}

/// What a tick changed of a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Changed {
    /// Change of the elastic energy (J).
    pub elastic_j: f64,
    /// Change of the kinetic energy (J).
    pub kinetic_j: f64,
    /// Upper bound of the distance (m) by which any point of the surface was moved: coarse vertices, and the middles of
    /// edges.
    pub moved_m: f64,
}

impl SpringMotion {
    /// Returns a motion in which every triangle is coarse and the vertices `awake` are awake.
    pub fn at_rest(model: &SpringModel, awake: impl IntoIterator<Item = u32>) -> Self {
        let mut ids = Vec::with_capacity(model.most_nodes());
        ids.extend(awake);
        Self { ids, levels: Levels::with_room(model.spec().most_refined), fine: model.spec().fine }
    }

    /// Returns a motion of the largest size that a motion of the model has, so that copies of it have that room.
    pub fn filled(model: &SpringModel) -> Self {
        let levels = Levels::filled(model.spec().most_refined);
        Self { ids: vec![0; model.most_nodes()], levels, fine: model.spec().fine }
    }

    /// Makes every triangle coarse and puts every node to sleep. Nothing is allocated.
    pub fn reset(&mut self, model: &SpringModel) {
        self.ids.clear();
        self.levels.clear();
        self.fine = model.spec().fine;
    }

    /// Returns whether this may be a motion of a model with the coarse vertices `awake` awake, besides those of
    /// triangles that are not coarse.
    pub fn fits(&self, model: &SpringModel, awake: &[u32]) -> bool {
        let Constants { mesh_n_per_m, anchor_n_per_m } = self.fine;
        let positive = |k: f64| k > 0.0 && k.is_finite();
        let ascending = awake.windows(2).all(|pair| pair[0] < pair[1]);
        let known = awake.last().is_none_or(|last| *last < model.vertices());
        let spec = model.spec();
        let fits = ascending && known && awake.len() <= spec.most_awake;
        let levels_fit = self.levels.fit(model.surface().triangles().len(), spec.most_refined);
        if !(fits && levels_fit && positive(mesh_n_per_m) && positive(anchor_n_per_m)) {
            return false;
        }
        let mut ids = Vec::new();
        choose_ids(model, &self.levels, awake, &mut ids);
        ids == self.ids
    }

    /// Copies another motion of the same model. Nothing is allocated.
    pub fn copy_from(&mut self, other: &Self) {
        self.ids.clone_from(&other.ids);
        self.levels.copy_from(&other.levels);
        self.fine = other.fine;
    }
}

impl SpringScratch {
    /// Returns buffers for a model.
    pub fn new(model: &SpringModel) -> Self {
        let most = model.most_nodes();
        Self {
            running: RunningSprings::with_room(model),
            mass_kg: Vec::with_capacity(most),
            next_levels: Levels::with_room(model.spec().most_refined),
            ids: Vec::with_capacity(most),
            x_m: Vec::with_capacity(most),
            v_m_per_s: Vec::with_capacity(most),
            laid_out: SpringMotion::at_rest(model, []),
            is_laid_out: false,
            layout: 0,
        }
    }

    /// Returns a number that changes whenever awake nodes or levels do.
    pub fn layout(&self) -> u64 {
        self.layout
    }

    /// Returns the place of a node in the lists of positions and velocities, where it is awake.
    pub fn place(&self, id: u32) -> Option<usize> {
        self.running.place(id)
    }

    /// Lays out the springs of a motion, unless they are laid out already.
    pub fn follow(&mut self, model: &SpringModel, motion: &SpringMotion) {
        if !self.is_laid_out || self.laid_out != *motion {
            self.lay_out(model, motion);
            self.is_laid_out = true;
        }
    }

    /// Returns the masses (kg) of the awake nodes; those of held nodes are infinite.
    pub fn mass_kg(&self) -> &[f64] {
        &self.mass_kg
    }

    /// Adds the springs' forces (N) on the awake nodes, which are at `x_m` (m).
    pub fn add_forces_n(&mut self, model: &SpringModel, motion: &SpringMotion, x_m: &[DVec3], forces_n: &mut [DVec3]) {
        self.running.add_forces_n(model, &motion.ids, x_m, forces_n);
    }

    /// Moves nodes and levels by one tick towards what is wanted. Returns what that changed, if anything. Nothing is
    /// allocated.
    pub fn advance(
        &mut self,
        model: &SpringModel,
        motion: &mut SpringMotion,
        nodes: AwakeNodes<'_>,
        wanted: &Wanted<'_>,
    ) -> Option<Changed> {
        let AwakeNodes { x_m, v_m_per_s } = nodes;
        self.follow(model, motion);
        let changed = motion.levels.advance(wanted.refined, wanted.step, &mut self.next_levels);
        let same_constants = motion.fine == wanted.fine;
        motion.fine = wanted.fine;
        choose_ids(model, &motion.levels, wanted.awake, &mut self.ids);
        let same_ids = self.ids == motion.ids;
        if same_ids && !changed && same_constants {
            return None;
        }
        let mut moved_m = if changed { self.moved_by_levels_m(model, motion, x_m, wanted.step) } else { 0.0 };
        // The energy before is that of the springs that were laid out, whatever is wanted now.
        let mut elastic_j = -self.running.energy_of_levels_j(model, x_m);
        let mut kinetic_j = 0.0;
        if same_ids {
            self.running.add_levels(model, &motion.ids, &motion.levels, &motion.fine);
            self.laid_out.copy_from(motion);
            self.layout += 1;
        } else {
            let (put_at_rest_j, put_at_rest_m) = self.put_at_rest(model, motion, x_m);
            elastic_j += put_at_rest_j;
            moved_m += put_at_rest_m;
            kinetic_j -= kinetic(&self.mass_kg, v_m_per_s);
            self.return_momentum(model, motion, v_m_per_s);
            self.enter(model, x_m, v_m_per_s);
            motion.ids.clone_from(&self.ids);
            x_m.clone_from(&self.x_m);
            v_m_per_s.clone_from(&self.v_m_per_s);
            self.lay_out(model, motion);
            kinetic_j += kinetic(&self.mass_kg, v_m_per_s);
        }
        elastic_j += self.running.energy_of_levels_j(model, x_m);
        Some(Changed { elastic_j, kinetic_j, moved_m })
    }

    /// Returns an upper bound of the distance (m) by which a change of levels by `step` moves the surface. An edge's
    /// middle is at `s x_e + (1 − s) (X_e + ½ (u_a + u_b))`, so it moves by the change of `s` times the length of its
    /// tie.
    fn moved_by_levels_m(&self, model: &SpringModel, motion: &SpringMotion, x_m: &[DVec3], step: f64) -> f64 {
        let vertices = vertices_of(model, &motion.ids);
        let moved = |node: u32| self.place(node).map_or(DVec3::ZERO, |at| x_m[at] - model.rest_m()[node as usize]);
        let off_m = |&id: &u32| {
            let [a, b] = model.surface().edges()[(id - model.vertices()) as usize].nodes.map(moved);
            moved(id).distance((a + b) * 0.5)
        };
        motion.ids[vertices..].iter().map(off_m).fold(0.0, f64::max) * blend::steepest(step)
    }

    fn lay_out(&mut self, model: &SpringModel, motion: &SpringMotion) {
        self.running.lay_out(model, &motion.ids);
        self.running.add_levels(model, &motion.ids, &motion.levels, &motion.fine);
        let Self { mass_kg, running, .. } = self;
        mass_kg.clear();
        mass_kg.extend(motion.ids.iter().map(|&id| own_mass_kg(model, |node| running.place(node), id)));
        self.laid_out.copy_from(motion);
        self.layout += 1;
    }

    /// Puts vertices that fall asleep to their rest positions, one after the other. Returns the change of energy (J) of
    /// their springs of the coarse surface (that of the springs that levels add is taken by the caller), and the
    /// largest distance (m) by which a vertex moved.
    fn put_at_rest(&mut self, model: &SpringModel, motion: &SpringMotion, x_m: &mut [DVec3]) -> (f64, f64) {
        let surface = model.surface();
        let vertices = vertices_of(model, &motion.ids);
        let (mut change_j, mut farthest_m) = (0.0, 0.0_f64);
        for (place, vertex) in gone(&motion.ids[..vertices], &self.ids) {
            let own_rest_m = model.rest_m()[vertex as usize];
            for &edge in surface.edges_at(vertex) {
                let other = surface.other_end(edge, vertex);
                let rest_m = model.rest_m()[other as usize];
                let other_m = self.place(other).map_or(rest_m, |place| x_m[place]);
                let energy_j = |x: DVec3| {
                    0.5 * model.spec().coarse.mesh_n_per_m * (x.distance(other_m) - own_rest_m.distance(rest_m)).powi(2)
                };
                change_j += energy_j(own_rest_m) - energy_j(x_m[place]);
            }
            let away_m = own_rest_m.distance(x_m[place]);
            farthest_m = farthest_m.max(away_m);
            let spec = model.spec();
            change_j -= spec.coarse.anchor_n_per_m * spec.anchor_law.at(away_m).integral_m2;
            x_m[place] = own_rest_m;
        }
        (change_j, farthest_m)
    }

    /// Gives the momentum and mass of the nodes of type 2 that leave back to the ends of their edges.
    fn return_momentum(&mut self, model: &SpringModel, motion: &SpringMotion, v_m_per_s: &mut [DVec3]) {
        let vertices = vertices_of(model, &motion.ids);
        for (place, id) in gone(&motion.ids[vertices..], &self.ids) {
            let place = vertices + place;
            let edge = id - model.vertices();
            for end in model.surface().edges()[edge as usize].nodes {
                let Some(at) = self.running.place(end) else { continue };
                if model.is_held(end) {
                    continue;
                }
                let (own_kg, returned_kg) = (self.mass_kg[at], model.given_kg(end));
                let momentum = v_m_per_s[at] * own_kg + v_m_per_s[place] * returned_kg;
                self.mass_kg[at] = own_kg + returned_kg;
                v_m_per_s[at] = momentum / self.mass_kg[at];
            }
        }
    }

    /// Computes positions and velocities of the nodes that are awake next, from those of the nodes that are awake now.
    fn enter(&mut self, model: &SpringModel, x_m: &[DVec3], v_m_per_s: &[DVec3]) {
        let of = |id: u32| self.running.place(id).map(|place| (x_m[place], v_m_per_s[place]));
        let at_rest = |id: u32| (model.rest_m()[id as usize], DVec3::ZERO);
        self.x_m.clear();
        self.v_m_per_s.clear();
        for &id in &self.ids {
            let (x, v) = of(id).unwrap_or_else(|| match id.checked_sub(model.vertices()) {
                None => at_rest(id),
                Some(edge) => {
                    let [a, b] = model.surface().edges()[edge as usize].nodes.map(|end| {
                        let (x, v) = of(end).unwrap_or_else(|| at_rest(end));
                        (x - model.rest_m()[end as usize], v)
                    });
                    (model.rest_m()[id as usize] + (a.0 + b.0) * 0.5, mean_velocity(model, edge, [a.1, b.1]))
                }
            });
            self.x_m.push(x);
            self.v_m_per_s.push(v);
        }
    }
}

/// Writes the nodes that are awake at these levels into `ids`, ascending, with the coarse vertices `awake` among them.
fn choose_ids(model: &SpringModel, levels: &Levels, awake: &[u32], ids: &mut Vec<u32>) {
    ids.clear();
    ids.extend_from_slice(awake);
    let before = ids.len();
    levels.for_each_vertex(model.surface(), |vertex, _| {
        if awake.binary_search(&vertex).is_err() {
            ids.push(vertex);
        }
    });
    if ids.len() > before {
        ids.sort_unstable();
    }
    let vertices = ids.len();
    levels.for_each_edge(model.surface(), |edge, _| ids.push(model.vertices() + edge));
    ids[vertices..].sort_unstable();
}

/// Returns the entries of the ascending list `before` that are not in the ascending list `now`, each with its place in
/// the former.
fn gone<'a>(before: &'a [u32], now: &'a [u32]) -> impl Iterator<Item = (usize, u32)> + 'a {
    let mut next = now.partition_point(|id| before.first().is_some_and(|first| id < first));
    before.iter().copied().enumerate().filter(move |(_, id)| {
        while now.get(next).is_some_and(|now| now < id) {
            next += 1;
        }
        now.get(next) != Some(id)
    })
}

/// Returns the velocity (m/s) with which a node of type 2 enters: the mean of its ends' velocities, weighted by the
/// mass that each gives, so that momentum is conserved.
fn mean_velocity(model: &SpringModel, edge: u32, v_m_per_s: [DVec3; 2]) -> DVec3 {
    let [a, b] = model.surface().edges()[edge as usize].nodes.map(|end| model.given_kg(end));
    (v_m_per_s[0] * a + v_m_per_s[1] * b) / (a + b)
}

/// Returns the mass (kg) of an awake node. That of a vertex is less by what its nodes of type 2 have of it; that of a
/// held vertex is infinite. `place` tells where awake nodes are.
pub(super) fn own_mass_kg(model: &SpringModel, place: impl Fn(u32) -> Option<usize>, id: u32) -> f64 {
    if let Some(edge) = id.checked_sub(model.vertices()) {
        return model.edge_kg(edge);
    }
    if model.is_held(id) {
        return f64::INFINITY;
    }
    let there = |edge: &&u32| place(model.vertices() + **edge).is_some();
    let given = model.surface().edges_at(id).iter().filter(there).count() as f64;
    model.spec().mass_kg[id as usize] - given * model.given_kg(id)
}

fn kinetic(mass_kg: &[f64], v_m_per_s: &[DVec3]) -> f64 {
    let free = mass_kg.iter().zip(v_m_per_s).filter(|(mass, _)| mass.is_finite());
    free.map(|(mass, v)| 0.5 * mass * v.length_squared()).sum()
}
