//! A patch: the active particles, the cells between them, and the residual elements of the coarse tets.
//!
//! Every cell that has an active particle answers for the fraction `1 − ε` of its volume itself, and the coarse tets
//! lose that fraction of it, `V_g ← V_g − (1 − ε) V_c` and `T_gi ← T_gi − (1 − ε) V_c Σ_p ζ_pi b_cp`: volume is counted
//! once, and uniform stress stays in balance whichever particles are awake. The `ε` that stays keeps a coarse node
//! whose surroundings are all awake from having neither stiffness nor mass. Particles of such cells that are not active
//! themselves (the constrained points) follow the coarse nodes, and their forces are added to those of the nodes by the
//! same weights.
//!
//! This is plain f64 code: the oracle of what runs in the loop.
use super::{
    cell::RestCell, composite::Anchor, partition::Partition, prestrain::PrestrainDecay,
    residual_element::ResidualElement,
};
use crate::material::Material;
use glam::{DMat3, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// `ε`, the fraction of an awake cell that stays with the coarse tets.
pub const KEPT: f64 = 0.02;

/// A set of active particles, with its cells and residual elements.
#[derive(Debug, Clone)]
pub struct Patch {
    /// Active particles, ascending.
    active: Vec<u32>,
    /// What the constrained points follow; they are numbered after the active particles.
    constrained: Vec<Anchor>,
    cells: Vec<PatchCell>,
    /// Residual elements of the coarse tets.
    residual_elements: Vec<ResidualElement>,
    /// Prestrain of what woke or fell asleep while it was strained.
    prestrain: PrestrainDecay,
}

#[derive(Debug, Clone)]
struct PatchCell {
    number: u32,
    rest: RestCell,
    /// Numbers of its points: active particles first, then constrained points.
    points: [u32; 8],
    tet: u32,
}

/// Materials of a body's coarse tets.
#[derive(Debug, Clone, Copy)]
pub struct Materials<'a> {
    /// All materials.
    pub materials: &'a [Material],
    /// Index of the material of each coarse tet.
    pub of_tet: &'a [u16],
}

impl Materials<'_> {
    /// Returns the material of a coarse tet, and of all cells that are counted to it.
    pub fn of(&self, tet: usize) -> &Material {
        &self.materials[self.of_tet[tet] as usize]
    }
}

/// Positions (m), or anything else with three components, of coarse nodes and of active particles.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// One per coarse node.
    pub nodes: Vec<DVec3>,
    /// One per active particle.
    pub particles: Vec<DVec3>,
}

impl Field {
    /// Returns `Σ a·b`.
    pub fn dot(&self, other: &Self) -> f64 {
        let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        dot(&self.nodes, &other.nodes) + dot(&self.particles, &other.particles)
    }
}

impl Patch {
    /// Makes the patch of these active particles.
    pub fn new(partition: &Partition, active: &BTreeSet<u32>) -> Self {
        let active: Vec<u32> = active.iter().copied().collect();
        let awake: BTreeSet<usize> = active.iter().flat_map(|&particle| partition.cells_at(particle)).collect();
        let mut point_of: BTreeMap<u32, u32> = active.iter().copied().zip(0..).collect();
        let mut constrained = Vec::new();
        let mut residual_elements = partition.residual_elements().to_vec();
        let cells = awake
            .into_iter()
            .map(|number| {
                let (cell, moments) = (&partition.cells()[number], partition.moments(number));
                let corners = partition.corners(number);
                let anchors = corners.map(|particle| partition.anchor(particle));
                residual_elements[cell.tet as usize].add(cell.part, KEPT - 1.0, &moments, &anchors);
                let points = std::array::from_fn(|p| {
                    *point_of.entry(corners[p]).or_insert_with(|| {
                        constrained.push(anchors[p]);
                        (active.len() + constrained.len()) as u32 - 1
                    })
                });
                PatchCell {
                    number: number as u32,
                    rest: partition.rest_cell(number, 1.0 - KEPT),
                    points,
                    tet: cell.tet,
                }
            })
            .collect();
        Self { active, constrained, cells, residual_elements, prestrain: PrestrainDecay::default() }
    }

    /// Returns the same patch with prestrain; [`Self::products_n`] leaves it out.
    #[must_use]
    pub fn with_prestrain(self, prestrain: PrestrainDecay) -> Self {
        Self { prestrain, ..self }
    }

    /// Returns the active particles, ascending.
    pub fn active(&self) -> &[u32] {
        &self.active
    }

