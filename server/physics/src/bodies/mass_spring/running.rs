//! The springs of the awake nodes as the loop computes them. The oracle is [`super::Net`].
//!
//! An awake node has the place of its id in the ascending list of ids, so coarse vertices come first. After the awake
//! nodes come their sleeping neighbours, which are at their rest positions. The springs of the coarse surface are laid
//! out whenever other vertices wake. The springs that levels add ([`super::blend`]) are a list of their own, which is
//! made anew while levels change.
use super::kernels::{HalfSpring, SpringRows};
use super::{
    blend::{Added, Levels},
    model::SpringModel,
    places::Places,
    region::Constants,
};
use glam::DVec3;

/// The springs of the awake nodes.
#[derive(Debug, Clone)]
pub struct RunningSprings {
    /// Mesh springs of the coarse surface.
    rows: SpringRows,
    /// Places of the awake nodes, then of the sleeping neighbours of awake vertices.
    places: Places,
    /// Number of awake nodes.
    awake: usize,
    /// Positions (m) by place.
    places_m: Vec<DVec3>,
    /// Mesh springs that levels add.
    added: Vec<AddedSpring>,
    /// Ties of the nodes of type 2.
    ties: Vec<Tie>,
    /// Places of anchor springs, each with the stiffness (N/m) that levels add to it.
    added_anchors: Vec<(u32, f64)>,
    /// Stiffness (N/m) of the awake nodes' anchor springs.
    anchor_n_per_m: Vec<f64>,
}

/// A mesh spring that levels add, between two places.
#[derive(Debug, Clone, Copy)]
struct AddedSpring {
    places: [u32; 2],
    rest_length_m: f64,
    stiffness_n_per_m: f64,
}

/// A tie between three places.
#[derive(Debug, Clone, Copy)]
struct Tie {
    /// Place of the node, then of the ends of its edge.
    places: [u32; 3],
    /// Offset `X_e − ½ (X_a + X_b)` (m) at rest.
    beside_m: DVec3,
    stiffness_n_per_m: f64,
}

impl RunningSprings {
    /// Returns buffers with room for as many nodes as may be awake and as many triangles as may be refined.
    pub fn with_room(model: &SpringModel) -> Self {
        let most_refined = model.spec().most_refined;
        let surface = model.surface();
        let at = |vertex: u32| surface.edges_at(vertex).len();
        let most_at = (0..model.vertices()).map(at).max().unwrap_or_default();
        let awake = model.most_nodes();
        let vertices = awake.min(model.vertices() as usize);
        // A block of eight vertices has as many slots as its vertex with the most springs.
        let rows = SpringRows::with_room(vertices, most_at);
        let places = (awake + vertices * most_at).min(model.rest_m().len());
        Self {
            rows,
            places: Places::with_room(model.rest_m().len(), places),
            awake: 0,
            places_m: Vec::with_capacity(places),
            // A triangle has three springs inside; each of its edges has the coarse one, two halves and two crack
            // springs.
            added: Vec::with_capacity(18 * most_refined),
            ties: Vec::with_capacity(3 * most_refined),
            added_anchors: Vec::with_capacity(6 * most_refined),
            anchor_n_per_m: Vec::with_capacity(awake),
        }
    }

    /// Lays out the springs of the coarse surface for the awake nodes `ids`, which are ascending. Nothing is allocated.
    pub fn lay_out(&mut self, model: &SpringModel, ids: &[u32]) {
        let (surface, vertices) = (model.surface(), vertices_of(model, ids));
        // Vertices come first: rows stay valid while the vertices are the same and no sleeping neighbours come after
        // other nodes.
        let has_rows = self.rows.nodes() == vertices
            && self.places.nodes().len() == self.awake
            && self.places.nodes().get(..vertices) == Some(&ids[..vertices]);
        self.places.clear();
        for &id in ids {
            self.places.push(id);
        }
        self.awake = ids.len();
        if has_rows {
            return;
        }
        for &vertex in &ids[..vertices] {
            surface.neighbours(vertex).for_each(|neighbour| self.places.push(neighbour));
        }
        self.rows.clear();
        for &vertex in &ids[..vertices] {
            let half = |&edge: &u32| {
                let neighbour = surface.other_end(edge, vertex);
                let [a, b] = [vertex, neighbour].map(|node| model.rest_m()[node as usize]);
                Some(HalfSpring {
                    neighbour: self.places.of(neighbour)?,
                    rest_length_m: a.distance(b),
                    stiffness_n_per_m: model.spec().coarse.mesh_n_per_m,
                })
            };
            self.rows.push(surface.edges_at(vertex).iter().filter_map(half));
        }
    }

    /// Returns the place of a node, where it is awake.
    pub fn place(&self, id: u32) -> Option<usize> {
        self.places.of(id).map(|place| place as usize).filter(|place| *place < self.awake)
    }

