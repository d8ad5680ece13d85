//! What carries the skin's vertices; their positions are computed when they are asked for.
use super::{body::HybridBody, clusters::Displaced, partition::NONE, running::RunningPatch};
use crate::{
    contact::{CarriersThen, ClustersThen, Skin},
    tick::CarriedSkin,
};
use glam::DVec3;

/// A vertex of the skin: its rest position, and the active particles that carry it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Carried {
    rest_m: DVec3,
    vertex: u32,
    /// Numbers of active particles, with their weights.
    active: [(u32, f64); 8],
    /// How many of them there are; more than the list holds are looked up.
    active_count: usize,
}

impl Carried {
    /// The active particles, where the list holds all of them.
    fn active(&self) -> Option<&[(u32, f64)]> {
        self.active.get(..self.active_count)
    }
}

/// The skin at one instant, as contact queries it.
pub(crate) struct SkinView<'a> {
    hybrid: &'a HybridBody,
    patch: &'a RunningPatch,
    /// Velocities (m/s) of coarse nodes and then active particles; empty where no vertex's velocity is asked for.
    v: &'a [DVec3],
    deviation_m: f64,
}

impl<'a> SkinView<'a> {
    /// Views the skin where the patch was displaced to.
    pub(crate) fn new(hybrid: &'a HybridBody, patch: &'a RunningPatch) -> Self {
        Self { hybrid, patch, v: &[], deviation_m: 0.0 }
    }

    /// Returns the same view with velocities (m/s) of coarse nodes and then active particles.
    pub(crate) fn moving(self, v: &'a [DVec3]) -> Self {
        Self { v, ..self }
    }

    /// Returns the active particles that carry a vertex, each by its number, with their weights.
    fn active_carriers(&self, vertex: u32) -> impl Iterator<Item = (u32, f64)> + '_ {
        let is_carried = self.hybrid.clusters.of_vertex(vertex).is_none_or(|at| self.patch.carries_of_cluster(at));
        let carriers = if is_carried { self.hybrid.skin_carriers.of_vertex(vertex) } else { &[] };
        let numbered = carriers.iter().map(|&(particle, weight)| (self.patch.number_of(particle), weight));
        numbered.filter(|(number, _)| *number != NONE)
    }

    /// Returns `Σ_i ω_i u_i + Σ_p w_p d_p` (m) of a vertex ([`super::skin_carriers`]), with its active particles.
    fn moved_by_m(&self, vertex: u32, active: impl Iterator<Item = (u32, f64)>) -> DVec3 {
        let asleep_m = self.hybrid.skin_carriers.of_nodes(vertex, self.patch.node_displacements_m());
        active.fold(asleep_m, |moved_m, (number, weight)| moved_m + self.patch.deviation_of_m(number) * weight)
    }

    /// Returns the position (m) of a vertex when its carriers were noted.
    fn position_then_m(&self, vertex: u32, then: &CarriersThen) -> DVec3 {
        let carriers = &self.hybrid.skin_carriers;
        let active = then.particles_m();
        let of = |particle: u32| match active.binary_search_by_key(&particle, |(particle, _)| *particle) {
            Ok(number) => active[number].1,
            Err(_) => carriers.anchor(particle).of(then.nodes_m()),
        };
        let moved: DVec3 = carriers.of_vertex(vertex).iter().map(|&(particle, weight)| of(particle) * weight).sum();
        self.hybrid.skin_rest_m()[vertex as usize] + moved
    }

    /// Returns a bound of the speed (m/s) of any vertex.
    pub(super) fn fastest_m_per_s(&self) -> f64 {
        let (of_nodes, of_particles) = self.v.split_at(self.hybrid.node_count());
        let particles_sq = of_particles.iter().map(|v| v.length_squared()).fold(0.0, f64::max);
        let influence = &self.hybrid.skin_influence;
        let tame_m_per_s = influence.bound(|node| of_nodes[node].length_squared(), particles_sq);
        let wild_m_per_s = |&vertex: &u32| self.velocity_m_per_s(vertex).length();
        influence.wild().iter().map(wild_m_per_s).fold(tame_m_per_s, f64::max)
    }

    fn displaced(&self, by_particles: bool) -> Displaced<'_> {
        Displaced {
            displacements_m: self.patch.node_displacements_m(),
            deviation_m: if by_particles { self.deviation_m } else { 0.0 },
        }
    }
}

