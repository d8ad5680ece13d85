//! Projects the motion of particles that fall asleep on the coarse nodes: these are moved to the field that is nearest
//! to it in the mass norm.
//!
//! A node around which all is awake is held by little: by the `ε` that the coarse level keeps of its surroundings,
//! which may have it far from the particles. If these followed it there when they fall asleep, the dent that they have
//! would be lost, and a region that is switched again and again would build up stress. So coarse nodes are moved by
//! `Δ`, which, with particles `p` falling asleep at `y_p`, of mass `m = (1 − ε) m_p`, and the consistent mass matrix
//! `C'` of what slept before, is the solution of
//! ```text
//! min ½ Σ_p m |y_p − ζ_pᵀ(x + Δ)|² + ½ Δᵀ C' Δ        C'' Δ = Σ_p m ζ_p (y_p − ζ_pᵀ x)
//! C'' = M'' − (1 − δ) L        L = Σ_{all p} m_p (diag ζ_p − ζ_p ζ_pᵀ)
//! ```
//! over the free nodes that they follow. `M''` is the mass matrix after the switch (`mass_matrix`), `L` the part of it that
//! lumping adds; `δ` of that holds nodes that nothing else does. A particle outside the coarse tets, which sleeps, has
//! `|ζ_pi|` for its weights in these: what holds nodes there is no less than its mass. The system is solved by a few steps
//! of conjugate gradients, preconditioned by `M''⁻¹`. It changes neither strains (`prestrain`) nor momenta (`switching`).
use super::{
    body::HybridBody,
    composite::{Anchor, NODES},
    masses::Masses,
    partition::Partition,
    running::RunningMassMatrix,
};
use glam::DVec3;

/// `δ`, the fraction of the lumping that holds nodes.
const HOLD: f64 = 0.05;
/// Steps of conjugate gradients; each halves the residual at least.
const STEPS: usize = 8;
/// Residual that counts as zero: squared, in the preconditioner's norm, over the largest one.
const NOTHING: f64 = 1e-16;

/// `L`, the part of the mass matrix that lumping adds.
#[derive(Debug, Clone, Default)]
pub(super) struct Lumping {
    /// Pairs of nodes, and `Σ_p m_p ζ_pi ζ_pj` (kg).
    pairs: Vec<([u32; 2], f64)>,
}

impl Lumping {
    pub(super) fn new(partition: &Partition, masses: &Masses) -> Self {
        let tets = partition.coarse().tets();
        let mut of_tets = vec![[[0.0; NODES]; NODES]; tets.len()];
        for (particle, mass) in masses.particle_kg.iter().enumerate() {
            let anchor = partition.anchor(particle as u32);
            let (Anchor { nodes, tet, .. }, weights) = (anchor, anchor.bearing_weights());
            let numbers = nodes.map(|node| tets[tet as usize].iter().position(|own| *own == node).unwrap_or(0));
            for (i, j) in (0..4).flat_map(|i| (0..i).map(move |j| (i, j))) {
                let (low, high) = (numbers[i].min(numbers[j]), numbers[i].max(numbers[j]));
                of_tets[tet as usize][low][high] += mass * (weights[i] * weights[j]).max(0.0);
            }
        }
        let mut pairs = Vec::new();
        for (nodes, kg) in tets.iter().zip(&of_tets) {
            for (i, j) in (0..NODES).flat_map(|j| (0..j).map(move |i| (i, j))).filter(|&(i, j)| kg[i][j] > 0.0) {
                pairs.push(([nodes[i].min(nodes[j]), nodes[i].max(nodes[j])], kg[i][j]));
            }
        }
        pairs.sort_by_key(|(nodes, _)| *nodes);
        pairs.dedup_by(|next, first| {
            let is_same = next.0 == first.0;
            if is_same {
                first.1 += next.1;
            }
            is_same
        });
        Self { pairs }
    }

    /// Returns the pairs that have one of these nodes.
    fn pairs_of<'a>(&'a self, nodes: &'a [bool]) -> impl Iterator<Item = ([u32; 2], f64)> + 'a {
        self.pairs.iter().copied().filter(|([i, j], _)| nodes[*i as usize] || nodes[*j as usize])
    }
}

