//! The largest natural frequency and the largest rate of damping that a hybrid body can have, whichever particles are
//! awake: those of all of them, over √(1 − ε) and over 1 − ε.
//!
//! A set of active particles has `U ≤ U_all` (Jensen) and `K ≥ (1 − ε) K_all` (Jensen, and Cauchy where weights are
//! negative) for the field it describes (`docs/adr/hybrid.md`). The power that viscous stress takes is as convex a
//! function of the rate of strain.
use super::{
    body::HybridBody,
    cell::{HOURGLASS, MODE_WEIGHTS},
    patch::KEPT,
};
use crate::{
    linalg::{
        lanczos::{lanczos, lanczos_to, telling},
        tensor::{largest_eigenvalue, outer, trace},
    },
    material::{Lame, Material},
};
use glam::{BVec3, DMat3, DVec3};

/// Bound of Lanczos' residual over the eigenvalue: `FINE` for bodies of up to `MANY_CELLS` cells, `ROUGH` for larger
/// ones.
const FINE: f64 = 1e-4;
const MANY_CELLS: usize = 200_000;
const ROUGH: f64 = 1e-2;

/// What the body answers motion with.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Answer {
    /// Elastic stress answers strain: the stiffness matrix K.
    Strain,
    /// Viscous stress answers the rate of strain: the damping matrix C.
    StrainRate,
}

/// Moduli of a cell (Pa, or Pa s).
#[derive(Debug, Clone, Copy)]
struct CellModuli {
    strain: Lame,
    hourglass_pa: f64,
}

impl Answer {
    fn moduli(self, material: &Material) -> CellModuli {
        match self {
            Self::Strain => CellModuli { strain: material.lame, hourglass_pa: material.lame.mu_pa },
            // Nothing damps hourglasses.
            Self::StrainRate => CellModuli { strain: material.viscosity_as_stiffness().lame, hourglass_pa: 0.0 },
        }
    }
}

impl HybridBody {
    /// Returns the largest natural frequency (rad/s) at rest, on springs (N/m, in all directions; one per particle, or
    /// none).
    ///
    /// It is Lanczos' estimate plus its residual, and no more than the bound of single cells, each with its part
    /// `ρV_cp` (an eighth per corner) of its particles' masses. By Rayleigh's quotient no assembly is faster than the
    /// fastest cell: `ω_c² ≤ V_c/ρ ((3λ⁺ + 2µ) λ_max(Σ_p b_p b_pᵀ/V_cp) + κ/V_c Σ_p w_k γ_kp²/V_cp)`. For full cells
    /// that is `4 (3λ + 2µ)/(ρh²)`, of cells that swell. Neighbours hinder each other, so that a lattice has some two
    /// thirds of it.
    ///
    /// For very many cells the estimate is rougher, and as safe: its residual, which is added, may be a hundredth of
    /// it. `progress` is told the fraction done.
    pub fn frequency_rad_per_s(&self, springs_n_per_m: &[f64], progress: &mut dyn FnMut(f64)) -> f64 {
        let tolerance = if self.partition.cells().len() > MANY_CELLS { ROUGH } else { FINE };
        self.eigenvalue_to(tolerance, Answer::Strain, springs_n_per_m, progress).sqrt()
    }

    /// Returns the largest rate of damping (1/s) of viscous stress at rest, the largest eigenvalue of
    /// `M^{-½} C M^{-½}`; 0 where nothing is viscous. It is Lanczos' estimate plus its residual, which may be a hundredth
    /// of it: it is a small part of what makes substeps short. `progress` is told the fraction done.
    pub(crate) fn damping_per_s(&self, progress: &mut dyn FnMut(f64)) -> f64 {
        if self.is_viscous() { self.eigenvalue_to(ROUGH, Answer::StrainRate, &[], progress) } else { 0.0 }
    }

    fn is_viscous(&self) -> bool {
        self.materials.iter().any(|material| !material.viscosity.is_zero())
    }

    /// Returns `λ_max(M^{-½} (A + springs) M^{-½})` of all particles over `1 − ε`, with `A` either of K and C.
    fn eigenvalue_to(
        &self,
        tolerance: f64,
        answer: Answer,
        springs_n_per_m: &[f64],
        progress: &mut dyn FnMut(f64),
    ) -> f64 {
        let spring = |(k, m): (&f64, &f64)| k / m;
        let of_springs = springs_n_per_m.iter().zip(&self.masses.particle_kg).map(spring).fold(0.0, f64::max);
        let bound = self.cells_bound(answer) + of_springs;
        let root = |m: &f64| DVec3::splat(m.sqrt().recip());
        let root_inverse_mass: Vec<DVec3> = self.masses.particle_kg.iter().map(root).collect();
        let mut apply = telling(progress, |a, out| self.apply(answer, springs_n_per_m, a, out));
        let (theta, residual) = lanczos_to(tolerance, &mut apply, &root_inverse_mass);
        (theta + residual).min(bound) / (1.0 - KEPT)
    }

