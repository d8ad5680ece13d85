//! Points of a body at rest, such as those of its skin, between the particles that carry them.
use super::{
    partition::{NONE, Partition},
    patch::{Field, Patch},
    sites::trilinear,
};
use glam::DVec3;

/// The cell that a point of the skin belongs to, and where in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SkinPlace {
    /// Index of the cell.
    pub cell: u32,
    /// In units of the cell's edge from its first corner.
    pub local: DVec3,
}

/// A point in a cell: it moves with the cell's particles by their trilinear weights, and hands forces to them by the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Particles.
    pub particles: [u32; 8],
    /// Their weights; they sum to one, and are negative only where the point lies in no cell of the body.
    pub weights: [f64; 8],
}

impl SkinPlace {
    /// Of a point (m); one that lies in no cell of the body belongs to the nearest.
    pub fn new(partition: &Partition, point_m: DVec3) -> Self {
        let sites = partition.sites();
        let at = sites.cell_near(point_m);
        let half = DVec3::splat(0.5 * sites.spacing_m());
        let distance = |cell: usize| {
            let from_middle = point_m - sites.cell_m(cell) - half;
            from_middle.abs().max_element()
        };
        let mut reach = 0;
        let cell = loop {
            let ranges: [_; 3] = std::array::from_fn(|axis| {
                at[axis].saturating_sub(reach)..=(at[axis] + reach).min(sites.cells()[axis] - 1)
            });
            let [x, y, z] = ranges;
            let around = z.flat_map(|k| {
                let x = x.clone();
                y.clone().flat_map(move |j| x.clone().map(move |i| sites.cell([i, j, k])))
            });
            let of_body = around.filter(|&cell| partition.cell_at(cell) != NONE);
            if let Some(nearest) = of_body.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) {
                break nearest;
            }
            reach += 1;
        };
        let cell = partition.cell_at(cell);
        let first_m = sites.cell_m(partition.cells()[cell as usize].site_cell as usize);
        Self { cell, local: (point_m - first_m) / partition.edge_m(cell as usize) }
    }

    /// Weights of its cell's particles.
    pub fn weights(&self, partition: &Partition) -> [f64; 8] {
        partition.hanging(self.cell as usize).to_particles(trilinear(self.local))
    }

    /// How much faster than the fastest of its particles the point can be: `Σ |w_p|`, 1 inside a cell.
    pub fn amplification(&self) -> f64 {
        trilinear(self.local).iter().map(|w| w.abs()).sum()
    }

    /// With its particles and weights.
    pub fn place(&self, partition: &Partition) -> Place {
        Place { particles: partition.corners(self.cell as usize), weights: self.weights(partition) }
    }
}

impl Place {
    /// Of a point (m); one that lies in no cell of the body belongs to the nearest.
    pub fn new(partition: &Partition, point_m: DVec3) -> Self {
        SkinPlace::new(partition, point_m).place(partition)
    }

    /// Of anything with three components.
    pub fn of(&self, partition: &Partition, patch: &Patch, a: &Field) -> DVec3 {
        let value = |particle: u32| match patch.active().binary_search(&particle) {
            Ok(index) => a.particles[index],
            Err(_) => partition.anchor(particle).of(&a.nodes),
        };
        self.particles.iter().zip(self.weights).map(|(&p, w)| value(p) * w).sum()
    }

    /// Adds a force (N) at the point to what it moves with.
    pub fn push(&self, partition: &Partition, patch: &Patch, force_n: DVec3, forces_n: &mut Field) {
        for (&particle, weight) in self.particles.iter().zip(self.weights) {
            if let Ok(index) = patch.active().binary_search(&particle) {
                forces_n.particles[index] += force_n * weight;
                continue;
            }
            let anchor = partition.anchor(particle);
            for (&node, share) in anchor.nodes.iter().zip(anchor.weights) {
                forces_n.nodes[node as usize] += force_n * (weight * share);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{Random, ball, balls_in_cage};

    #[test]
    fn points_of_the_skin_move_affinely_and_hand_over_all_of_a_force() {
        for partition in balls_in_cage() {
            let skin = ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3);
            let active = (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).z > 3e-3).collect();
            let patch = Patch::new(&partition, &active);
            let rest = patch.at_rest(&partition);
            let mut random = Random(31);
            // Some lie deep in the body.
            for (number, &point) in skin.positions_m().iter().enumerate() {
                let point = point * if number % 3 == 0 { 0.1 * (number % 10) as f64 } else { 1.0 };
                let place = Place::new(&partition, point);
                assert!(place.weights.iter().all(|&w| w > -0.5));
                assert!((place.of(&partition, &patch, &rest) - point).length() < 1e-15);
                let force = random.vector();
                let zero = |list: &[DVec3]| vec![DVec3::ZERO; list.len()];
                let mut forces = Field { nodes: zero(&rest.nodes), particles: zero(&rest.particles) };
                place.push(&partition, &patch, force, &mut forces);
                let all = || forces.nodes.iter().zip(&rest.nodes).chain(forces.particles.iter().zip(&rest.particles));
                let total: DVec3 = all().map(|(f, _)| *f).sum();
                let torque: DVec3 = all().map(|(f, x)| x.cross(*f)).sum();
                assert!((total - force).length() < 1e-14 && (torque - point.cross(force)).length() < 1e-16);
            }
        }
    }
}