    /// Returns the rest positions (m) of the coarse nodes, and of the particles, which follow them.
    pub fn at_rest(&self, partition: &Partition) -> Field {
        let nodes = partition.coarse().positions_m().to_vec();
        Field { particles: self.following(partition, &nodes), nodes }
    }

    /// Returns the values that the active particles have while they follow the coarse nodes: positions of positions,
    /// velocities of velocities.
    pub fn following(&self, partition: &Partition, nodes: &[DVec3]) -> Vec<DVec3> {
        self.active.iter().map(|&particle| partition.anchor(particle).of(nodes)).collect()
    }

    /// Returns the elastic energy (J).
    pub fn energy_j(&self, materials: &Materials<'_>, at: &Field) -> f64 {
        let points = self.points(at);
        let of_cell = |cell: &PatchCell| {
            let (material, y) = (materials.of(cell.tet as usize), cell.of(&points));
            match self.prestrain.of_cell(cell.number) {
                Some(prestrain) => prestrain.energy_j(&cell.rest, material, &y),
                None => cell.rest.energy_j(material, &y),
            }
        };
        let fine: f64 = self.cells.iter().map(of_cell).sum();
        let of_residual = |(tet, residual): (usize, &ResidualElement)| match self.prestrain.of_tet(tet as u32) {
            Some(prestrain) => prestrain.energy_j(residual, materials.of(tet), &at.nodes),
            None => residual.energy_j(materials.of(tet), &at.nodes),
        };
        fine + self.residual_elements.iter().enumerate().map(of_residual).sum::<f64>()
    }

    /// Tells the deformation gradients of cells and the means of coarse tets, each with the number of its coarse tet.
    pub fn each_gradient(&self, at: &Field, each: &mut dyn FnMut(&DMat3, usize)) {
        let points = self.points(at);
        for cell in &self.cells {
            each(&cell.rest.gradient_of(&cell.of(&points)), cell.tet as usize);
        }
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            each(&residual.mean_gradient(&at.nodes), tet);
        }
    }

    /// Returns the number of coarse tets' means and cells that have `det F ≤ 0`.
    pub fn inverted(&self, at: &Field) -> u32 {
        let mut count = 0;
        self.each_gradient(at, &mut |f, _| count += u32::from(f.determinant() <= 0.0));
        count
    }

    /// Returns the forces (N) of elastic and viscous stress at positions `at` and velocities `rate`, and the power (W)
    /// that viscous stress takes.
    pub fn forces_n(&self, materials: &Materials<'_>, at: &Field, rate: &Field) -> (Field, f64) {
        let (points, rates) = (self.points(at), self.points(rate));
        let mut nodes = vec![DVec3::ZERO; at.nodes.len()];
        let mut of_points = vec![DVec3::ZERO; points.len()];
        let mut power_w = 0.0;
        for cell in &self.cells {
            let (material, y, rate) = (materials.of(cell.tet as usize), cell.of(&points), cell.of(&rates));
            let (forces, power) = match self.prestrain.of_cell(cell.number) {
                Some(prestrain) => prestrain.forces_n(&cell.rest, material, &y, &rate),
                None => cell.rest.forces_n(material, &y, &rate),
            };
            cell.add(&forces, &mut of_points);
            power_w += power;
        }
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            let material = materials.of(tet);
            power_w += match self.prestrain.of_tet(tet as u32) {
                Some(prestrain) => prestrain.add_forces_n(residual, material, &at.nodes, &rate.nodes, &mut nodes),
                None => residual.add_forces_n(material, &at.nodes, &rate.nodes, &mut nodes),
            };
        }
        (self.push_constrained(nodes, of_points), power_w)
    }

    /// Returns `−K a` (N), the change of the elastic forces along `a` at positions `at`.
    pub fn products_n(&self, materials: &Materials<'_>, at: &Field, a: &Field) -> Field {
        let (points, changes) = (self.points(at), self.points(a));
        let mut nodes = vec![DVec3::ZERO; at.nodes.len()];
        let mut of_points = vec![DVec3::ZERO; points.len()];
        for cell in &self.cells {
            let material = materials.of(cell.tet as usize);
            cell.add(&cell.rest.products_n(material, &cell.of(&points), &cell.of(&changes)), &mut of_points);
        }
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            residual.add_products_n(materials.of(tet), &at.nodes, &a.nodes, &mut nodes);
        }
        self.push_constrained(nodes, of_points)
    }

    /// Returns the diagonal blocks (N/m) of the stiffness at rest, of the coarse nodes and then of the active
    /// particles; the identity where there is no stiffness.
    pub fn diagonal_n_per_m(&self, materials: &Materials<'_>, nodes: usize) -> Vec<DMat3> {
        let mut of_nodes = vec![DMat3::ZERO; nodes];
        let mut of_points = vec![DMat3::ZERO; self.active.len() + self.constrained.len()];
        for cell in &self.cells {
            let blocks = cell.rest.diagonal_n_per_m(materials.of(cell.tet as usize));
            cell.points.iter().zip(blocks).for_each(|(&point, block)| of_points[point as usize] += block);
        }
        for (anchor, block) in self.constrained.iter().zip(of_points.split_off(self.active.len())) {
            for (&node, weight) in anchor.nodes.iter().zip(anchor.weights) {
                of_nodes[node as usize] += block * (weight * weight);
            }
        }
        for (tet, residual) in self.residual_elements.iter().enumerate() {
            residual.add_diagonal_n_per_m(materials.of(tet), &mut of_nodes);
        }
        let filled = |block: DMat3| if block == DMat3::ZERO { DMat3::IDENTITY } else { block };
        of_nodes.into_iter().chain(of_points).map(filled).collect()
    }

    /// Returns the values of all points: of the active particles, then of the constrained points, which follow.
    fn points(&self, a: &Field) -> Vec<DVec3> {
        a.particles.iter().copied().chain(self.constrained.iter().map(|anchor| anchor.of(&a.nodes))).collect()
    }

    /// Adds the forces (N) on constrained points to those of the coarse nodes that they follow.
    fn push_constrained(&self, mut nodes: Vec<DVec3>, mut of_points: Vec<DVec3>) -> Field {
        for (anchor, force) in self.constrained.iter().zip(&of_points[self.active.len()..]) {
            for (&node, weight) in anchor.nodes.iter().zip(anchor.weights) {
                nodes[node as usize] += *force * weight;
            }
        }
        of_points.truncate(self.active.len());
        Field { nodes, particles: of_points }
    }
}

