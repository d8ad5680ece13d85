//! A hybrid body with some of its particles awake, whose equilibrium is sought.
//!
//! The *unknowns* of an equilibrium are positions (m): of the coarse nodes, of the awake particles, then of all tools.
//! The skin follows them linearly, `y_v = Y_v + Σ_q w_vq (x_q − X_q)`, and forces on it act on them by the same
//! weights. A *configuration* of contact lists the skin's vertices, then the tools.
use crate::{
    bodies::hybrid::{
        HybridBody,
        patch::{Field, KEPT, Patch},
    },
    tick::Environment,
};
use glam::{BVec3, DMat3, DVec3};
use std::collections::BTreeMap;

/// A hybrid body, and the particles of it that are awake.
pub(super) struct Awakened<'a> {
    pub(super) environment: &'a Environment,
    pub(super) body: &'a HybridBody,
    pub(super) patch: Patch,
    /// Axes along which each unknown may move.
    pub(super) free: Vec<BVec3>,
    /// Rest positions (m) of nodes and particles.
    pub(super) rest_m: Vec<DVec3>,
    /// `m g` (N) of nodes and particles.
    pub(super) weight_n: Vec<DVec3>,
    /// Diagonal blocks (N/m) of the elastic stiffness at rest, of nodes and particles.
    pub(super) diagonal_n_per_m: Vec<DMat3>,
    /// Index in `carriers` of the first entry of each vertex of the skin, and the end of the last.
    first: Vec<u32>,
    carriers: Vec<(u32, f64)>,
}

impl<'a> Awakened<'a> {
    /// Makes the body with these particles, ascending, awake.
    pub(super) fn new(environment: &'a Environment, body: &'a HybridBody, ids: &[u32]) -> Self {
        let partition = body.partition();
        let patch = Patch::new(partition, &ids.iter().copied().collect());
        let nodes = body.node_count();
        let springs = (0..environment.tools.len()).map(|tool| BVec3::splat(environment.contact.spring(tool).is_some()));
        let particles = ids.iter().map(|_| BVec3::TRUE);
        let free = body.free().iter().copied().chain(particles).chain(springs).collect();
        let rest_m = partition.coarse().positions_m().iter().copied();
        let rest_m = rest_m.chain(ids.iter().map(|&id| partition.particle_m(id))).collect();
        let mut weight_n: Vec<DVec3> =
            body.masses().node_weight_kg.iter().map(|mass| environment.gravity_m_per_s2 * *mass).collect();
        for &id in ids {
            let own_n = environment.gravity_m_per_s2 * ((1.0 - KEPT) * body.masses().particle_kg[id as usize]);
            partition.anchor(id).push(-own_n, &mut weight_n[..nodes]);
            weight_n.push(own_n);
        }
        let diagonal_n_per_m = patch.diagonal_n_per_m(&body.materials(), nodes);
        let mut awakened = Self {
            environment,
            body,
            patch,
            free,
            rest_m,
            weight_n,
            diagonal_n_per_m,
            first: vec![0],
            carriers: Vec::new(),
        };
        for vertex in 0..body.skin_rest_m().len() as u32 {
            let carriers = awakened.carriers_of(body.carriers_of_vertex(vertex));
            awakened.carriers.extend(carriers);
            awakened.first.push(awakened.carriers.len() as u32);
        }
        awakened
    }

    fn carriers_of(&self, particles: &[(u32, f64)]) -> BTreeMap<u32, f64> {
        let mut carriers = BTreeMap::new();
        let mut add = |entry: u32, weight: f64| {
            if weight != 0.0 {
                *carriers.entry(entry).or_default() += weight;
            }
        };
        for &(particle, weight) in particles {
            if let Ok(number) = self.patch.active().binary_search(&particle) {
                add((self.nodes() + number) as u32, weight);
                continue;
            }
            let anchor = self.body.partition().anchor(particle);
            anchor.nodes.iter().zip(anchor.weights).for_each(|(&node, part)| add(node, weight * part));
        }
        carriers
    }

    /// Returns the number of coarse nodes.
    pub(super) fn nodes(&self) -> usize {
        self.body.node_count()
    }

    /// Returns the number of unknowns before those of the tools.
    pub(super) fn entries(&self) -> usize {
        self.rest_m.len()
    }

    /// Returns the number of vertices of the skin.
    pub(super) fn vertices(&self) -> usize {
        self.first.len() - 1
    }

