//! The largest natural frequency that a hybrid body can have, whichever particles are awake: that of all of them, over √(1 − ε).
//!
//! With no negative weight, a set of active particles has `U ≤ U_all` and `K ≥ (1 − ε) K_all` for the field it describes (Jensen, twice;
//! `docs/adr/hybrid.md`).
use super::{
    body::Hybrid,
    cell::{HOURGLASS, MODE_WEIGHTS, RestCell},
    moments::full_gradients_m2,
    patch::KEPT,
};
use crate::{
    fem::element::outer,
    integrate::spectrum::{lanczos, largest_eigenvalue},
    material::{Lame, stvk::trace},
};
use glam::{BVec3, DMat3, DVec3};

impl Hybrid {
    /// Largest natural frequency (rad/s) at rest, on springs (N/m, in all directions; one per particle, or none).
    ///
    /// Lanczos' estimate with its residual, and no more than the bound of single cells, each with its share `ρV_c/8` of its particles' masses (by Rayleigh's
    /// quotient no assembly is faster than the fastest cell): `ω_c² ≤ 8/ρ ((3λ⁺ + 2µ) λ_max(Σ_p b_p b_pᵀ) + κ/V Σ_p w_k γ_kp²)`. Of full cells
    /// that is `4 (3λ + 2µ)/(ρh²)`: all swell at once. Neighbours hinder each other, so that a lattice has some two thirds of it.
    pub fn frequency_rad_per_s(&self, springs_n_per_m: &[f64]) -> f64 {
        let spring = |(k, m): (&f64, &f64)| k / m;
        let of_springs = springs_n_per_m.iter().zip(&self.masses.particle_kg).map(spring).fold(0.0, f64::max);
        let bound_sq = self.cells_bound_sq() + of_springs;
        let root = |m: &f64| DVec3::splat(m.sqrt().recip());
        let root_inverse_mass: Vec<DVec3> = self.masses.particle_kg.iter().map(root).collect();
        let (theta, residual) = lanczos(&mut |a, out| self.apply(springs_n_per_m, a, out), &root_inverse_mass);
        ((theta + residual).min(bound_sq) / (1.0 - KEPT)).sqrt()
    }

    /// The same of the coarse level alone, while all particles sleep.
    pub fn coarse_frequency_rad_per_s(&self) -> f64 {
        let root = |(mass, free): (&f64, &BVec3)| {
            DVec3::select(*free, DVec3::splat(mass.max(f64::MIN_POSITIVE).sqrt().recip()), DVec3::ZERO)
        };
        let root_inverse_mass: Vec<DVec3> = self.masses.node_kg.iter().zip(&self.free).map(root).collect();
        let at_rest_m = self.partition.coarse().positions_m();
        let mut apply = |a: &[DVec3], out: &mut [DVec3]| {
            out.fill(DVec3::ZERO);
            for (tet, share) in self.partition.shares().iter().enumerate() {
                share.add_products_n(self.material_of_tet(tet as u32), at_rest_m, a, out);
            }
            for product in out {
                *product = -*product;
            }
        };
        let (theta, residual) = lanczos(&mut apply, &root_inverse_mass);
        (theta + residual).sqrt()
    }

    /// `out ← K a` with all particles awake.
    fn apply(&self, springs_n_per_m: &[f64], a: &[DVec3], out: &mut [DVec3]) {
        out.fill(DVec3::ZERO);
        let spacing_m = self.partition.sites().spacing_m();
        let full = RestCell::new(spacing_m, 1.0, &(spacing_m.powi(3), full_gradients_m2(spacing_m)));
        for number in 0..self.partition.cells().len() {
            let cut = self.partition.is_cut(number);
            let rest = if cut { RestCell::new(spacing_m, 1.0, &self.partition.moments(number)) } else { full };
            let corners = self.partition.corners(number);
            let material = self.material_of_cell(number);
            let Lame { lambda_pa, mu_pa } = material.lame;
            let of = corners.map(|particle| a[particle as usize]);
            let g = rest.gradient_of(&of);
            let sigma = (g + g.transpose()) * mu_pa + DMat3::from_diagonal(DVec3::splat(lambda_pa * trace(&g)));
            let forces = rest.corner_forces_n(material, &sigma, &rest.amplitudes(&of));
            for (&particle, force) in corners.iter().zip(forces) {
                out[particle as usize] -= force;
            }
        }
        for ((out, a), spring) in out.iter_mut().zip(a).zip(springs_n_per_m) {
            *out += *a * *spring;
        }
    }