/// Buffers for a projection.
#[derive(Debug, Clone, Default)]
pub(super) struct Projection {
    /// `Σ_p m ζ_p (y_p − ζ_pᵀ x)` (kg m), and then the residual.
    moments: Vec<DVec3>,
    /// Whether each coarse node is moved.
    is_moved: Vec<bool>,
    /// Pairs of `L` that have a node that is moved.
    pairs: Vec<([u32; 2], f64)>,
    /// `Δ` (m).
    shifts_m: Vec<DVec3>,
    preconditioned: Vec<DVec3>,
    direction: Vec<DVec3>,
    product: Vec<DVec3>,
}

impl Projection {
    /// Makes room for the coarse nodes, and for so many active particles.
    pub(super) fn with_room(body: &HybridBody, most_active: usize) -> Self {
        let nodes = body.node_count();
        let list = || Vec::with_capacity(nodes + most_active);
        Self {
            moments: list(),
            is_moved: Vec::with_capacity(nodes),
            pairs: Vec::with_capacity(body.lumping.pairs.len()),
            shifts_m: list(),
            preconditioned: list(),
            direction: list(),
            product: list(),
        }
    }

    /// Starts over, before a switch.
    pub(super) fn start(&mut self, nodes: usize) {
        self.moments.clear();
        self.moments.resize(nodes, DVec3::ZERO);
        self.is_moved.clear();
        self.is_moved.resize(nodes, false);
    }

    /// Adds a particle of mass `(1 − ε) m_p` (kg) that falls asleep at a distance `away_m` (m) from where it would be
    /// asleep.
    pub(super) fn transfer(&mut self, body: &HybridBody, anchor: &Anchor, mass_kg: f64, away_m: DVec3) {
        anchor.push(away_m * mass_kg, &mut self.moments);
        for (node, weight) in anchor.nodes.into_iter().zip(anchor.weights) {
            self.is_moved[node as usize] |= weight > 0.0 && body.free[node as usize].all();
        }
    }

    /// Returns whether each coarse node will be moved: those are the free ones that a particle follows which falls
    /// asleep.
    pub(super) fn is_moved(&self) -> &[bool] {
        &self.is_moved
    }

