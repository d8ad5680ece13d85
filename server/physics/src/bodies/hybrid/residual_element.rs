//! The residual element of a coarse tet: what it still answers for of the body beside awake cells, and its energy.
//!
//! The shape of a tet is strained by the mean gradient `F_g` of each of its five parts, its volume by the mean `F̄` of
//! the whole: the tets would lock if every part had to keep its own volume.
//! ```text
//! U_e = Σ_g V_g Ψ(F_g; λ⁻, µ) + V_e Ψ(F̄; λ − λ⁻, 0)        F̄ = Σ_g V_g F_g / V_e,  λ⁻ = min(λ, 0)
//! f_i = −Σ_g (P(F_g; λ⁻, µ) + P(F̄; λ − λ⁻, 0)) T_gi
//! ```
//! (every law's Ψ is linear in λ and µ). Viscous stress acts on the parts.
use super::{
    composite::{Anchor, PARTS},
    moments::Moments,
};
use crate::{
    linalg::tensor::outer,
    material::{Lame, Material, viscous},
};
use glam::{DMat3, DVec3};

/// The part of the body that a coarse tet answers for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResidualElement {
    /// Numbers of the coarse nodes that move it.
    pub nodes: Vec<u32>,
    /// `V_g` (m³) of every part.
    pub volume_m3: [f64; PARTS],
    /// `T_gi` (m²) of every node and part.
    pub moments_m2: Vec<[DVec3; PARTS]>,
}

impl ResidualElement {
    /// Adds `factor` times a cell's moments to a part; `corners` tell what the cell's particles follow.
    pub fn add(&mut self, part: u8, factor: f64, moments: &Moments, corners: &[Anchor; 8]) {
        let numbers = corners.map(|anchor| anchor.nodes.map(|node| self.number_of(node)));
        self.add_numbered(part, factor, moments, corners, &numbers);
    }

    /// Returns the number of a node among its own; adds the node if it is not among them.
    fn number_of(&mut self, node: u32) -> u32 {
        let number = self.nodes.iter().position(|&own| own == node).unwrap_or_else(|| {
            self.nodes.push(node);
            self.moments_m2.push([DVec3::ZERO; PARTS]);
            self.nodes.len() - 1
        });
        number as u32
    }

    /// Does the same as [`Self::add`] where the numbers of the nodes are known.
    pub(super) fn add_numbered(
        &mut self,
        part: u8,
        factor: f64,
        Moments { volume_m3, gradients_m2 }: &Moments,
        corners: &[Anchor; 8],
        numbers: &[[u32; 4]; 8],
    ) {
        let part = part as usize;
        self.volume_m3[part] += factor * volume_m3;
        for ((anchor, gradient), numbers) in corners.iter().zip(gradients_m2).zip(numbers) {
            for (&number, weight) in numbers.iter().zip(anchor.weights) {
                self.moments_m2[number as usize][part] += *gradient * (factor * weight);
            }
        }
    }

    /// Returns the gradient of every part: `F_g` of positions, its rate of velocities. A part without volume has the
    /// gradient `empty`: the identity, or zero.
    pub(super) fn gradients(&self, a: &[DVec3], empty: DMat3) -> [DMat3; PARTS] {
        let mut gradients = [DMat3::ZERO; PARTS];
        let Some(&first) = self.nodes.first() else { return [empty; PARTS] };
        for (&node, moments) in self.nodes.iter().zip(&self.moments_m2) {
            // Differences are taken so that a translation drops out exactly.
            let from_first = a[node as usize] - a[first as usize];
            for (gradient, moment) in gradients.iter_mut().zip(moments) {
                *gradient += outer(from_first, *moment);
            }
        }
        std::array::from_fn(|part| {
            let volume = self.volume_m3[part];
            if volume > 0.0 { gradients[part] * (1.0 / volume) } else { empty }
        })
    }

    /// Returns `F_g` after some nodes were moved by `Δ_i` (m) from where it was `gradients`:
    /// `F_g + Σ_i Δ_i T_giᵀ / V_g`.
    pub(super) fn gradients_after(&self, gradients: &[DMat3; PARTS], shifts_m: &[DVec3]) -> [DMat3; PARTS] {
        let mut after = *gradients;
        let moved =
            self.nodes.iter().zip(&self.moments_m2).filter(|(node, _)| shifts_m[**node as usize] != DVec3::ZERO);
        for (&node, moments) in moved {
            for ((gradient, moment), volume) in after.iter_mut().zip(moments).zip(self.volume_m3) {
                if volume > 0.0 {
                    *gradient += outer(shifts_m[node as usize], *moment * (1.0 / volume));
                }
            }
        }
        after
    }

    /// Returns the mean over the parts, `Σ_g V_g A_g / V_e`.
    pub(super) fn mean(&self, of_parts: &[DMat3; PARTS]) -> DMat3 {
        let sum = of_parts.iter().zip(self.volume_m3).fold(DMat3::ZERO, |sum, (a, volume)| sum + *a * volume);
        sum * (1.0 / self.total_m3())
    }