    fn cells_bound_sq(&self) -> f64 {
        let spacing_m = self.partition.sites().spacing_m();
        let hourglass_per_m2 = HOURGLASS * 4.0 / 3.0 / (spacing_m * spacing_m);
        let of_cell = |number: usize| {
            let cell = self.partition.cells()[number];
            let rest = RestCell::new(spacing_m, 1.0, &self.partition.moments(number));
            let gram = rest.gradients_per_m.iter().fold(DMat3::ZERO, |sum, b| sum + outer(*b, *b));
            let modes = rest.modes.iter().zip(MODE_WEIGHTS);
            let modes = modes.map(|(mode, w)| w * mode.iter().map(|g| g * g).sum::<f64>()).fold(0.0, f64::max);
            let Lame { lambda_pa, mu_pa } = self.material_of_cell(number).lame;
            let density = self.densities_kg_per_m3[self.of_tet[cell.tet as usize] as usize];
            let of_strain = (3.0 * lambda_pa.max(0.0) + 2.0 * mu_pa) * largest_eigenvalue(&gram);
            8.0 / density * (of_strain + hourglass_per_m2 * mu_pa * modes)
        };
        (0..self.partition.cells().len()).map(of_cell).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        hybrid::{
            fade::Fading,
            running::RunningPatch,
            testing::{Random, hybrid_ball, tissue},
        },
        world::Precision,
    };

    /// The largest frequency (rad/s) of what is left to the coarse level, with the mass matrix of these active particles: powers of `M'⁻¹ K_c`.
    fn left_rad_per_s(hybrid: &Hybrid, active: &[u32]) -> f64 {
        let mut running = RunningPatch::new(hybrid, active.len(), Precision::Double);
        running.wake(hybrid, active, &Fading::default());
        let (nodes, mut random) = (hybrid.node_count(), Random(7));
        let mut a: Vec<DVec3> = (0..nodes + active.len()).map(|_| random.vector()).collect();
        let mut found = 0.0;
        for _ in 0..600 {
            let mut products = vec![DVec3::ZERO; a.len()];
            for tet in 0..hybrid.partition.shares().len() as u32 {
                let (share, material) = (running.share(tet), hybrid.material_of_tet(tet));
                share.add_products_n(material, hybrid.partition.coarse().positions_m(), &a, &mut products);
            }
            let before: f64 = a.iter().map(|a| a.length_squared()).sum();
            running.metric_mut().accelerate(&mut products);
            let size = products.iter().map(|a| a.length_squared()).sum::<f64>().sqrt();
            found = size / before.sqrt();
            a = products.iter().map(|product| *product / size).collect();
        }
        found.sqrt()
    }

    #[test]
    fn what_is_left_to_the_coarse_level_is_no_faster_than_all_of_it() {
        let material = tissue()[1];
        let hybrid = hybrid_ball(&[material; 2]);
        let all = hybrid.coarse_frequency_rad_per_s();
        let particles = || (0..hybrid.partition.particle_count() as u32).filter(|&p| hybrid.may_wake(p));
        let near = |middle: DVec3, distance_m: f64| -> Vec<u32> {
            particles().filter(|&p| hybrid.partition.particle_m(p).distance(middle) < distance_m).collect()
        };
        let none = left_rad_per_s(&hybrid, &[]);
        assert!((none / all - 1.0).abs() < 1e-2, "{none} {all}");
        for active in
            [near(DVec3::Z * 9e-3, 3e-3), near(DVec3::X * 8e-3, 5e-3), near(DVec3::ZERO, 7e-3), particles().collect()]
        {
            let left = left_rad_per_s(&hybrid, &active);
            assert!(left < 1.01 * all, "{} awake: {left} {all}", active.len());
        }
    }

    #[test]
    fn it_lies_between_a_known_mode_and_the_bound_and_springs_raise_it() {
        let material = tissue()[1];
        let hybrid = hybrid_ball(&[material; 2]);
        let Lame { lambda_pa, mu_pa } = material.lame;
        let full_sq = 4.0 * (3.0 * lambda_pa + 2.0 * mu_pa) / (1000.0 * 1.1e-3_f64.powi(2));
        // A mode there is: (−1)^i (−1)^j (−1)^k, each along its own axis, of unlimited lattices.
        let mode_sq = 4.0 * (lambda_pa + 2.0 * mu_pa) / (1000.0 * 1.1e-3_f64.powi(2));
        let found_sq = hybrid.frequency_rad_per_s(&[]).powi(2) * (1.0 - KEPT);
        let bound_sq = hybrid.cells_bound_sq();
        println!("{} {}", found_sq / full_sq, bound_sq / full_sq);
        assert!(found_sq > mode_sq && found_sq <= bound_sq, "{found_sq} {mode_sq} {bound_sq}");
        let springs: Vec<f64> = hybrid.masses.particle_kg.iter().map(|m| m * full_sq).collect();
        let held_sq = hybrid.frequency_rad_per_s(&springs).powi(2) * (1.0 - KEPT);
        assert!((held_sq / (found_sq + full_sq) - 1.0).abs() < 1e-3, "{held_sq}");
    }
}