    /// Returns the unknowns that an entry of a configuration moves with, and their weights; a tool moves with itself.
    pub(super) fn carriers(&self, entry: u32) -> Vec<(u32, f64)> {
        match (entry as usize).checked_sub(self.vertices()) {
            Some(tool) => vec![((self.entries() + tool) as u32, 1.0)],
            None => self.of_vertex(entry as usize).to_vec(),
        }
    }

    fn of_vertex(&self, vertex: usize) -> &[(u32, f64)] {
        &self.carriers[self.first[vertex] as usize..self.first[vertex + 1] as usize]
    }

    /// Returns the configuration of some unknowns.
    pub(super) fn configuration(&self, unknowns: &[DVec3]) -> Vec<DVec3> {
        let moved: Vec<DVec3> = unknowns.iter().zip(&self.rest_m).map(|(x, rest)| *x - *rest).collect();
        let mut configuration = self.directions(&moved);
        for (y, rest) in configuration.iter_mut().zip(self.body.skin_rest_m()) {
            *y += *rest;
        }
        configuration.extend_from_slice(&unknowns[self.entries()..]);
        configuration
    }

    /// Returns how the skin's vertices move when nodes and particles do.
    pub(super) fn directions(&self, entries: &[DVec3]) -> Vec<DVec3> {
        let of = |vertex: usize| self.of_vertex(vertex).iter().map(|&(e, w)| entries[e as usize] * w).sum();
        (0..self.vertices()).map(of).collect()
    }

    /// Adds forces (N) on a configuration to those on the unknowns.
    pub(super) fn push(&self, of_configuration_n: &[DVec3], forces_n: &mut [DVec3]) {
        let (of_skin, of_tools) = of_configuration_n.split_at(self.vertices());
        for (vertex, force_n) in of_skin.iter().enumerate().filter(|(_, force_n)| **force_n != DVec3::ZERO) {
            for &(entry, weight) in self.of_vertex(vertex) {
                forces_n[entry as usize] += *force_n * weight;
            }
        }
        for (force_n, of_tool) in forces_n[self.entries()..].iter_mut().zip(of_tools) {
            *force_n += *of_tool;
        }
    }

    /// Returns the elastic forces (N) on nodes and particles, zero on tools.
    pub(super) fn elastic_n(&self, unknowns: &[DVec3]) -> Vec<DVec3> {
        let at = self.field(unknowns);
        let still = self.field(&vec![DVec3::ZERO; unknowns.len()]);
        let forces = self.patch.forces_n(&self.body.materials(), &at, &still).0;
        Self::list(forces, unknowns.len())
    }

    /// Returns the change of the elastic forces (N) along a direction.
    pub(super) fn elastic_change_n(&self, unknowns: &[DVec3], direction: &[DVec3]) -> Vec<DVec3> {
        let changes = self.patch.products_n(&self.body.materials(), &self.field(unknowns), &self.field(direction));
        Self::list(changes, unknowns.len())
    }

    /// Returns the elastic energy (J).
    pub(super) fn elastic_j(&self, unknowns: &[DVec3]) -> f64 {
        self.patch.energy_j(&self.body.materials(), &self.field(unknowns))
    }

    fn list(field: Field, length: usize) -> Vec<DVec3> {
        let mut list = field.nodes;
        list.extend(field.particles);
        list.resize(length, DVec3::ZERO);
        list
    }

    pub(super) fn field(&self, unknowns: &[DVec3]) -> Field {
        Field { nodes: unknowns[..self.nodes()].to_vec(), particles: unknowns[self.nodes()..self.entries()].to_vec() }
    }

    /// Returns the unknowns of everything at rest.
    pub(super) fn at_rest(&self) -> Vec<DVec3> {
        let tools = self.environment.tools.iter().map(|tool| tool.start_position_m);
        self.rest_m.iter().copied().chain(tools).collect()
    }

    /// Returns the unknowns for this body's awake particles, from those of a body with others: particles that wake are
    /// where they followed to.
    pub(super) fn taking_over(&self, other: &Self, unknowns: &[DVec3]) -> Vec<DVec3> {
        let (nodes, particles) = (&unknowns[..self.nodes()], &unknowns[self.nodes()..other.entries()]);
        let of = |id: &u32| match other.patch.active().binary_search(id) {
            Ok(number) => particles[number],
            Err(_) => self.body.partition().anchor(*id).of(nodes),
        };
        let awake = self.patch.active().iter().map(of);
        nodes.iter().copied().chain(awake).chain(unknowns[other.entries()..].iter().copied()).collect()
    }
}
