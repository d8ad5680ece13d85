//! The coarse mass matrix `M'` as the loop runs it: factorised anew, without allocating, when other particles wake. Its
//! oracle is [`crate::bodies::hybrid::mass_matrix`].
use crate::{
    bodies::hybrid::{
        body::HybridBody,
        composite::{Anchor, NO_WEIGHT},
        partition::NONE,
        patch::KEPT,
    },
    lanes::{
        dense::{Cholesky, Symmetric},
        vector_operations,
    },
    linalg::dissection,
};
use glam::{BVec3, DVec3};

/// The mass matrix `M'` and its Cholesky factor.
///
/// Active particles follow nodes that are free or held along all axes, so that one factor serves the three. With
/// accelerations `a` of free nodes `f` and none of held ones `h`, `M'_ff a = f_f`; whatever holds the latter has to
/// bear `M'_hf a`.
#[derive(Debug, Clone)]
pub(crate) struct RunningMassMatrix {
    /// `(1 − ε) m_p` (kg) of active particles.
    particle_kg: Vec<f64>,
    /// Masses (kg) by which gravity pulls on coarse nodes: `Σ_p m_p ζ_pi`, less what active particles have of it.
    weight_kg: Vec<f64>,
    /// `1/M_i` (1/kg) of coarse nodes, 0 on held axes and for nodes in the factor, and then `1/(1 − ε) m_p` of active
    /// particles.
    inverse_per_kg: Vec<DVec3>,
    /// The masses that active particles take from the nodes they follow.
    followed: Vec<Followed>,
    /// Nodes that active particles follow, which are the rows of the block: first the free ones, then the held ones, each by
    /// `places`.
    touched: Vec<u32>,
    /// Number of those that are free; they are the rows of the factor.
    free_rows: usize,
    row_of: Vec<u32>,
    /// The order of all coarse nodes in which the factor has few entries.
    places: Vec<u32>,
    /// The dense block of `M'` (kg), row by row.
    block_kg: Vec<f64>,
    factor: Cholesky,
}

/// An active particle and the coarse nodes that it follows; weights are zero where there are fewer than four.
#[derive(Debug, Clone, Copy)]
struct Followed {
    /// `(1 − ε) m_p` (kg).
    mass_kg: f64,
    nodes: [u32; 4],
    weights: [f64; 4],
}

/// Returns the nodes that a particle follows with a weight that counts.
fn weighty(anchor: &Anchor) -> impl Iterator<Item = (u32, f64)> {
    anchor.nodes.into_iter().zip(anchor.weights).filter(|(_, weight)| *weight >= NO_WEIGHT)
}

/// Returns `1/M_i` (1/kg) of a coarse node, 0 on held axes.
fn inverse_per_kg(hybrid: &HybridBody, node: usize) -> DVec3 {
    let mass_kg = hybrid.masses.node_kg[node].max(f64::MIN_POSITIVE);
    DVec3::select(hybrid.free[node], DVec3::splat(1.0 / mass_kg), DVec3::ZERO)
}

/// Returns the order of the coarse nodes by nested dissection: neighbours are nodes that a particle follows together.
fn places(hybrid: &HybridBody) -> Vec<u32> {
    let partition = &hybrid.partition;
    let mut neighbours = vec![Vec::new(); hybrid.node_count()];
    for particle in 0..partition.particle_count() as u32 {
        let anchor = partition.anchor(particle);
        for (one, _) in weighty(&anchor) {
            for (other, _) in weighty(&anchor).filter(|(other, _)| *other != one) {
                let of_one: &mut Vec<u32> = &mut neighbours[one as usize];
                if !of_one.contains(&other) {
                    of_one.push(other);
                }
            }
        }
    }
    dissection::places(hybrid.rest_positions_m(), &neighbours)
}

impl RunningMassMatrix {
    pub(in crate::bodies::hybrid) fn new(hybrid: &HybridBody, most_active: usize) -> Self {
        let nodes = hybrid.node_count();
        let most_touched = (4 * most_active).min(nodes);
        let mut inverses_per_kg = Vec::with_capacity(nodes + most_active);
        inverses_per_kg.extend((0..nodes).map(|node| inverse_per_kg(hybrid, node)));
        Self {
            particle_kg: Vec::with_capacity(most_active),
            weight_kg: hybrid.masses.node_weight_kg.clone(),
            inverse_per_kg: inverses_per_kg,
            followed: Vec::with_capacity(most_active),
            touched: Vec::with_capacity(most_touched),
            free_rows: 0,
            row_of: vec![NONE; nodes],
            places: places(hybrid),
            block_kg: Vec::with_capacity(most_touched * most_touched),
            factor: Cholesky::with_room(most_touched),
        }
    }