impl PatchCell {
    fn of(&self, points: &[DVec3]) -> [DVec3; 8] {
        self.points.map(|point| points[point as usize])
    }

    fn add(&self, forces_n: &[DVec3; 8], of_points: &mut [DVec3]) {
        for (&point, force) in self.points.iter().zip(forces_n) {
            of_points[point as usize] += *force;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{Random, embedded_balls, moved, plus, random_like, tissue};
    use glam::DQuat;

    fn half_awake(partition: &Partition) -> Patch {
        let right = |&p: &u32| partition.particle_m(p).x > 0.2e-3;
        Patch::new(partition, &(0..partition.particle_count() as u32).filter(right).collect())
    }

    /// Returns the nodes, and the active particles, whose whole support lies within the body.
    fn interior(partition: &Partition, patch: &Patch) -> (Vec<usize>, Vec<usize>) {
        let mut node = vec![true; partition.coarse().positions_m().len()];
        let is_cut = |cell: usize| partition.moments(cell).volume_m3 < partition.edge_m(cell).powi(3) * (1.0 - 1e-12);
        for corner in (0..partition.cells().len()).filter(|&c| is_cut(c)).flat_map(|cell| partition.corners(cell)) {
            partition.anchor(corner).nodes.iter().for_each(|&n| node[n as usize] = false);
        }
        // Along every axis a particle moves what is up to an edge away.
        let edge = if partition.has_doubled() { 2.0 } else { 1.0 };
        let most_m = 10e-3 - edge * 3.0_f64.sqrt() * partition.sites().spacing_m();
        let is_deep =
            |&k: &usize| partition.particle_m(patch.active()[k]).distance(DVec3::new(0.2e-3, -0.3e-3, 0.1e-3)) < most_m;
        ((0..node.len()).filter(|&n| node[n]).collect(), (0..patch.active().len()).filter(is_deep).collect())
    }

    #[test]
    fn half_awake_uniform_stress_leaves_all_that_is_inside_in_balance() {
        for partition in embedded_balls() {
            let patch = half_awake(&partition);
            let rest = patch.at_rest(&partition);
            let (nodes, particles) = interior(&partition, &patch);
            assert!(nodes.len() > 3 && particles.len() > 50, "{} {}", nodes.len(), particles.len());
            let of_tet = vec![0; partition.residual_elements().len()];
            let mut random = Random(7);
            for material in tissue() {
                let materials = Materials { materials: &[material], of_tet: &of_tet };
                for _ in 0..5 {
                    let f = DMat3::IDENTITY + DMat3::from_cols(random.vector(), random.vector(), random.vector()) * 0.2;
                    let at = moved(&rest, |p| f * p + DVec3::new(0.01, 0.02, -0.01));
                    let still = moved(&rest, |_| DVec3::ZERO);
                    let (forces, _) = patch.forces_n(&materials, &at, &still);
                    let stress = material.piola(&f);
                    let h = partition.sites().spacing_m();
                    // What balances at a particle is eight times P h²/4, at a node as much as its surroundings are
                    // wide.
                    let at_particle = stress.x_axis.length().max(stress.y_axis.length()) * h * h;
                    let worst = particles.iter().map(|&p| forces.particles[p].length()).fold(0.0, f64::max);
                    print!("{:.1e} ", worst / at_particle);
                    assert!(worst < 1e-12 * at_particle, "particles: {worst:e} of {at_particle:e}");
                    let at_node = stress.x_axis.length() * 8e-3 * 8e-3;
                    let worst = nodes.iter().map(|&n| forces.nodes[n].length()).fold(0.0, f64::max);
                    println!("{:.1e}", worst / at_node);
                    assert!(worst < 1e-12 * at_node, "nodes: {worst:e} of {at_node:e}");
                }
            }
        }
    }

    #[test]
    fn rigid_motion_is_free_of_force_and_force_of_momentum() {
        for partition in embedded_balls() {
            let patch = half_awake(&partition);
            let rest = patch.at_rest(&partition);
            let of_tet = vec![0; partition.residual_elements().len()];
            let turn = DQuat::from_axis_angle(DVec3::new(0.48, 0.6, 0.64), 2.1);
            let mut random = Random(9);
            for material in tissue() {
                let materials = Materials { materials: &[material], of_tet: &of_tet };
                let at = moved(&rest, |p| turn * p + DVec3::new(0.3, -0.2, 0.5));
                let still = moved(&rest, |_| DVec3::ZERO);
                let (forces, _) = patch.forces_n(&materials, &at, &still);
                let scale = 10e3 * partition.sites().spacing_m().powi(2);
                let largest = forces.nodes.iter().chain(&forces.particles).map(|f| f.length()).fold(0.0, f64::max);
                print!("rigid {:.1e}", largest / scale);
                assert!(largest < 1e-11 * scale, "{largest:e}");
                let at = plus(&at, &random_like(&rest, 0.3e-3, &mut random), 1.0);
                let (forces, _) = patch.forces_n(&materials, &at, &random_like(&rest, 0.1, &mut random));
                let pairs = || at.nodes.iter().zip(&forces.nodes).chain(at.particles.iter().zip(&forces.particles));
                let total: DVec3 = pairs().map(|(_, f)| *f).sum();
                let torque: DVec3 = pairs().map(|(x, f)| x.cross(*f)).sum();
                let sizes: f64 = pairs().map(|(_, f)| f.length()).sum();
                println!(" sum {:.1e} torque {:.1e}", total.length() / sizes, torque.length() / sizes);
                assert!(total.length() < 1e-13 * sizes && torque.length() < 1e-13 * sizes, "{total} {torque} {sizes}");
            }
        }
    }

    #[test]
    fn forces_are_the_energys_gradient_and_products_theirs() {
        for partition in embedded_balls() {
            let patch = half_awake(&partition);
            let rest = patch.at_rest(&partition);
            let of_tet = vec![0; partition.residual_elements().len()];
            let mut random = Random(8);
            for material in tissue() {
                let materials = Materials { materials: &[material], of_tet: &of_tet };
                let at = plus(&rest, &random_like(&rest, 0.1e-3, &mut random), 1.0);
                let a = random_like(&rest, 0.1e-3, &mut random);
                let still = moved(&rest, |_| DVec3::ZERO);
                let s = 1e-3;
                let ahead = plus(&at, &a, s);
                let behind = plus(&at, &a, -s);
                let slope = (patch.energy_j(&materials, &ahead) - patch.energy_j(&materials, &behind)) / (2.0 * s);
                let (forces, _) = patch.forces_n(&materials, &at, &still);
                assert!((slope + forces.dot(&a)).abs() < 1e-6 * slope.abs(), "{slope} {}", forces.dot(&a));
                let change = plus(
                    &patch.forces_n(&materials, &ahead, &still).0,
                    &patch.forces_n(&materials, &behind, &still).0,
                    -1.0,
                );
                let products = patch.products_n(&materials, &at, &a);
                let difference = plus(&products, &change, -0.5 / s);
                assert!(difference.dot(&difference) < 1e-8 * products.dot(&products));
            }
        }
    }
}
