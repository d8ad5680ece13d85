//! Points of a body at rest, such as the vertices of its skin, between the eight particles that carry them.
use super::{
    partition::{NONE, Partition},
    sites::trilinear,
};
use glam::DVec3;

/// A point given by the cell that it belongs to and its coordinates there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellPoint {
    /// Index of the cell.
    pub cell: u32,
    /// Coordinates in units of the cell's edge, from its first corner.
    pub local: DVec3,
}

/// A point given by the eight particles of its cell and their trilinear weights: it moves by the mean of their
/// motions with these weights, and a force on it acts on them by the same weights.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrilinearPoint {
    /// The particles.
    pub particles: [u32; 8],
    /// Their weights; they sum to one, and are negative only where the point lies in no cell of the body.
    pub weights: [f64; 8],
}

impl CellPoint {
    /// Finds the cell of a point (m); a point that lies in no cell of the body belongs to the nearest one.
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

    /// Returns the weights of its cell's particles.
    pub fn weights(&self, partition: &Partition) -> [f64; 8] {
        partition.hanging(self.cell as usize).to_particles(trilinear(self.local))
    }

    /// Returns its position (m) at rest.
    pub(super) fn rest_m(&self, partition: &Partition) -> DVec3 {
        let first_m = partition.sites().cell_m(partition.cells()[self.cell as usize].site_cell as usize);
        first_m + self.local * partition.edge_m(self.cell as usize)
    }

    /// Returns a bound of the point's speed over that of the fastest of its particles: `Σ |w_p|`, 1 inside a cell.
    pub fn amplification(&self) -> f64 {
        trilinear(self.local).iter().map(|w| w.abs()).sum()
    }

    /// Returns its particles and their weights.
    pub fn trilinear(&self, partition: &Partition) -> TrilinearPoint {
        TrilinearPoint { particles: partition.corners(self.cell as usize), weights: self.weights(partition) }
    }
}

impl TrilinearPoint {
    /// Finds the particles and weights of a point (m); one that lies in no cell of the body belongs to the nearest.
    pub fn new(partition: &Partition, point_m: DVec3) -> Self {
        CellPoint::new(partition, point_m).trilinear(partition)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::testing::{ball, embedded_balls};

    #[test]
    fn points_of_the_skin_move_affinely() {
        for partition in embedded_balls() {
            let skin = ball(0.01, DVec3::new(0.2e-3, -0.3e-3, 0.1e-3), 3);
            // Some lie deep in the body.
            for (number, &point) in skin.positions_m().iter().enumerate() {
                let point = point * if number % 3 == 0 { 0.1 * (number % 10) as f64 } else { 1.0 };
                let TrilinearPoint { particles, weights } = TrilinearPoint::new(&partition, point);
                assert!(weights.iter().all(|&w| w > -0.5));
                assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14, "{weights:?}");
                let moved: DVec3 = particles.iter().zip(weights).map(|(&p, w)| partition.particle_m(p) * w).sum();
                assert!((moved - point).length() < 1e-15, "{moved} {point}");
            }
        }
    }
}