    /// Returns `F̄ = (1/V_e) Σ_i x_i (Σ_g T_gi)ᵀ`, `Σ_g V_g F_g / V_e` with the sums exchanged; the identity for a tet that
    /// holds nothing of the body.
    pub fn mean_gradient(&self, x: &[DVec3]) -> DMat3 {
        let Some(&first) = self.nodes.first() else { return DMat3::IDENTITY };
        let mut sum = DMat3::ZERO;
        for (&node, moments) in self.nodes.iter().zip(&self.moments_m2) {
            sum += outer(x[node as usize] - x[first as usize], moments.iter().sum());
        }
        sum * (1.0 / self.total_m3())
    }

    /// Returns `V_e` (m³).
    pub fn total_m3(&self) -> f64 {
        self.volume_m3.iter().sum()
    }

    /// Returns the elastic energy `U_e` (J).
    pub fn energy_j(&self, material: &Material, x: &[DVec3]) -> f64 {
        if self.nodes.is_empty() {
            return 0.0;
        }
        let (of_shape, of_volume) = material.shape_and_volume();
        let gradients = self.gradients(x, DMat3::IDENTITY);
        let shape: f64 =
            gradients.iter().zip(self.volume_m3).map(|(f, volume)| volume * of_shape.energy_density(f)).sum();
        shape + self.total_m3() * of_volume.energy_density(&self.mean(&gradients))
    }

    /// Adds forces (N) of elastic and viscous stress to `forces_n`; returns the power (W) that viscous stress takes.
    pub fn add_forces_n(&self, material: &Material, x: &[DVec3], v: &[DVec3], forces_n: &mut [DVec3]) -> f64 {
        if self.nodes.is_empty() {
            return 0.0;
        }
        let (of_shape, of_volume) = material.shape_and_volume();
        let gradients = self.gradients(x, DMat3::IDENTITY);
        let pressure = of_volume.piola(&self.mean(&gradients));
        let mut stresses = gradients.map(|f| of_shape.piola(&f) + pressure);
        let mut power_w = 0.0;
        if !material.viscosity.is_zero() {
            power_w = self.add_viscous_pa(material, &gradients, v, &mut stresses);
        }
        self.scatter(&stresses, forces_n);
        power_w
    }

    /// Adds viscous stress (Pa) to that of the parts; returns the power (W) that it takes.
    pub(super) fn add_viscous_pa(
        &self,
        material: &Material,
        gradients: &[DMat3; PARTS],
        v: &[DVec3],
        stresses: &mut [DMat3; PARTS],
    ) -> f64 {
        let rates = self.gradients(v, DMat3::ZERO);
        let mut power_w = 0.0;
        for part in 0..PARTS {
            let (f, rate) = (&gradients[part], &rates[part]);
            stresses[part] += viscous::piola(material.viscosity, f, rate);
            power_w += self.volume_m3[part] * viscous::power_density(material.viscosity, f, rate);
        }
        power_w
    }

    /// Adds `−K a` (N), the change of the elastic forces along `a` at positions `x`.
    pub fn add_products_n(&self, material: &Material, x: &[DVec3], a: &[DVec3], products_n: &mut [DVec3]) {
        if self.nodes.is_empty() {
            return;
        }
        let (of_shape, of_volume) = material.shape_and_volume();
        let (gradients, changes) = (self.gradients(x, DMat3::IDENTITY), self.gradients(a, DMat3::ZERO));
        let pressure = of_volume.piola_differential(&self.mean(&gradients), &self.mean(&changes));
        let stresses: [DMat3; PARTS] =
            std::array::from_fn(|part| of_shape.piola_differential(&gradients[part], &changes[part]) + pressure);
        self.scatter(&stresses, products_n);
    }

    /// Adds `−C v` (N), the forces of viscous stress at rest.
    pub(super) fn add_damping_products_n(&self, material: &Material, v: &[DVec3], products_n: &mut [DVec3]) {
        let mut stresses = [DMat3::ZERO; PARTS];
        self.add_viscous_pa(material, &[DMat3::IDENTITY; PARTS], v, &mut stresses);
        self.scatter(&stresses, products_n);
    }

    /// Adds the diagonal blocks (N/m) of the stiffness at rest.
    pub fn add_diagonal_n_per_m(&self, material: &Material, blocks: &mut [DMat3]) {
        let (of_shape, of_volume) = material.shape_and_volume();
        let Lame { lambda_pa, mu_pa } = of_shape.lame;
        for (&node, moments) in self.nodes.iter().zip(&self.moments_m2) {
            let block = &mut blocks[node as usize];
            let all: DVec3 = moments.iter().sum();
            *block += outer(all, all) * (of_volume.lame.lambda_pa / self.total_m3());
            for (t, volume) in moments.iter().zip(self.volume_m3).filter(|(_, volume)| *volume > 0.0) {
                let all_round = DMat3::from_diagonal(DVec3::splat(mu_pa * t.length_squared()));
                *block += (outer(*t, *t) * (lambda_pa + mu_pa) + all_round) * (1.0 / volume);
            }
        }
    }

    pub(super) fn scatter(&self, stresses: &[DMat3; PARTS], forces_n: &mut [DVec3]) {
        for (&node, moments) in self.nodes.iter().zip(&self.moments_m2) {
            for (stress, moment) in stresses.iter().zip(moments) {
                forces_n[node as usize] -= *stress * *moment;
            }
        }
    }
}
