//! Kinetic energy is counted once, as volume is: the mass that an active particle moves itself is taken from the coarse
//! nodes that moved it.
//!
//! The masses `m_p` of sleeping particles are lumped on the coarse nodes, `M_i = Σ_p m_p ζ_pi` ([`super::masses`]). With active
//! ones of velocity `w_p`, beside coarse velocities `v`,
//! ```text
//! K = ½ Σ_i M_i |v_i|² + ½ (1 − ε) Σ_{p∈A} m_p (|w_p|² − |Σ_i ζ_pi v_i|²)
//! ```
//! A particle that wakes with the velocity it had, `w_p = Σ_i ζ_pi v_i`, therefore changes neither kinetic energy nor
//! momentum, linear or angular. If lumped mass were transferred (`M_i − Σ m_p ζ_pi`), a turning body would lose angular
//! momentum, for lumps are farther out than what they stand for. The coarse mass matrix is
//! ```text
//! M' = diag(M_i) − (1 − ε) Σ_{p∈A} m_p ζ_p ζ_pᵀ
//!    ≥ ε diag(Σ_{p∈A} m_p ζ_pi) + diag(Σ_{p∉A} m_p ζ_pi)      (ζ ≥ 0, Σ ζ = 1: Jensen)
//! ```
//! Lumped masses of particles outside the coarse tets, which never wake, are such that nowhere is the matrix less than above,
//! nor a frequency higher than with all particles awake.
//!
//! It is positive definite, and diagonal but for a small dense block of the nodes that active particles follow, which
//! is factorised when the set changes.
//!
//! Ticks use the same matrix as `running/mass_matrix.rs` has it; this one is its oracle, and what energies are counted by,
//! for which it need not be factorised.
use super::{masses::Masses, partition::Partition, patch::KEPT};
use glam::{BVec3, DVec3};
use std::collections::BTreeSet;

/// The mass matrix `M'` for a set of active particles.
#[derive(Debug, Clone)]
pub struct MassMatrix {
    /// `(1 − ε) m_p` (kg) of active particles.
    particle_kg: Vec<f64>,
    /// `M_i` (kg).
    node_kg: Vec<f64>,
    /// Nodes that active particles follow, ascending: the rows of `block`.
    touched: Vec<u32>,
    /// The dense block of `M'` (kg), row by row.
    block: Vec<f64>,
}

/// A mass matrix and the factors with which it is solved.
#[derive(Debug, Clone)]
pub struct FactorisedMassMatrix {
    matrix: MassMatrix,
    /// The lower Cholesky factor of its dense block, axis by axis, over nodes that are free along it; the identity
    /// elsewhere.
    factors: [Vec<f64>; 3],
    /// Along which axes each touched node may move.
    free: Vec<BVec3>,
}

/// `M'` of a set of particles is not positive definite.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NotPositive {
    /// The coarse node at which it was found.
    pub node: u32,
}

impl MassMatrix {
    /// Returns `M'` for a set of active particles.
    pub fn new(partition: &Partition, masses: &Masses, active: &BTreeSet<u32>) -> Self {
        let anchors: Vec<_> = active.iter().map(|&particle| partition.anchor(particle)).collect();
        let touched: BTreeSet<u32> = anchors.iter().flat_map(|anchor| anchor.nodes).collect();
        let touched: Vec<u32> = touched.into_iter().collect();
        let size = touched.len();
        let row = |node: u32| touched.partition_point(|&n| n < node);
        let mut block = vec![0.0; size * size];
        for (at, &node) in touched.iter().enumerate() {
            block[at * size + at] = masses.node_kg[node as usize];
        }
        let particle_kg: Vec<f64> =
            active.iter().map(|&particle| (1.0 - KEPT) * masses.particle_kg[particle as usize]).collect();
        for (anchor, mass) in anchors.iter().zip(&particle_kg) {
            let rows = anchor.nodes.map(row);
            for i in 0..4 {
                for j in 0..4 {
                    block[rows[i] * size + rows[j]] -= mass * anchor.weights[i] * anchor.weights[j];
                }
            }
        }
        Self { particle_kg, node_kg: masses.node_kg.clone(), touched, block }
    }