    /// Returns the largest natural frequency (rad/s) of the coarse level alone, while all particles sleep.
    pub fn coarse_frequency_rad_per_s(&self) -> f64 {
        self.coarse_eigenvalue(Answer::Strain).sqrt()
    }

    /// Returns the largest rate of damping (1/s) of the coarse level alone; 0 where nothing is viscous.
    pub(crate) fn coarse_damping_per_s(&self) -> f64 {
        if self.is_viscous() { self.coarse_eigenvalue(Answer::StrainRate) } else { 0.0 }
    }

    fn coarse_eigenvalue(&self, answer: Answer) -> f64 {
        let root = |(mass, free): (&f64, &BVec3)| {
            DVec3::select(*free, DVec3::splat(mass.max(f64::MIN_POSITIVE).sqrt().recip()), DVec3::ZERO)
        };
        let root_inverse_mass: Vec<DVec3> = self.masses.node_kg.iter().zip(&self.free).map(root).collect();
        let at_rest_m = self.partition.coarse().positions_m();
        let mut apply = |a: &[DVec3], out: &mut [DVec3]| {
            out.fill(DVec3::ZERO);
            for (tet, residual) in self.partition.residual_elements().iter().enumerate() {
                let material = self.material_of_tet(tet as u32);
                match answer {
                    Answer::Strain => residual.add_products_n(material, at_rest_m, a, out),
                    Answer::StrainRate => residual.add_damping_products_n(material, a, out),
                }
            }
            for product in out {
                *product = -*product;
            }
        };
        let (theta, residual) = lanczos(&mut apply, &root_inverse_mass);
        theta + residual
    }

    /// Writes `out ← (A + springs) a` with all particles awake.
    fn apply(&self, answer: Answer, springs_n_per_m: &[f64], a: &[DVec3], out: &mut [DVec3]) {
        out.fill(DVec3::ZERO);
        for number in 0..self.partition.cells().len() {
            let corners = self.partition.corners(number);
            let moduli = answer.moduli(self.material_of_cell(number));
            if self.partition.is_whole(number) {
                add_full_products(self.partition.edge_m(number), moduli, &corners, a, out);
                continue;
            }
            let rest = self.partition.rest_cell(number, 1.0);
            let of = corners.map(|particle| a[particle as usize]);
            let g = rest.gradient_of(&of);
            let forces =
                rest.corner_forces_n(moduli.hourglass_pa, &stress_pa(moduli.strain, &g), &rest.amplitudes(&of));
            for (&particle, force) in corners.iter().zip(forces) {
                out[particle as usize] -= force;
            }
        }
        for ((out, a), spring) in out.iter_mut().zip(a).zip(springs_n_per_m) {
            *out += *a * *spring;
        }
    }

    /// Returns the largest eigenvalue of single cells, each with its part of its particles' masses.
    fn cells_bound(&self, answer: Answer) -> f64 {
        let of_cell = |number: usize| {
            let cell = self.partition.cells()[number];
            let rest = self.partition.rest_cell(number, 1.0);
            // V over V_p, eight unless corners hang.
            let per_volume = self.partition.particles_m3(number).map(|volume_m3| rest.volume_m3 / volume_m3);
            let grams = rest.gradients_per_m.iter().zip(per_volume);
            let gram = grams.fold(DMat3::ZERO, |sum, (b, per_volume)| sum + outer(*b, *b) * per_volume);
            let mode =
                |mode: &[f64; 8]| mode.iter().zip(per_volume).map(|(g, per_volume)| g * g * per_volume).sum::<f64>();
            let modes = rest.modes.iter().zip(MODE_WEIGHTS).map(|(of, w)| w * mode(of)).fold(0.0, f64::max);
            let CellModuli { strain, hourglass_pa } = answer.moduli(self.material_of_cell(number));
            let density = self.densities_kg_per_m3[self.of_tet[cell.tet as usize] as usize];
            let of_strain = (3.0 * strain.lambda_pa.max(0.0) + 2.0 * strain.mu_pa) * largest_eigenvalue(&gram);
            (of_strain + rest.hourglass_m / rest.volume_m3 * hourglass_pa * modes) / density
        };
        (0..self.partition.cells().len()).map(of_cell).fold(0.0, f64::max)
    }
}

/// Returns the stress `σ` (Pa) of the gradient of a small displacement.
fn stress_pa(Lame { lambda_pa, mu_pa }: Lame, g: &DMat3) -> DMat3 {
    (*g + g.transpose()) * mu_pa + DMat3::from_diagonal(DVec3::splat(lambda_pa * trace(g)))
}

