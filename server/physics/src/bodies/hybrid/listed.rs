//! The skin's vertices that something acts on, and where any other is when asked.
use super::{body::Hybrid, clusters::Displaced, composite::Anchor, partition::NONE, running::RunningPatch};
use crate::{contact::broad::Skin, world::State};
use glam::DVec3;

/// Vertices of the skin whose positions are kept up to date, because tools or loads are at them.
#[derive(Debug, Clone)]
pub(crate) struct ListedSkin {
    /// Positions (m) of all vertices, of use at the listed ones.
    pub(crate) x: Vec<DVec3>,
    /// Forces (N) on all vertices, zero but at the listed ones.
    pub(crate) forces_n: Vec<DVec3>,
    listed: Vec<Listed>,
    is_listed: Vec<bool>,
    /// Of which patch the rows are.
    patch: u64,
}

/// A vertex with what carries it.
#[derive(Debug, Clone, Copy)]
struct Listed {
    vertex: u32,
    rest_m: DVec3,
    carriers: [(Carrier, f64); 8],
    /// How many of them have weight, the first ones.
    weighty: usize,
}

impl Listed {
    fn carriers(&self) -> &[(Carrier, f64)] {
        &self.carriers[..self.weighty]
    }
}

/// What carries a particle.
#[derive(Debug, Clone, Copy)]
enum Carrier {
    /// A point of the patch, by its number.
    Point(u32),
    /// The coarse nodes alone.
    Nodes(Anchor),
}

impl ListedSkin {
    pub(crate) fn new(hybrid: &Hybrid) -> Self {
        let vertices = hybrid.places.len();
        Self {
            x: vec![DVec3::ZERO; vertices],
            forces_n: vec![DVec3::ZERO; vertices],
            listed: Vec::with_capacity(vertices),
            is_listed: vec![false; vertices],
            patch: u64::MAX,
        }
    }

    /// Whether the list was made with another patch.
    pub(crate) fn is_outdated(&self, patch: &RunningPatch) -> bool {
        self.patch != patch.number()
    }

    /// Whether a vertex is listed.
    pub(crate) fn is_listed(&self, vertex: u32) -> bool {
        self.is_listed[vertex as usize]
    }

    /// Leaves all vertices, to be listed anew for a patch.
    pub(crate) fn start(&mut self, patch: &RunningPatch) {
        for listed in &self.listed {
            self.is_listed[listed.vertex as usize] = false;
        }
        self.listed.clear();
        self.patch = patch.number();
    }

    /// Lists a vertex. Allocates nothing.
    pub(crate) fn list(&mut self, hybrid: &Hybrid, patch: &RunningPatch, rest_positions_m: &[DVec3], vertex: u32) {
        if std::mem::replace(&mut self.is_listed[vertex as usize], true) {
            return;
        }
        let place = hybrid.places[vertex as usize];
        let rest_m = rest_positions_m[vertex as usize];
        let mut listed = Listed { vertex, rest_m, carriers: [(Carrier::Point(NONE), 0.0); 8], weighty: 0 };
        let particles = hybrid.partition.corners(place.cell as usize);
        for (particle, weight) in particles.into_iter().zip(place.weights(&hybrid.partition)) {
            if weight != 0.0 {
                let carrier = match patch.point_of(particle) {
                    NONE => Carrier::Nodes(hybrid.partition.anchor(particle)),
                    point => Carrier::Point(point),
                };
                listed.carriers[listed.weighty] = (carrier, weight);
                listed.weighty += 1;
            }
        }
        self.listed.push(listed);
    }

    /// Nothing more is listed. Vertices go in their order, so that sums have the same bits whenever and wherefore they were listed.
    pub(crate) fn finish(&mut self) {
        self.listed.sort_unstable_by_key(|listed| listed.vertex);
    }

    /// Positions and no forces at the listed vertices, where the patch was displaced to.
    pub(crate) fn refresh(&mut self, patch: &RunningPatch) {
        for listed in &self.listed {
            let of = |carrier: &Carrier| match carrier {
                Carrier::Point(point) => patch.displacements_m()[*point as usize],
                Carrier::Nodes(anchor) => anchor.of(patch.node_displacements_m()),
            };
            let moved: DVec3 = listed.carriers().iter().map(|(carrier, weight)| of(carrier) * *weight).sum();
            self.x[listed.vertex as usize] = listed.rest_m + moved;
            self.forces_n[listed.vertex as usize] = DVec3::ZERO;
        }
    }