    /// Factorises it; `free` tells along which axes each coarse node may move.
    ///
    /// # Errors
    /// Fails where `M'` is not positive definite, as it may be for masses that [`Masses::new`] did not make.
    pub fn factorise(self, free: &[BVec3]) -> Result<FactorisedMassMatrix, NotPositive> {
        let free: Vec<BVec3> = self.touched.iter().map(|&node| free[node as usize]).collect();
        let mut factors = [const { Vec::new() }; 3];
        for (axis, factor) in factors.iter_mut().enumerate() {
            let is_free: Vec<bool> = free.iter().map(|f| f.test(axis)).collect();
            *factor = cholesky(&self.block, &is_free).map_err(|at| NotPositive { node: self.touched[at] })?;
        }
        Ok(FactorisedMassMatrix { matrix: self, factors, free })
    }

    /// Returns the momenta `M' v` (kg m/s) of the coarse nodes.
    pub fn momenta(&self, v: &[DVec3]) -> Vec<DVec3> {
        let mut momenta: Vec<DVec3> = self.node_kg.iter().zip(v).map(|(m, v)| *v * *m).collect();
        let size = self.touched.len();
        for (at, &node) in self.touched.iter().enumerate() {
            let row = self.block[at * size..(at + 1) * size].iter().zip(&self.touched);
            momenta[node as usize] = row.map(|(m, &other)| v[other as usize] * *m).sum();
        }
        momenta
    }

    /// Returns `(1 − ε) m_p` (kg) of the active particles.
    pub fn particle_kg(&self) -> &[f64] {
        &self.particle_kg
    }

    /// Returns the kinetic energy (J) of coarse velocities and those of the active particles.
    pub fn kinetic_j(&self, v: &[DVec3], w: &[DVec3]) -> f64 {
        let coarse: f64 = self.momenta(v).iter().zip(v).map(|(p, v)| 0.5 * p.dot(*v)).sum();
        coarse + self.particle_kg.iter().zip(w).map(|(m, w)| 0.5 * m * w.length_squared()).sum::<f64>()
    }
}

impl FactorisedMassMatrix {
    /// Returns the matrix itself.
    pub fn matrix(&self) -> &MassMatrix {
        &self.matrix
    }

    /// Overwrites the forces (N) on the coarse nodes with `M'⁻¹ f` (m/s²) on free axes, zero on the others. `free` is
    /// that of [`MassMatrix::factorise`].
    pub fn accelerate(&self, free: &[BVec3], forces_n: &mut [DVec3]) {
        let MassMatrix { touched, node_kg, .. } = &self.matrix;
        let mut block: Vec<DVec3> = touched.iter().map(|&node| forces_n[node as usize]).collect();
        for ((force, mass), free) in forces_n.iter_mut().zip(node_kg).zip(free) {
            *force = DVec3::select(*free, *force / *mass, DVec3::ZERO);
        }
        for axis in 0..3 {
            solve(&self.factors[axis], &mut block, axis, &self.free);
        }
        for (&node, acceleration) in touched.iter().zip(block) {
            forces_n[node as usize] = acceleration;
        }
    }
}

/// Returns the lower Cholesky factor of the rows and columns that are free, the identity elsewhere.
///
/// # Errors
/// Returns the number of the first pivot that is not positive.
fn cholesky(a: &[f64], free: &[bool]) -> Result<Vec<f64>, usize> {
    let size = free.len();
    let mut l = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..=i {
            let taken: f64 = (0..j).map(|k| l[i * size + k] * l[j * size + k]).sum();
            let entry = if free[i] && free[j] { a[i * size + j] } else { f64::from(u8::from(i == j)) };
            let rest = entry - taken;
            if i != j {
                l[i * size + j] = rest / l[j * size + j];
            } else if rest > 1e-12 * entry {
                l[i * size + i] = rest.sqrt();
            } else {
                return Err(i);
            }
        }
    }
    Ok(l)
}