impl Skin for SkinView<'_> {
    /// Measures how far the active particles are from where they would be asleep.
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
        self.hybrid.skin_rest_m()[vertex as usize] + self.moved_by_m(vertex, self.active_carriers(vertex))
    }

    fn remember(&self, then: &mut CarriersThen) {
        let particles_m = self.patch.active_displacements_m().map(|(particle, _, u)| (particle, u));
        then.remember(self.patch.node_displacements_m(), particles_m);
    }

    fn remember_walls(&self, cluster: usize, then: &mut ClustersThen) {
        then.is_unknown[cluster] = self.patch.carries_of_walls(cluster);
        self.hybrid.wall_clusters.remember(cluster, self.patch.node_displacements_m(), &mut then.nodes_m);
    }

    fn walls_moved_m(&self, cluster: usize, then: &ClustersThen) -> f64 {
        if then.is_unknown[cluster] || self.patch.carries_of_walls(cluster) {
            return f64::INFINITY;
        }
        self.hybrid.wall_clusters.moved_m(cluster, self.patch.node_displacements_m(), &then.nodes_m)
    }

    /// Vertices follow particles, and those the coarse nodes unless they are active or were ([`super::skin_influence`]).
    fn moved_m(&self, then: &CarriersThen) -> f64 {
        let (nodes_m, carriers) = (self.patch.node_displacements_m(), &self.hybrid.skin_carriers);
        let (mut asleep_sq, mut active_sq) = (0.0, 0.0);
        let mut fell_asleep = |&(particle, then_m): &(u32, DVec3)| {
            let now_m = if carriers.has(particle) { carriers.anchor(particle).of(nodes_m) } else { then_m };
            asleep_sq = f64::max(asleep_sq, now_m.distance_squared(then_m));
        };
        let mut earlier = then.particles_m().iter().peekable();
        for (particle, anchor, now_m) in self.patch.active_displacements_m() {
            while let Some(other) = earlier.next_if(|(other, _)| *other < particle) {
                fell_asleep(other);
            }
            let was_active = earlier.next_if(|(other, _)| *other == particle);
            let then_m = was_active.map_or_else(|| anchor.of(then.nodes_m()), |(_, then_m)| *then_m);
            active_sq = f64::max(active_sq, now_m.distance_squared(then_m));
        }
        earlier.for_each(fell_asleep);
        let node_sq = |node: usize| nodes_m[node].distance_squared(then.nodes_m()[node]);
        let tame_m = self.hybrid.skin_influence.bound(node_sq, f64::max(asleep_sq, active_sq));
        let wild_m = |&vertex: &u32| (self.position_m(vertex) - self.position_then_m(vertex, then)).length();
        self.hybrid.skin_influence.wild().iter().map(wild_m).fold(tame_m, f64::max)
    }
}

impl CarriedSkin for SkinView<'_> {
    type Carriers = Carried;

    fn layout(&self) -> u64 {
        self.patch.number()
    }

    fn carriers(&self, vertex: u32) -> Carried {
        let mut carried = Carried {
            rest_m: self.hybrid.skin_rest_m()[vertex as usize],
            vertex,
            active: [(0, 0.0); 8],
            active_count: 0,
        };
        for carrier in self.active_carriers(vertex) {
            if let Some(slot) = carried.active.get_mut(carried.active_count) {
                *slot = carrier;
            }
            carried.active_count += 1;
        }
        carried
    }

    fn carried_m(&self, carried: &Carried) -> DVec3 {
        match carried.active() {
            Some(active) => carried.rest_m + self.moved_by_m(carried.vertex, active.iter().copied()),
            None => carried.rest_m + self.moved_by_m(carried.vertex, self.active_carriers(carried.vertex)),
        }
    }

    fn velocity_m_per_s(&self, vertex: u32) -> DVec3 {
        let (carriers, nodes) = (&self.hybrid.skin_carriers, self.hybrid.node_count());
        let mut v_m_per_s = carriers.of_nodes(vertex, self.v);
        for (number, weight) in self.active_carriers(vertex) {
            let asleep = carriers.anchor(self.patch.active()[number as usize]).of(self.v);
            v_m_per_s += (self.v[nodes + number as usize] - asleep) * weight;
        }
        v_m_per_s
    }

    /// The transpose of the positions' weights.
    fn push(&self, carried: &Carried, force_n: DVec3, forces_n: &mut [DVec3]) {
        let carriers = &self.hybrid.skin_carriers;
        if carried.active_count == 0 {
            for &(node, weight) in carriers.nodes_of_vertex(carried.vertex) {
                forces_n[node as usize] += force_n * weight;
            }
            return;
        }
        for &(particle, weight) in carriers.of_vertex(carried.vertex) {
            match self.patch.number_of(particle) {
                NONE => carriers.anchor(particle).push(force_n * weight, forces_n),
                number => forces_n[self.hybrid.node_count() + number as usize] += force_n * weight,
            }
        }
    }
}

