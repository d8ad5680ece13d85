//! Displacements of the patch, and the forces of its kernels.
use super::RunningPatch;
use crate::bodies::hybrid::{body::HybridBody, kernels::Found};
use glam::DVec3;

impl RunningPatch {
    /// Adds the forces (N) of elastic and viscous stress in the residual elements to those on coarse nodes, where
    /// [`Self::displace`] put the nodes, at velocities `v`, with the fraction `left` of the prestrain.
    pub(crate) fn add_coarse_forces_n(&mut self, v: &[DVec3], left: f64, forces_n: &mut [DVec3]) -> Found {
        let v_nodes = &v[..self.node_displacements_m.len()];
        self.residual_kernel.add_forces_n(&self.node_displacements_m, v_nodes, left, forces_n)
    }

    /// Adds the forces (N) of awake cells to those on coarse nodes, and overwrites those on active particles.
    pub(crate) fn add_cell_forces_n(
        &mut self,
        hybrid: &HybridBody,
        v: &[DVec3],
        left: f64,
        forces_n: &mut [DVec3],
    ) -> Found {
        let nodes = hybrid.node_count();
        let (v_nodes, v_particles) = v.split_at(nodes);
        if self.active.is_empty() {
            return Found::default();
        }
        // The displacement of one point is taken from all: far from rest, differences would be rounded too coarsely.
        let first_m = self.displacements_m[0];
        self.of_points.clear();
        self.of_points.extend(self.displacements_m.iter().map(|displacement| *displacement - first_m));
        self.full.set_displacements(&self.of_points);
        let has_cut = !self.cut.is_empty();
        if has_cut {
            self.cut.set_displacements(&self.of_points);
        }
        if self.is_viscous {
            self.constrained.follow(v_nodes, &mut self.of_points);
            for (v, &point) in v_particles.iter().zip(&self.points_of_active) {
                self.of_points[point as usize] = *v;
            }
            self.full.set_velocities(&self.of_points);
            self.cut.set_velocities(&self.of_points);
        }
        let mut found = self.full.forces(&self.rows, self.points.len(), left);
        self.full.forces_n(&mut self.of_points);
        if has_cut {
            found += self.cut.forces(self.points.len(), left);
            self.cut.add_forces_n(&mut self.of_points);
        }
        let (f_nodes, f_particles) = forces_n.split_at_mut(nodes);
        self.constrained.push(&self.of_points, f_nodes);
        for (force_n, &point) in f_particles.iter_mut().zip(&self.points_of_active) {
            *force_n = self.of_points[point as usize];
        }
        found
    }

    /// Moves the patch to positions (m) of coarse nodes and then active particles.
    pub(crate) fn displace(&mut self, hybrid: &HybridBody, x: &[DVec3]) {
        let (x_nodes, x_particles) = x.split_at(hybrid.node_count());
        let rest = hybrid.partition.coarse().positions_m();
        for ((u, x), rest) in self.node_displacements_m.iter_mut().zip(x_nodes).zip(rest) {
            *u = *x - *rest;
        }
        self.constrained.follow(&self.node_displacements_m, &mut self.displacements_m);
        for (x, &point) in x_particles.iter().zip(&self.points_of_active) {
            self.displacements_m[point as usize] = *x - self.points[point as usize].rest_m;
        }
        for &number in &self.carrying {
            let point = self.points_of_active[number as usize] as usize;
            let asleep_m = self.points[point].anchor.of(&self.node_displacements_m);
            self.deviations_m[number as usize] = self.displacements_m[point] - asleep_m;
        }
    }
}