/// Solves `L Lᵀ a = f` along one axis, in place; the result is zero where a node is not free.
fn solve(l: &[f64], f: &mut [DVec3], axis: usize, free: &[BVec3]) {
    let size = f.len();
    for i in 0..size {
        let taken: f64 = (0..i).map(|k| l[i * size + k] * f[k][axis]).sum();
        let right = if free[i].test(axis) { f[i][axis] } else { 0.0 };
        f[i][axis] = (right - taken) / l[i * size + i];
    }
    for i in (0..size).rev() {
        let taken: f64 = (i + 1..size).map(|k| l[k * size + i] * f[k][axis]).sum();
        f[i][axis] = (f[i][axis] - taken) / l[i * size + i];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::{
        patch::{Field, Materials, Patch},
        testing::{Random, balls_sticking_out, embedded_balls, tissue},
    };
    use crate::material::{Material, Viscosity};

    struct TestBody {
        partition: Partition,
        masses: Masses,
        free: Vec<BVec3>,
        of_tet: Vec<u16>,
    }

    /// Returns a body with cells of one size, and one with cells of two.
    fn bodies() -> [TestBody; 2] {
        embedded_balls().map(|partition| {
            let masses = Masses::new(&partition, |_| 1000.0);
            let free = masses.node_kg.iter().map(|&m| BVec3::splat(m > 0.0)).collect();
            TestBody { of_tet: vec![0; partition.residual_elements().len()], masses, free, partition }
        })
    }

    /// A set of particles awake, in motion.
    struct Flight {
        patch: Patch,
        mass_matrix: FactorisedMassMatrix,
        x: Field,
        v: Field,
    }

    impl Flight {
        fn new(body: &TestBody, active: &BTreeSet<u32>, x: Vec<DVec3>, v: Vec<DVec3>) -> Self {
            let patch = Patch::new(&body.partition, active);
            let mass_matrix = MassMatrix::new(&body.partition, &body.masses, active).factorise(&body.free).unwrap();
            let follow = |nodes: Vec<DVec3>| Field { particles: patch.following(&body.partition, &nodes), nodes };
            Self { x: follow(x), v: follow(v), patch, mass_matrix }
        }

        fn momentum(&self) -> (DVec3, DVec3) {
            let mut momenta = self.mass_matrix.matrix().momenta(&self.v.nodes);
            momenta.extend(self.mass_matrix.matrix().particle_kg().iter().zip(&self.v.particles).map(|(m, w)| *w * *m));
            let positions = self.x.nodes.iter().chain(&self.x.particles);
            (momenta.iter().sum(), positions.zip(&momenta).map(|(x, p)| x.cross(*p)).sum())
        }

        fn kinetic_j(&self) -> f64 {
            self.mass_matrix.matrix().kinetic_j(&self.v.nodes, &self.v.particles)
        }

        /// Steps by leapfrog; returns the sum of elastic and kinetic energy (J).
        fn fly(&mut self, body: &TestBody, materials: &Materials<'_>, dt_s: f64, steps: usize) -> f64 {
            for _ in 0..steps {
                self.kick(body, materials, 0.5 * dt_s);
                for (x, v) in self.x.nodes.iter_mut().zip(&self.v.nodes) {
                    *x += *v * dt_s;
                }
                for (x, v) in self.x.particles.iter_mut().zip(&self.v.particles) {
                    *x += *v * dt_s;
                }
                self.kick(body, materials, 0.5 * dt_s);
            }
            self.kinetic_j() + self.patch.energy_j(materials, &self.x)
        }

        fn kick(&mut self, body: &TestBody, materials: &Materials<'_>, h_s: f64) {
            let (mut force, _) = self.patch.forces_n(materials, &self.x, &self.v);
            self.mass_matrix.accelerate(&body.free, &mut force.nodes);
            for (v, a) in self.v.nodes.iter_mut().zip(&force.nodes) {
                *v += *a * h_s;
            }
            for ((w, f), m) in
                self.v.particles.iter_mut().zip(&force.particles).zip(self.mass_matrix.matrix().particle_kg())
            {
                *w += *f * (h_s / m);
            }
        }
    }

    fn some(body: &TestBody, of: impl Fn(DVec3) -> bool) -> BTreeSet<u32> {
        (0..body.partition.particle_count() as u32).filter(|&p| of(body.partition.particle_m(p))).collect()
    }

    /// Hearts pressed beside the held base flew apart: particles outside the coarse tets, which never wake, took mass
    /// from nodes there by negative weights, and those that woke took more than was left.
    #[test]
    fn where_particles_are_outside_the_coarse_tets_those_that_wake_leave_mass() {
        for (partition, inside) in balls_sticking_out() {
            let masses = Masses::new(&partition, |_| 1000.0);
            assert!((masses.node_weight_kg.iter().sum::<f64>() / (1000.0 * partition.volume_m3()) - 1.0).abs() < 1e-12);
            let free: Vec<BVec3> = masses.node_kg.iter().map(|&mass| BVec3::splat(mass > 0.0)).collect();
            let mass_matrix = MassMatrix::new(&partition, &masses, &inside).factorise(&free).unwrap();
            let forces = vec![DVec3::X; free.len()];
            let mut accelerations = forces.clone();
            mass_matrix.accelerate(&free, &mut accelerations);
            let power: f64 = accelerations.iter().zip(&forces).map(|(a, f)| a.dot(*f)).sum();
            // fᵀ M'⁻¹ f is that of a mass of at least ε M.
            let least: f64 = masses.node_kg.iter().filter(|mass| **mass > 0.0).map(|mass| 1.0 / (KEPT * mass)).sum();
            assert!(power > 0.0 && power <= least, "{power} {least}");
        }
    }

    #[test]
    fn waking_changes_neither_kinetic_energy_nor_momentum() {
        for body in bodies() {
            let mut random = Random(11);
            let rest = body.partition.coarse().positions_m();
            let x: Vec<DVec3> = rest.iter().map(|p| *p + random.vector() * 1e-3).collect();
            let v: Vec<DVec3> =
                rest.iter().map(|p| DVec3::new(0.0, 3.0, 40.0).cross(*p) + random.vector() * 0.3).collect();
            let asleep = Flight::new(&body, &BTreeSet::new(), x.clone(), v.clone());
            let ((linear, angular), kinetic) = (asleep.momentum(), asleep.kinetic_j());
            for active in [some(&body, |p| p.x > 2e-3), some(&body, |p| p.length() < 5e-3), some(&body, |_| true)] {
                let awake = Flight::new(&body, &active, x.clone(), v.clone());
                let (p, l) = awake.momentum();
                assert!((p - linear).length() < 1e-13 * linear.length(), "{p} {linear}");
                assert!((l - angular).length() < 1e-13 * angular.length(), "{l} {angular}");
                assert!((awake.kinetic_j() / kinetic - 1.0).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn momenta_undo_accelerations() {
        for body in bodies() {
            let mass_matrix = MassMatrix::new(&body.partition, &body.masses, &some(&body, |p| p.y > 0.0));
            let mass_matrix = mass_matrix.factorise(&body.free).unwrap();
            let mut random = Random(12);
            let forces: Vec<DVec3> =
                body.free.iter().map(|free| DVec3::select(*free, random.vector(), DVec3::ZERO)).collect();
            let mut accelerations = forces.clone();
            mass_matrix.accelerate(&body.free, &mut accelerations);
            for (p, f) in mass_matrix.matrix().momenta(&accelerations).iter().zip(&forces) {
                assert!((*p - *f).length() < 1e-10, "{p} {f}");
            }
        }
    }

    #[test]
    fn free_flight_keeps_momentum_and_energy() {
        for body in bodies() {
            let material = [tissue()[1]].map(|m| Material { viscosity: Viscosity::new(0.0, 0.0).unwrap(), ..m });
            let materials = Materials { materials: &material, of_tet: &body.of_tet };
            let mut random = Random(13);
            let rest = body.partition.coarse().positions_m();
            let v: Vec<DVec3> = rest
                .iter()
                .map(|p| DVec3::new(0.5, 0.0, 0.0) + DVec3::Z.cross(*p) * 30.0 + random.vector() * 0.05)
                .collect();
            let mut flight = Flight::new(&body, &some(&body, |p| p.x > 2e-3), rest.to_vec(), v);
            let (linear, angular) = flight.momentum();
            let start = flight.fly(&body, &materials, 5e-5, 1);
            let mut worst = 0.0_f64;
            for _ in 0..10 {
                let energy = flight.fly(&body, &materials, 5e-5, 20);
                worst = worst.max((energy / start - 1.0).abs());
            }
            let (p, l) = flight.momentum();
            assert!((p - linear).length() < 1e-12 * linear.length(), "{p} {linear}");
            assert!((l - angular).length() < 1e-12 * angular.length(), "{l} {angular}");
            assert!(worst < 1e-3, "{worst:e}");
        }
    }
}