    /// Hands the forces on vertices to coarse nodes and active particles.
    pub(crate) fn hand_over(&self, nodes: usize, patch: &RunningPatch, forces_n: &mut [DVec3]) {
        for listed in &self.listed {
            let force_n = self.forces_n[listed.vertex as usize];
            if force_n == DVec3::ZERO {
                continue;
            }
            for (carrier, weight) in listed.carriers() {
                match carrier {
                    Carrier::Nodes(anchor) => anchor.push(force_n * *weight, forces_n),
                    Carrier::Point(point) => patch.push(*point, force_n * *weight, nodes, forces_n),
                }
            }
        }
    }
}

/// Where the skin is, for a query of contact.
pub(crate) struct SkinView<'a> {
    hybrid: &'a Hybrid,
    patch: &'a RunningPatch,
    rest_positions_m: &'a [DVec3],
    deviation_m: f64,
}

impl<'a> SkinView<'a> {
    /// At where the patch was displaced to.
    pub(crate) fn new(hybrid: &'a Hybrid, patch: &'a RunningPatch, rest_positions_m: &'a [DVec3]) -> Self {
        Self { hybrid, patch, rest_positions_m, deviation_m: 0.0 }
    }

    fn displaced(&self, by_particles: bool) -> Displaced<'_> {
        Displaced {
            displacements_m: self.patch.node_displacements_m(),
            deviation_m: if by_particles { self.deviation_m } else { 0.0 },
            amplification: self.hybrid.amplification,
        }
    }
}

impl Skin for SkinView<'_> {
    /// Takes how far the active particles are from where they would be asleep.
    fn begin(&mut self) {
        self.deviation_m = self.patch.deviation_m();
    }

    fn clusters(&self) -> usize {
        self.hybrid.clusters.clusters()
    }

    fn vertices(&self, cluster: usize) -> &[u32] {
        self.hybrid.clusters.vertices(cluster)
    }

    fn group_distance_m(&self, group: usize, from_m: DVec3) -> f64 {
        self.hybrid.clusters.group_distance_m(group, from_m, &self.displaced(self.patch.carries_of_group(group)))
    }

    fn cluster_distance_m(&self, cluster: usize, from_m: DVec3) -> f64 {
        let displaced = self.displaced(self.patch.carries_of_cluster(cluster));
        self.hybrid.clusters.cluster_distance_m(cluster, from_m, &displaced)
    }

    fn position_m(&self, vertex: u32) -> DVec3 {
        let place = self.hybrid.places[vertex as usize];
        let partition = &self.hybrid.partition;
        let of = |particle: u32| match self.patch.point_of(particle) {
            NONE => partition.anchor(particle).of(self.patch.node_displacements_m()),
            point => self.patch.displacements_m()[point as usize],
        };
        let particles = partition.corners(place.cell as usize);
        let moved: DVec3 = particles.into_iter().zip(place.weights(partition)).map(|(p, w)| of(p) * w).sum();
        self.rest_positions_m[vertex as usize] + moved
    }
}

impl Hybrid {
    /// Velocity (m/s) of a vertex of the skin, from those of coarse nodes and then active particles.
    pub(crate) fn velocity_m_per_s(&self, patch: &RunningPatch, vertex: u32, v: &[DVec3]) -> DVec3 {
        let place = self.places[vertex as usize];
        let of = |particle: u32| match patch.number_of(particle) {
            NONE => self.partition.anchor(particle).of(v),
            number => v[self.node_count() + number as usize],
        };
        let particles = self.partition.corners(place.cell as usize);
        let weighty = particles.into_iter().zip(place.weights(&self.partition)).filter(|(_, weight)| *weight != 0.0);
        weighty.map(|(particle, weight)| of(particle) * weight).sum()
    }

    /// Where a vertex of the skin is (m).
    pub fn vertex_m(&self, vertex: u32, rest_m: DVec3, state: &State) -> DVec3 {
        let (of_nodes, of_particles) = state.x.split_at(self.node_count());
        let moved = |particle: u32| {
            let x = match state.active.ids().binary_search(&particle) {
                Ok(number) => of_particles[number],
                Err(_) => self.partition.anchor(particle).of(of_nodes),
            };
            x - self.partition.particle_m(particle)
        };
        let place = self.places[vertex as usize].place(&self.partition);
        rest_m + place.particles.into_iter().zip(place.weights).map(|(p, w)| moved(p) * w).sum::<DVec3>()
    }
}
