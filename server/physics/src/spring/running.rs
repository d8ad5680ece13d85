//! The springs of the nodes that are awake, as the loop computes them; their oracle is [`super::Net`].
//!
//! Awake nodes are numbered by their place among the ids, ascending, coarse vertices first. Springs go over them and over the sleeping neighbours behind them, which are at home. Those of the coarse
//! surface are laid out when other vertices wake; what levels add to them ([`super::blend`]) is a list of its own, made anew while levels change.
use super::{
    blend::{Added, Levels},
    model::SpringModel,
    region::Constants,
};
use crate::simd::{HalfSpring, SpringRows};
use glam::DVec3;

/// Springs of a number of awake nodes.
#[derive(Debug, Clone)]
pub struct RunningSprings {
    /// Of the coarse surface.
    rows: SpringRows,
    /// Sleeping neighbours of awake vertices, ascending.
    sleeping: Vec<u32>,
    /// Positions (m) of awake nodes, then of sleeping neighbours.
    places_m: Vec<DVec3>,
    /// What levels add.
    added: Vec<AddedSpring>,
    /// Stiffness (N/m) of the awake nodes' home springs.
    home_n_per_m: Vec<f64>,
}

/// An added spring between places.
#[derive(Debug, Clone, Copy)]
struct AddedSpring {
    places: [u32; 2],
    rest_length_m: f64,
    stiffness_n_per_m: f64,
}

impl RunningSprings {
    /// Room for as many nodes as may be awake and as many triangles as may be refined.
    pub fn with_room(model: &SpringModel) -> Self {
        let spec = model.spec();
        let surface = model.surface();
        let at = |vertex: u32| surface.edges_at(vertex).len();
        let most_at = (0..model.vertices()).map(at).max().unwrap_or_default();
        let awake = spec.most_awake.min(model.rest_m().len());
        let vertices = awake.min(model.vertices() as usize);
        // Blocks of eight have as many slots as the vertex in them with most springs.
        let rows = SpringRows::with_room(vertices, most_at);
        let ghosts = vertices * most_at;
        Self {
            rows,
            sleeping: Vec::with_capacity(ghosts),
            places_m: Vec::with_capacity(awake + ghosts),
            // Of a triangle three inside; of each of its edges the coarse one, two halves and two cracks.
            added: Vec::with_capacity(18 * spec.most_refined),
            home_n_per_m: Vec::with_capacity(awake),
        }
    }

    /// Lays out the springs of the coarse surface for awake nodes (ascending). Allocates nothing.
    pub fn lay_out(&mut self, model: &SpringModel, ids: &[u32]) {
        let (surface, vertices) = (model.surface(), vertices_of(model, ids));
        self.sleeping.clear();
        for &vertex in &ids[..vertices] {
            for neighbour in surface.neighbours(vertex) {
                if ids[..vertices].binary_search(&neighbour).is_err() {
                    self.sleeping.push(neighbour);
                }
            }
        }
        self.sleeping.sort_unstable();
        self.sleeping.dedup();
        self.rows.clear();
        for &vertex in &ids[..vertices] {
            let half = |&edge: &u32| {
                let neighbour = surface.other_end(edge, vertex);
                let [a, b] = [vertex, neighbour].map(|node| model.rest_m()[node as usize]);
                Some(HalfSpring {
                    neighbour: place_of(ids, &self.sleeping, neighbour)?,
                    rest_length_m: a.distance(b),
                    stiffness_n_per_m: model.spec().coarse.mesh_n_per_m,
                })
            };
            self.rows.push(surface.edges_at(vertex).iter().filter_map(half));
        }
    }