    /// Returns the displacements `Δ` (m) of the coarse nodes, with the mass matrix after the switch. Allocates nothing.
    pub(super) fn solve(&mut self, body: &HybridBody, mass_matrix: &mut RunningMassMatrix) -> &[DVec3] {
        let nodes = self.moments.len();
        let all = nodes + mass_matrix.particle_kg().len();
        for list in [&mut self.shifts_m, &mut self.direction] {
            list.clear();
            list.resize(all, DVec3::ZERO);
        }
        self.pairs.clear();
        self.pairs.extend(body.lumping.pairs_of(&self.is_moved));
        let (mut before, mut most) = (f64::INFINITY, 0.0);
        for _ in 0..STEPS {
            // z = M''⁻¹ r, on the nodes that are moved
            self.preconditioned.clear();
            let masked = self.moments.iter().zip(&self.is_moved);
            self.preconditioned.extend(masked.map(|(left, is_moved)| if *is_moved { *left } else { DVec3::ZERO }));
            self.preconditioned.resize(all, DVec3::ZERO);
            mass_matrix.accelerate(&mut self.preconditioned);
            for (z, is_moved) in self.preconditioned.iter_mut().zip(&self.is_moved) {
                *z = if *is_moved { *z } else { DVec3::ZERO };
            }
            let now = dot(&self.moments, &self.preconditioned);
            most = now.max(most);
            if now <= NOTHING * most || !now.is_finite() {
                break;
            }
            for (direction, z) in self.direction.iter_mut().zip(&self.preconditioned) {
                *direction = *z + *direction * (now / before);
            }
            // C'' d = M'' d − (1 − δ) L d
            self.product.clear();
            self.product.resize(all, DVec3::ZERO);
            mass_matrix.momenta(body, &self.direction, &mut self.product);
            for &([i, j], kg) in &self.pairs {
                let (i, j) = (i as usize, j as usize);
                let flow = (self.direction[i] - self.direction[j]) * ((HOLD - 1.0) * kg);
                self.product[i] += flow;
                self.product[j] -= flow;
            }
            let step = now / dot(&self.direction[..nodes], &self.product);
            for (shift, direction) in self.shifts_m.iter_mut().zip(&self.direction) {
                *shift += *direction * step;
            }
            for (left, product) in self.moments.iter_mut().zip(&self.product) {
                *left -= *product * step;
            }
            before = now;
        }
        &self.shifts_m[..nodes]
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::patch::KEPT;
    use crate::{
        bodies::hybrid::{
            prestrain::PrestrainDecay,
            running::RunningPatch,
            testing::{Random, hybrid_ball, tissue},
        },
        settings::Precision,
    };

    /// Lets half of the awake particles fall asleep where displacements put them. Returns the residual with the exact
    /// `C''` of all particles over the right side, and the misfit of the particles after and before.
    fn fall_asleep(away: impl Fn(DVec3, &mut Random) -> DVec3) -> (f64, f64, f64) {
        let [material, other, _] = tissue();
        let body = hybrid_ball(&[material, other]);
        let partition = &body.partition;
        let waking: Vec<u32> = (0..partition.particle_count() as u32).filter(|&p| body.may_wake(p)).collect();
        let (fell, stay): (Vec<u32>, Vec<u32>) = waking.iter().partition(|&&p| partition.particle_m(p).x > -1e-3);
        let mut patch = RunningPatch::new(&body, waking.len(), Precision::Double);
        patch.wake(&body, &stay, &PrestrainDecay::default());
        let kg = |p: u32| (1.0 - KEPT) * body.masses.particle_kg[p as usize];
        let mut random = Random(21);
        let away: Vec<DVec3> = fell.iter().map(|&p| away(partition.particle_m(p), &mut random)).collect();
        let mut projection = Projection::with_room(&body, waking.len());
        projection.start(body.node_count());
        for (&p, away) in fell.iter().zip(&away) {
            projection.transfer(&body, &partition.anchor(p), kg(p), *away);
        }
        let (start, moved) = (projection.moments.clone(), projection.is_moved.clone());
        let shifts = projection.solve(&body, patch.mass_matrix_mut()).to_vec();
        assert!(shifts.iter().zip(&moved).all(|(shift, moved)| *moved || *shift == DVec3::ZERO));
        // Every particle's own term, beside what lumping holds.
        let mut left = start.clone();
        for p in 0..partition.particle_count() as u32 {
            let anchor = partition.anchor(p);
            let mass = body.masses.particle_kg[p as usize] - if stay.contains(&p) { kg(p) } else { 0.0 };
            anchor.push(anchor.of(&shifts) * -mass, &mut left);
            let lump = body.masses.particle_kg[p as usize] * HOLD;
            for (node, weight) in anchor.nodes.into_iter().zip(anchor.weights) {
                left[node as usize] -= (shifts[node as usize] - anchor.of(&shifts)) * (lump * weight);
            }
        }
        let size = |list: &[DVec3]| -> f64 {
            let moved = list.iter().zip(&moved).filter(|(_, moved)| **moved);
            moved.map(|(a, _)| a.length_squared()).sum::<f64>().sqrt()
        };
        let misfit = |shifts: &[DVec3]| {
            let of = |(p, away): (&u32, &DVec3)| (*away - partition.anchor(*p).of(shifts)).length_squared();
            fell.iter().zip(&away).map(of).sum::<f64>().sqrt()
        };
        let none = vec![DVec3::ZERO; shifts.len()];
        (size(&left) / size(&start), misfit(&shifts), misfit(&none))
    }

    #[test]
    fn nodes_go_to_the_field_nearest_by_mass() {
        let (left, after, before) = fall_asleep(|_, random| random.vector() * 1e-3);
        assert!(left < 2e-2, "{left:e}");
        assert!(after < before, "{after:e} {before:e}");
    }

    #[test]
    fn what_the_coarse_level_can_follow_it_does() {
        let (left, after, before) = fall_asleep(|p, _| (p.cross(DVec3::new(1.0, 2.0, -1.0)) + p) * 0.1);
        assert!(left < 2e-2, "{left:e}");
        assert!(after < 0.2 * before, "{after:e} {before:e}");
    }
}