/// Adds `K_c a` of a cell that the surface does not cut to `out`: the same as `cell`'s, with an eighth of its
/// multiplications.
///
/// Its gradient's rows and its hourglass amplitudes are sums of the corners' values with the signs of
/// `ξ, η, ζ, ηζ, ζξ, ξη, ξηζ`: all come from three rounds of sums and differences of pairs, `t`, and go back the same
/// way.
/// ```text
/// G e_j = t_j/4h,   q_k = t_k/8,   K a = Hᵀ (V/4h σ e_j, κ/8 w_k q_k)
/// ```
fn add_full_products(spacing_m: f64, moduli: CellModuli, corners: &[u32; 8], a: &[DVec3], out: &mut [DVec3]) {
    let mut t = [DVec3::ZERO; 8];
    for (t, &corner) in t.iter_mut().zip(corners) {
        *t = a[corner as usize];
    }
    for bit in [1, 2, 4] {
        for low in (0..8).filter(|low| low & bit == 0) {
            (t[low], t[low | bit]) = (t[low] + t[low | bit], t[low | bit] - t[low]);
        }
    }
    // ξ is bit 0, η bit 1, ζ bit 2.
    let [_, x, y, xy, z, zx, yz, xyz] = t;
    let to_gradient = 0.25 / spacing_m;
    let sigma = stress_pa(moduli.strain, &(DMat3::from_cols(x, y, z) * to_gradient));
    let back = to_gradient * spacing_m.powi(3);
    let kappa_64th = HOURGLASS * 4.0 / 3.0 * spacing_m * moduli.hourglass_pa / 64.0;
    let [of_yz, of_zx, of_xy, of_xyz] = MODE_WEIGHTS.map(|weight| weight * kappa_64th);
    let [x, y, z] = [sigma.x_axis, sigma.y_axis, sigma.z_axis].map(|column| column * back);
    let mut t = [DVec3::ZERO, x, y, xy * of_xy, z, zx * of_zx, yz * of_yz, xyz * of_xyz];
    for bit in [1, 2, 4] {
        for low in (0..8).filter(|low| low & bit == 0) {
            (t[low], t[low | bit]) = (t[low] - t[low | bit], t[low] + t[low | bit]);
        }
    }
    for (&corner, product) in corners.iter().zip(t) {
        out[corner as usize] += product;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        bodies::hybrid::{
            cell::RestCell,
            moments::Moments,
            prestrain::PrestrainDecay,
            running::RunningPatch,
            testing::{Random, hybrid_ball, hybrid_ball_of, tissue},
        },
        settings::Precision,
    };

    /// Returns the largest frequency (rad/s) of what is left to the coarse level, with the mass matrix of these active
    /// particles, by powers of `M'⁻¹ K_c`.
    fn left_rad_per_s(hybrid: &HybridBody, active: &[u32]) -> f64 {
        let mut running = RunningPatch::new(hybrid, active.len(), Precision::Double);
        running.wake(hybrid, active, &PrestrainDecay::default());
        let (nodes, mut random) = (hybrid.node_count(), Random(7));
        let mut a: Vec<DVec3> = (0..nodes + active.len()).map(|_| random.vector()).collect();
        let mut found = 0.0;
        for _ in 0..600 {
            let mut products = vec![DVec3::ZERO; a.len()];
            for tet in 0..hybrid.partition.residual_elements().len() as u32 {
                let (residual, material) = (running.residual_element(tet), hybrid.material_of_tet(tet));
                residual.add_products_n(material, hybrid.partition.coarse().positions_m(), &a, &mut products);
            }
            let before: f64 = a.iter().map(|a| a.length_squared()).sum();
            running.mass_matrix_mut().accelerate(&mut products);
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

    /// A rough estimate is never below the fine one, and above it by half of its residual at most.
    #[test]
    fn a_rough_estimate_is_as_safe_and_little_more() {
        for spacing_m in [1.1e-3, 0.5e-3] {
            let hybrid = hybrid_ball_of(&[tissue()[1]; 2], spacing_m, None);
            let fine = hybrid.frequency_rad_per_s(&[], &mut |_| {});
            let on_third = |(number, mass): (usize, &f64)| if number % 3 == 0 { 0.3 * mass * fine * fine } else { 0.0 };
            let springs: Vec<f64> = hybrid.masses.particle_kg.iter().enumerate().map(on_third).collect();
            for springs in [&[][..], &springs] {
                let of = |tolerance: f64| hybrid.eigenvalue_to(tolerance, Answer::Strain, springs, &mut |_| {}).sqrt();
                let over = of(ROUGH) / of(FINE) - 1.0;
                println!("{} cells, springs {}: {:+.2} %", hybrid.partition.cells().len(), springs.len(), 100.0 * over);
                assert!((-FINE..0.5 * ROUGH).contains(&over), "{over}");
            }
        }
    }

    /// Damping rates of both levels are those of the forces of viscous stress, by powers.
    #[test]
    fn damping_is_that_of_the_forces() {
        let hybrid = hybrid_ball(&[tissue()[1]; 2]);
        let of_forces = |add: &dyn Fn(&[DVec3], &mut [DVec3]), mass_kg: &[f64], free: &dyn Fn(usize) -> DVec3| {
            let mut random = Random(3);
            let mut v: Vec<DVec3> = mass_kg.iter().map(|_| random.vector()).collect();
            let mut found = 0.0;
            for _ in 0..400 {
                let mut force_n = vec![DVec3::ZERO; v.len()];
                add(&v, &mut force_n);
                let before = v.iter().map(|v| v.length_squared()).sum::<f64>().sqrt();
                let accelerated = |(n, (f, m)): (usize, (&DVec3, &f64))| *f * free(n) / m.max(f64::MIN_POSITIVE);
                v = force_n.iter().zip(mass_kg).enumerate().map(accelerated).collect();
                found = v.iter().map(|v| v.length_squared()).sum::<f64>().sqrt() / before;
                for v in &mut v {
                    *v *= 1.0 / (found * before);
                }
            }
            found
        };
        let of_cells = of_forces(
            &|v, force_n| {
                for number in 0..hybrid.partition.cells().len() {
                    let rest = hybrid.partition.rest_cell(number, 1.0);
                    let corners = hybrid.partition.corners(number);
                    let (y, rate) = (corners.map(|p| hybrid.partition.particle_m(p)), corners.map(|p| v[p as usize]));
                    let [with, without] = [rate, [DVec3::ZERO; 8]]
                        .map(|rate| rest.forces_n(hybrid.material_of_cell(number), &y, &rate).0);
                    for ((&p, with), without) in corners.iter().zip(with).zip(without) {
                        force_n[p as usize] += with - without;
                    }
                }
            },
            &hybrid.masses.particle_kg,
            &|_| DVec3::ONE,
        );
        let fine = hybrid.damping_per_s(&mut |_| {}) * (1.0 - KEPT);
        let at_rest_m = hybrid.partition.coarse().positions_m();
        let of_residuals = of_forces(
            &|v, force_n| {
                for (tet, residual) in hybrid.partition.residual_elements().iter().enumerate() {
                    residual.add_forces_n(hybrid.material_of_tet(tet as u32), at_rest_m, v, force_n);
                }
            },
            &hybrid.masses.node_kg,
            &|node| DVec3::select(hybrid.free[node], DVec3::ONE, DVec3::ZERO),
        );
        let coarse = hybrid.coarse_damping_per_s();
        println!("cells {of_cells} {fine}, residual elements {of_residuals} {coarse} 1/s");
        assert!((-2e-3..ROUGH).contains(&(fine / of_cells - 1.0)), "{fine} {of_cells}");
        assert!((coarse / of_residuals - 1.0).abs() < 2e-3, "{coarse} {of_residuals}");
    }

    #[test]
    fn products_of_full_cells_are_those_of_any_cell() {
        let (spacing_m, mut random) = (1.1e-3, Random(9));
        let rest = RestCell::new(spacing_m, 1.0, &Moments::full(spacing_m));
        for material in tissue() {
            let a: [DVec3; 8] = std::array::from_fn(|_| random.vector());
            let sigma = stress_pa(material.lame, &rest.gradient_of(&a));
            let expected = rest.corner_forces_n(material.lame.mu_pa, &sigma, &rest.amplitudes(&a));
            let mut found = [DVec3::ZERO; 8];
            add_full_products(spacing_m, Answer::Strain.moduli(&material), &[0, 1, 2, 3, 4, 5, 6, 7], &a, &mut found);
            let size = expected.iter().map(|f| f.length()).fold(0.0, f64::max);
            for (found, expected) in found.iter().zip(expected) {
                assert!((*found + expected).length() < 1e-13 * size, "{found} {expected}");
            }
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
        let found_sq = hybrid.frequency_rad_per_s(&[], &mut |_| {}).powi(2) * (1.0 - KEPT);
        let bound_sq = hybrid.cells_bound(Answer::Strain);
        println!("{} {}", found_sq / full_sq, bound_sq / full_sq);
        assert!(found_sq > mode_sq && found_sq <= bound_sq, "{found_sq} {mode_sq} {bound_sq}");
        let springs: Vec<f64> = hybrid.masses.particle_kg.iter().map(|m| m * full_sq).collect();
        let held_sq = hybrid.frequency_rad_per_s(&springs, &mut |_| {}).powi(2) * (1.0 - KEPT);
        assert!((held_sq / (found_sq + full_sq) - 1.0).abs() < 1e-3, "{held_sq}");
    }
}