    /// Makes the list of what levels add, for the nodes last laid out. Allocates nothing.
    pub fn add_levels(&mut self, model: &SpringModel, ids: &[u32], levels: &Levels, fine: &Constants) {
        let vertices = vertices_of(model, ids);
        let Self { added, home_n_per_m, sleeping, .. } = self;
        added.clear();
        home_n_per_m.clear();
        home_n_per_m.resize(ids.len(), 0.0);
        home_n_per_m[..vertices].fill(model.spec().coarse.home_n_per_m);
        levels.for_each_added(model.surface(), model.rest_m(), (&model.spec().coarse, fine), |what| match what {
            Added::Spring { nodes, rest_length_m, stiffness_n_per_m } => {
                if let [Some(a), Some(b)] = nodes.map(|node| place_of(ids, sleeping, node)) {
                    added.push(AddedSpring { places: [a, b], rest_length_m, stiffness_n_per_m });
                }
            }
            Added::Home { node, stiffness_n_per_m } => {
                if let Ok(place) = ids.binary_search(&node) {
                    home_n_per_m[place] += stiffness_n_per_m;
                }
            }
        });
    }

    /// Takes the awake nodes' positions (m).
    fn place(&mut self, model: &SpringModel, x_m: &[DVec3]) {
        self.places_m.clear();
        self.places_m.extend_from_slice(x_m);
        self.places_m.extend(self.sleeping.iter().map(|&node| model.rest_m()[node as usize]));
    }

    /// Adds the springs' forces (N) on awake nodes at `x_m` (m).
    pub fn add_forces_n(&mut self, model: &SpringModel, ids: &[u32], x_m: &[DVec3], forces_n: &mut [DVec3]) {
        self.place(model, x_m);
        self.rows.add_forces_n(&self.places_m, forces_n);
        for spring in &self.added {
            let (pull_n, places) = (spring.pull_n(&self.places_m), spring.places.map(|place| place as usize));
            for (place, pull_n) in places.into_iter().zip([pull_n, -pull_n]) {
                if let Some(force_n) = forces_n.get_mut(place) {
                    *force_n += pull_n;
                }
            }
        }
        let law = &model.spec().home_law;
        for ((force_n, x_m), (id, stiffness)) in forces_n.iter_mut().zip(x_m).zip(ids.iter().zip(&self.home_n_per_m)) {
            let u = *x_m - model.rest_m()[*id as usize];
            *force_n -= law.stretched(u) * *stiffness;
        }
    }

    /// Energy (J) of what levels add and of all home springs: what changes with levels.
    pub fn changing_energy_j(&mut self, model: &SpringModel, ids: &[u32], x_m: &[DVec3]) -> f64 {
        self.place(model, x_m);
        let of_added = self.added.iter().map(|spring| spring.energy_j(&self.places_m)).sum::<f64>();
        let homes = x_m.iter().zip(ids).zip(&self.home_n_per_m);
        let of_home = |((x_m, id), stiffness): ((&DVec3, &u32), &f64)| {
            let u_m = x_m.distance(model.rest_m()[*id as usize]);
            stiffness * model.spec().home_law.at(u_m).integral_m2
        };
        of_added + homes.map(of_home).sum::<f64>()
    }
}

impl AddedSpring {
    fn pull_n(&self, places_m: &[DVec3]) -> DVec3 {
        let [a, b] = self.places.map(|place| places_m[place as usize]);
        let l = b - a;
        let length_m = l.length();
        if length_m > 0.0 { l * (self.stiffness_n_per_m * (1.0 - self.rest_length_m / length_m)) } else { DVec3::ZERO }
    }

    fn energy_j(&self, places_m: &[DVec3]) -> f64 {
        let [a, b] = self.places.map(|place| places_m[place as usize]);
        0.5 * self.stiffness_n_per_m * (a.distance(b) - self.rest_length_m).powi(2)
    }
}

/// How many of the ids, ascending, are coarse vertices.
pub(super) fn vertices_of(model: &SpringModel, ids: &[u32]) -> usize {
    ids.partition_point(|&id| id < model.vertices())
}

/// Where a node is among awake ones and their sleeping neighbours.
fn place_of(ids: &[u32], sleeping: &[u32], node: u32) -> Option<u32> {
    let among_sleeping = || sleeping.binary_search(&node).map(|place| ids.len() + place);
    ids.binary_search(&node).or_else(|_| among_sleeping()).ok().map(|place| place as u32)
}