    /// Makes the lists of what levels add, for the nodes that were laid out last. Nothing is allocated.
    pub fn add_levels(&mut self, model: &SpringModel, ids: &[u32], levels: &Levels, fine: &Constants) {
        let vertices = vertices_of(model, ids);
        let Self { added, ties, added_anchors, anchor_n_per_m, places, awake, .. } = self;
        added.clear();
        ties.clear();
        added_anchors.clear();
        anchor_n_per_m.clear();
        anchor_n_per_m.resize(ids.len(), 0.0);
        anchor_n_per_m[..vertices].fill(model.spec().coarse.anchor_n_per_m);
        levels.for_each_added(model.surface(), model.rest_m(), &model.spec().coarse, fine, |what| match what {
            Added::Spring { nodes, rest_length_m, stiffness_n_per_m } => {
                if let [Some(a), Some(b)] = nodes.map(|node| places.of(node)) {
                    added.push(AddedSpring { places: [a, b], rest_length_m, stiffness_n_per_m });
                }
            }
            Added::Anchor { node, stiffness_n_per_m } => {
                if let Some(place) = places.of(node).filter(|place| (*place as usize) < *awake) {
                    anchor_n_per_m[place as usize] += stiffness_n_per_m;
                    added_anchors.push((place, stiffness_n_per_m));
                }
            }
            Added::Tie { nodes, stiffness_n_per_m } => {
                if let [Some(node), Some(a), Some(b)] = nodes.map(|node| places.of(node)) {
                    let [x, ends @ ..] = nodes.map(|node| model.rest_m()[node as usize]);
                    let beside_m = x - (ends[0] + ends[1]) * 0.5;
                    ties.push(Tie { places: [node, a, b], beside_m, stiffness_n_per_m });
                }
            }
        });
    }

    /// Sets the positions by place: of the awake nodes to `x_m` (m), and of sleeping neighbours to their rest
    /// positions.
    fn put(&mut self, model: &SpringModel, x_m: &[DVec3]) {
        self.places_m.clear();
        self.places_m.extend_from_slice(x_m);
        let sleeping = &self.places.nodes()[self.awake..];
        self.places_m.extend(sleeping.iter().map(|&node| model.rest_m()[node as usize]));
    }

    /// Adds the springs' forces (N) on the awake nodes, which are at `x_m` (m).
    pub fn add_forces_n(&mut self, model: &SpringModel, ids: &[u32], x_m: &[DVec3], forces_n: &mut [DVec3]) {
        self.put(model, x_m);
        self.rows.add_forces_n(&self.places_m, forces_n);
        for spring in &self.added {
            let (pull_n, places) = (spring.pull_n(&self.places_m), spring.places.map(|place| place as usize));
            for (place, pull_n) in places.into_iter().zip([pull_n, -pull_n]) {
                if let Some(force_n) = forces_n.get_mut(place) {
                    *force_n += pull_n;
                }
            }
        }
        for tie in &self.ties {
            let pull_n = tie.off_m(tie.places.map(|place| self.places_m[place as usize])) * -tie.stiffness_n_per_m;
            for (place, pull_n) in tie.places.into_iter().zip([pull_n, pull_n * -0.5, pull_n * -0.5]) {
                if let Some(force_n) = forces_n.get_mut(place as usize) {
                    *force_n += pull_n;
                }
            }
        }
        let law = &model.spec().anchor_law;
        for ((force_n, x_m), (id, stiffness)) in forces_n.iter_mut().zip(x_m).zip(ids.iter().zip(&self.anchor_n_per_m))
        {
            let u = *x_m - model.rest_m()[*id as usize];
            *force_n -= law.stretched(u) * *stiffness;
        }
    }

    /// Returns the energy (J) of the springs and ties that levels add, which is the part that changes with levels.
    pub fn energy_of_levels_j(&self, model: &SpringModel, x_m: &[DVec3]) -> f64 {
        let rest_of_m = |place: u32| model.rest_m()[self.places.nodes()[place as usize] as usize];
        let at = |place: u32| x_m.get(place as usize).copied().unwrap_or_else(|| rest_of_m(place));
        let of_springs = self.added.iter().map(|spring| spring.energy_j(spring.places.map(at))).sum::<f64>();
        let of_ties = self.ties.iter().map(|tie| tie.energy_j(tie.places.map(at))).sum::<f64>();
        let of_anchor = |&(place, stiffness): &(u32, f64)| {
            stiffness * model.spec().anchor_law.at(at(place).distance(rest_of_m(place))).integral_m2
        };
        of_springs + of_ties + self.added_anchors.iter().map(of_anchor).sum::<f64>()
    }
}

impl AddedSpring {
    fn pull_n(&self, places_m: &[DVec3]) -> DVec3 {
        let [a, b] = self.places.map(|place| places_m[place as usize]);
        let l = b - a;
        let length_m = l.length();
        if length_m > 0.0 { l * (self.stiffness_n_per_m * (1.0 - self.rest_length_m / length_m)) } else { DVec3::ZERO }
    }

    fn energy_j(&self, [a, b]: [DVec3; 2]) -> f64 {
        0.5 * self.stiffness_n_per_m * (a.distance(b) - self.rest_length_m).powi(2)
    }
}

impl Tie {
    /// Returns the length `u_e − ½ (u_a + u_b)` (m) of the tie.
    fn off_m(&self, [x, a, b]: [DVec3; 3]) -> DVec3 {
        x - (a + b) * 0.5 - self.beside_m
    }

    fn energy_j(&self, at_m: [DVec3; 3]) -> f64 {
        0.5 * self.stiffness_n_per_m * self.off_m(at_m).length_squared()
    }
}

/// Returns how many of the ascending `ids` are coarse vertices.
pub(super) fn vertices_of(model: &SpringModel, ids: &[u32]) -> usize {
    ids.partition_point(|&id| id < model.vertices())
}