    /// Factorises the matrix of these active particles, given in order, each with what it follows. Allocates nothing.
    pub(in crate::bodies::hybrid) fn factorise(
        &mut self,
        hybrid: &HybridBody,
        followed: impl Iterator<Item = (u32, Anchor)> + Clone,
    ) {
        for &node in &self.touched {
            self.row_of[node as usize] = NONE;
            self.weight_kg[node as usize] = hybrid.masses.node_weight_kg[node as usize];
            self.inverse_per_kg[node as usize] = inverse_per_kg(hybrid, node as usize);
        }
        self.touched.clear();
        self.particle_kg.clear();
        self.inverse_per_kg.truncate(hybrid.node_count());
        self.followed.clear();
        for (_, anchor) in followed.clone() {
            for (node, _) in weighty(&anchor) {
                if self.row_of[node as usize] == NONE {
                    self.row_of[node as usize] = 0;
                    self.touched.push(node);
                }
            }
        }
        let is_held = |node: u32| !hybrid.free[node as usize].any();
        let places = &self.places;
        self.touched.sort_unstable_by_key(|&node| (is_held(node), places[node as usize]));
        self.free_rows = self.touched.partition_point(|&node| !is_held(node));
        let size = self.touched.len();
        self.block_kg.clear();
        self.block_kg.resize(size * size, 0.0);
        for (row, &node) in self.touched.iter().enumerate() {
            self.row_of[node as usize] = row as u32;
            self.inverse_per_kg[node as usize] = DVec3::ZERO;
            self.block_kg[row * size + row] = hybrid.masses.node_kg[node as usize];
        }
        for (particle, anchor) in followed {
            let mass = (1.0 - KEPT) * hybrid.masses.particle_kg[particle as usize];
            self.particle_kg.push(mass);
            self.inverse_per_kg.push(DVec3::splat(1.0 / mass));
            let weights = anchor.weights.map(|weight| if weight >= NO_WEIGHT { weight } else { 0.0 });
            self.followed.push(Followed { mass_kg: mass, nodes: anchor.nodes, weights });
            for (node, weight) in weighty(&anchor) {
                self.weight_kg[node as usize] -= mass * weight;
                let row = self.row_of[node as usize] as usize;
                for (other, other_weight) in weighty(&anchor) {
                    let column = self.row_of[other as usize] as usize;
                    self.block_kg[row * size + column] -= mass * weight * other_weight;
                }
            }
        }
        // Pivots are positive where no weight is negative (`mass_matrix`), which [`HybridBody::may_wake`] sees to.
        let block_kg = Symmetric { entries: &self.block_kg, stride: size };
        self.factor.factorise(block_kg, self.free_rows, 1e-12);
    }

    /// Overwrites forces (N) on coarse nodes and then on active particles with `M'⁻¹ f` (m/s²) on free axes, zero on
    /// the others; returns `fᵀ M'⁻¹ f` (N²/kg).
    pub(crate) fn accelerate(&mut self, forces_n: &mut [DVec3]) -> f64 {
        let free = &self.touched[..self.free_rows];
        for (row, &node) in free.iter().enumerate() {
            self.factor.put(row, forces_n[node as usize]);
        }
        let size_sq = vector_operations::divide_by_masses(forces_n, &self.inverse_per_kg) + self.factor.solve();
        for (row, &node) in free.iter().enumerate() {
            forces_n[node as usize] = self.factor.get(row);
        }
        size_sq
    }

    /// Adds the weight `m g` (N) of coarse nodes and active particles.
    pub(crate) fn add_weight_n(&self, gravity_m_per_s2: DVec3, forces_n: &mut [DVec3]) {
        for (force, mass) in forces_n.iter_mut().zip(self.weight_kg.iter().chain(&self.particle_kg)) {
            *force += gravity_m_per_s2 * *mass;
        }
    }

    /// Returns `(1 − ε) m_p` (kg) of the active particles.
    pub(in crate::bodies::hybrid) fn particle_kg(&self) -> &[f64] {
        &self.particle_kg
    }