impl HybridBody {
    /// Returns the position (m) of a vertex of the skin, at positions `x` (m) of coarse nodes and then of the active
    /// particles `active`.
    pub fn vertex_m(&self, vertex: u32, active: &[u32], x: &[DVec3]) -> DVec3 {
        let rest_m = self.skin_rest_m()[vertex as usize];
        let carriers = self.carriers_of_vertex(vertex).iter();
        rest_m + carriers.map(|&(particle, w)| self.particle_moved_m(particle, active, x) * w).sum::<DVec3>()
    }

    /// Returns the displacement (m) of a particle, active or not, at such positions.
    pub(super) fn particle_moved_m(&self, particle: u32, active: &[u32], x: &[DVec3]) -> DVec3 {
        let (of_nodes, of_particles) = x.split_at(self.node_count());
        let x = match active.binary_search(&particle) {
            Ok(number) => of_particles[number],
            Err(_) => self.partition.anchor(particle).of(of_nodes),
        };
        x - self.partition.particle_m(particle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::hybrid::{
            prestrain::PrestrainDecay,
            skin_carriers::SkinCarriers,
            testing::{Random, hybrid_ball, tissue},
        },
        contact::MostCarriers,
        settings::Precision,
    };

    /// Returns a patch with these particles awake, its nodes and particles displaced at random.
    fn displaced(body: &HybridBody, active: &[u32], size_m: f64, random: &mut Random) -> RunningPatch {
        let mut patch = RunningPatch::new(body, 2000, Precision::Double);
        patch.wake(body, active, &PrestrainDecay::default());
        let rest = body.partition.coarse().positions_m().iter().copied();
        let of_particles = active.iter().map(|&particle| body.partition.particle_m(particle));
        let x: Vec<DVec3> = rest.chain(of_particles).map(|rest| rest + random.vector() * size_m).collect();
        patch.displace(body, &x);
        patch
    }

    /// Sets of particles to be awake: none, one side, the other side, all.
    fn sets(body: &HybridBody) -> [Vec<u32>; 4] {
        let all: Vec<u32> = (0..body.partition.particle_count() as u32).filter(|&p| body.may_wake(p)).collect();
        let some = |of: fn(DVec3) -> bool| -> Vec<u32> {
            all.iter().copied().filter(|&particle| of(body.partition.particle_m(particle))).collect()
        };
        [vec![], some(|p| p.x > 2e-3), some(|p| p.y > -2e-3), all.clone()]
    }

    /// Positions and velocities are those of the plain sum over particles, whether clusters tell that nothing active carries a vertex or
    /// not, and forces go where work needs them to: `Σ f_i·v_i = f·v`.
    #[test]
    fn vertices_are_where_their_particles_are_and_push_them_as_they_are_moved() {
        let [material, other, _] = tissue();
        let mut body = hybrid_ball(&[material, other]);
        let triangles = body.particles.skin.triangles().to_vec();
        let mut random = Random(5);
        for (clustered, smooth) in [(false, false), (true, false), (false, true), (true, true)] {
            body.skin_carriers = SkinCarriers::new(&body.partition, &body.vertex_points, smooth);
            body.cluster(if clustered { &triangles } else { &[] });
            for active in sets(&body) {
                let patch = displaced(&body, &active, 1e-3, &mut random);
                let rest = body.partition.coarse().positions_m().iter().copied();
                let rest = rest.chain(active.iter().map(|&particle| body.partition.particle_m(particle)));
                let u = patch.node_displacements_m().iter().copied();
                let u = u.chain(patch.active_displacements_m().map(|(_, _, u)| u));
                let x: Vec<DVec3> = rest.clone().zip(u).map(|(rest, u)| rest + u).collect();
                let v: Vec<DVec3> = x.iter().map(|_| random.vector()).collect();
                let there: Vec<DVec3> = rest.zip(&v).map(|(rest, v)| rest + *v).collect();
                let view = SkinView::new(&body, &patch).moving(&v);
                for vertex in 0..body.skin_rest_m().len() as u32 {
                    let [expected_m, moved_m] = [&x, &there].map(|x| body.vertex_m(vertex, &active, x));
                    assert!(view.position_m(vertex).distance(expected_m) < 1e-15, "{vertex}");
                    let carried = view.carriers(vertex);
                    assert_eq!(view.carried_m(&carried), view.position_m(vertex));
                    let (velocity, rest_m) = (view.velocity_m_per_s(vertex), body.skin_rest_m()[vertex as usize]);
                    assert!(velocity.distance(moved_m - rest_m) < 1e-12, "{velocity} {}", moved_m - rest_m);
                    let (force_n, mut forces_n) = (random.vector(), vec![DVec3::ZERO; v.len()]);
                    view.push(&carried, force_n, &mut forces_n);
                    let power_w: f64 = forces_n.iter().zip(&v).map(|(f, v)| f.dot(*v)).sum();
                    assert!((power_w - force_n.dot(velocity)).abs() < 1e-12, "{power_w}");
                }
            }
        }
    }

    #[test]
    fn vertices_never_move_farther_than_their_carriers_tell() {
        let [material, other, _] = tissue();
        let mut body = hybrid_ball(&[material, other]);
        let triangles = body.particles.skin.triangles().to_vec();
        let of_clusters = body.cluster_walls(&triangles);
        let (body, sets) = (&body, sets(&body));
        let most = MostCarriers { nodes: body.node_count(), active: sets[3].len(), of_clusters };
        let clusters = body.wall_clusters.clusters();
        let mut told = 0;
        let mut random = Random(17);
        let vertices = body.skin_rest_m().len() as u32;
        let place = |patch: &RunningPatch| -> Vec<DVec3> {
            (0..vertices).map(|vertex| SkinView::new(body, patch).position_m(vertex)).collect()
        };
        for (before, after) in sets.iter().flat_map(|before| sets.iter().map(move |after| (before, after))) {
            for size_m in [1e-6, 1e-3] {
                let then = displaced(body, before, size_m, &mut random);
                let now = displaced(body, after, size_m, &mut random);
                let mut carriers_then = CarriersThen::with_room(most);
                SkinView::new(body, &then).remember(&mut carriers_then);
                let bound_m = SkinView::new(body, &now).moved_m(&carriers_then);
                let each_m: Vec<f64> = place(&then).iter().zip(place(&now)).map(|(a, b)| a.distance(b)).collect();
                let moved_m = each_m.iter().copied().fold(0.0, f64::max);
                assert!(moved_m <= bound_m, "{moved_m} {bound_m}");
                let mut clusters_then = ClustersThen::with_room(most, clusters);
                for cluster in 0..clusters {
                    SkinView::new(body, &then).remember_walls(cluster, &mut clusters_then);
                    let bound_m = SkinView::new(body, &now).walls_moved_m(cluster, &clusters_then);
                    let of_cluster = body.wall_clusters.vertices(cluster).iter();
                    let moved_m = of_cluster.map(|&vertex| each_m[vertex as usize]).fold(0.0, f64::max);
                    assert!(moved_m <= bound_m, "cluster {cluster}: {moved_m} {bound_m}");
                    told += u32::from(bound_m < 3.0 * body.amplification() * size_m * 2.0);
                }
                assert!(bound_m < 3.0 * body.amplification() * size_m * 2.0, "{bound_m}");
                assert_eq!(SkinView::new(body, &then).moved_m(&carriers_then), 0.0);
            }
        }
        // Where nothing is awake, and elsewhere beside what is.
        assert!(told as usize > 3 * clusters, "{told} of {clusters} clusters");
    }
}