    /// Returns the kinetic and gravitational energy (J) of coarse nodes and active particles, at positions
    /// `x` (m) and velocities `v` (m/s). `momenta` is a buffer.
    pub(in crate::bodies::hybrid) fn moving_j(
        &self,
        hybrid: &HybridBody,
        x: &[DVec3],
        v: &[DVec3],
        gravity_m_per_s2: DVec3,
        momenta: &mut Vec<DVec3>,
    ) -> f64 {
        momenta.clear();
        momenta.resize(v.len(), DVec3::ZERO);
        self.momenta(hybrid, v, momenta);
        let kinetic_j: f64 = momenta.iter().zip(v).map(|(p, v)| 0.5 * p.dot(*v)).sum();
        // Rest positions are left out: they do not change when particles wake or fall asleep.
        let moment: DVec3 = x.iter().zip(self.weight_kg.iter().chain(&self.particle_kg)).map(|(x, m)| *x * *m).sum();
        kinetic_j - gravity_m_per_s2.dot(moment)
    }

    /// Returns `v_h·M'_hf a_f` of velocities `a` (J), or of accelerations: then it is the power (W) that what moves the
    /// held nodes gives to particles that follow them in part.
    pub(crate) fn of_holders(&self, v: &[DVec3], a: &[DVec3]) -> f64 {
        let (free, held) = self.touched.split_at(self.free_rows);
        let rows = self.block_kg.chunks_exact(self.touched.len().max(1)).skip(self.free_rows).zip(held);
        let of_row = |(row, &node): (&[f64], &u32)| {
            let v = v[node as usize];
            if v == DVec3::ZERO {
                return 0.0;
            }
            row.iter().zip(free).map(|(mass, &other)| v.dot(a[other as usize]) * mass).sum::<f64>()
        };
        rows.map(of_row).sum()
    }

    /// Returns the terms of the kinetic energy (J) that have velocities of held nodes, less those of lumped masses.
    pub(crate) fn of_held_j(&self, hybrid: &HybridBody, v: &[DVec3]) -> f64 {
        let held = &self.touched[self.free_rows..];
        let rows = self.block_kg.chunks_exact(self.touched.len().max(1)).skip(self.free_rows).zip(held);
        let of_row = |(row, &node): (&[f64], &u32)| {
            if v[node as usize] == DVec3::ZERO {
                return 0.0;
            }
            let among = |(mass, &other): (&f64, &u32)| v[node as usize].dot(v[other as usize]) * mass;
            let among_held: f64 = row.iter().zip(&self.touched).skip(self.free_rows).map(among).sum();
            0.5 * (among_held - hybrid.masses.node_kg[node as usize] * v[node as usize].length_squared())
        };
        rows.map(of_row).sum::<f64>() + self.of_holders(v, v)
    }

    /// Returns `v_f·M'_ff v_f` and `v_h·M'_hf v_f` (J) of velocities. `momenta` is a buffer.
    pub(crate) fn of_free_j(&self, hybrid: &HybridBody, v: &[DVec3], momenta: &mut Vec<DVec3>) -> (f64, f64) {
        momenta.clear();
        momenta.resize(v.len(), DVec3::ZERO);
        self.momenta(hybrid, v, momenta);
        let free = hybrid.free.iter().chain(std::iter::repeat(&BVec3::TRUE));
        let of_free = free.zip(v).zip(&*momenta).map(|((free, v), p)| DVec3::select(*free, *v, DVec3::ZERO).dot(*p));
        let of_holders_j = self.of_holders(v, v);
        (of_free.sum::<f64>() - of_holders_j, of_holders_j)
    }

    /// Writes the momenta `M' v` (kg m/s) of coarse nodes and then of active particles. It goes particle by particle,
    /// since these are fewer than the block's entries.
    pub(crate) fn momenta(&self, hybrid: &HybridBody, v: &[DVec3], momenta: &mut [DVec3]) {
        let masses = hybrid.masses.node_kg.iter().chain(&self.particle_kg);
        for ((momentum, v), mass) in momenta.iter_mut().zip(v).zip(masses) {
            *momentum = *v * *mass;
        }
        for Followed { mass_kg, nodes, weights } in &self.followed {
            let with: DVec3 = nodes.iter().zip(weights).map(|(node, weight)| v[*node as usize] * *weight).sum();
            for (node, weight) in nodes.iter().zip(weights) {
                momenta[*node as usize] -= with * (mass_kg * weight);
            }
        }
    }
}
