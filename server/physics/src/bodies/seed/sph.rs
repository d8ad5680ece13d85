//! The particles' internal force: raw SPH on the awake particles of a region (2006, section 3.2).
//!
//! The strain (eqs. 1, 5) follows from displacements `d = x − u`, as eq. 1 has it:
//! ```text
//! F_i = I + Σ_j (d_j − d_i) ⊗ b_ij        b_ij = ∇_i W(u_i − u_j) ΔV_j
//! ```
//! Eq. 25 differentiated is `Σ_j d_j ⊗ b_ij`. The term `d_i` is added here (`Σ_j b_ij = 0` within the layer, but not at
//! its boundaries), because otherwise a layer that moves as a whole would be strained. With positions, as eq. 4 reads,
//! the body at rest would have `F = A_i = Σ_j (u_j − u_i) ⊗ b_ij`, which is not I ([`moment`]): it would burst at rest.
//! With displacements the rest state has no strain, but any uniform deformation G is seen as `I + (G − I) A_i`, and a
//! rotation as strain.
//!
//! The stress (eqs. 9, 11) is `σ = λ tr(E) I + 2µE + φ tr(ν) I + 2ψν`, with `ν = 2Ė` (eq. 10) and the constants of
//! [`super::SeedParameters::layer_factor`].
//!
//! The force (eq. 29) has σ without F, and is added: `∇W` at i points from i to j, so that a layer under tension pulls
//! i towards j.
//! ```text
//! f_i = ΔV_i Σ_j (σ_i + σ_j) b_ij        as printed: ΔV_i Σ_j σ_j b_ij
//! ```
//! Eq. 13 of 2005 is the printed force with the gradient at j, and with the other sign. With `σ_j` alone
//! ([`PairStress::Neighbour`]) the forces between two particles are not opposite: momentum is lost at the interface,
//! the stiffness is not symmetric, and a layer at rest flutters: any small motion grows, at any step. The term `σ_i`
//! ([`PairStress::Both`]) changes nothing within, where `Σ_j b_ij = 0`; with it the force is, at small strain, `−∂U/∂x`
//! of `U = ΔV Σ_i ½ E_i:σ_i`, because `b_ji = −b_ij`. Neighbours are awake particles; sleeping ones do not count. Rest
//! positions never change, so neither do neighbours and weights. The papers' "connectivity must be determined for each
//! time step" does not apply to eq. 25, which has rest positions in W.
use super::{PairStress, SeedParameters, kernel::Stencil, region::Region, voxels::NONE};
use crate::{
    linalg::tensor::outer,
    material::{
        Lame, Viscosity,
        stvk::green_strain,
        viscous::{second_piola, strain_rate},
    },
};
use glam::{DMat3, DVec3};

/// Constants of the layer, with the papers' factors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LayerStress {
    lame: Lame,
    viscosity: Viscosity,
}

impl LayerStress {
    /// Returns the layer's constants of given parameters.
    pub fn new(parameters: &SeedParameters) -> Self {
        let SeedParameters { lame, viscosity, convention, .. } = *parameters;
        let elastic = parameters.layer_factor() * convention.elastic_factor();
        let viscous = parameters.layer_factor();
        Self {
            lame: Lame { lambda_pa: elastic * lame.lambda_pa, mu_pa: elastic * lame.mu_pa },
            viscosity: Viscosity { phi_pa_s: viscous * viscosity.phi_pa_s, psi_pa_s: viscous * viscosity.psi_pa_s },
        }
    }

    /// Returns λ and µ (Pa) with the factors.
    pub fn lame(&self) -> Lame {
        self.lame
    }

    /// Returns `σ = λ tr(E) I + 2µE + φ tr(Ė) I + 2ψĖ` (Pa).
    pub fn stress_pa(&self, f: &DMat3, f_dot: &DMat3) -> DMat3 {
        // The elastic stress has the viscous one's form, with λ, µ and E in the place of φ, ψ and Ė.
        let as_elastic = Viscosity { phi_pa_s: self.lame.lambda_pa, psi_pa_s: self.lame.mu_pa };
        let elastic = second_piola(as_elastic, &green_strain(f));
        if self.viscosity.is_zero() {
            return elastic;
        }
        elastic + second_piola(self.viscosity, &strain_rate(f, f_dot))
    }
}

/// Returns `Σ_j (a_j − a_i) ⊗ b_ij` over the awake neighbours of a slot's particle.
pub fn gradient_of(region: &Region, stencil: &Stencil, a: &[DVec3], slot: usize) -> DMat3 {
    let mut sum = DMat3::ZERO;
    let here = a[slot];
    for (neighbour, b) in neighbours(region, stencil, slot) {
        sum += outer(a[neighbour] - here, b);
    }
    sum
}

/// Returns `A_i = Σ_j (u_j − u_i) ⊗ b_ij`, which is what the sum makes of the identity; it should be I.
pub fn moment(region: &Region, stencil: &Stencil, slot: usize) -> DMat3 {
    let here = region.rest_m(slot);
    neighbours(region, stencil, slot).map(|(j, b)| outer(region.rest_m(j) - here, b)).fold(DMat3::ZERO, |a, b| a + b)
}

/// Computes the stress (Pa) of every slot's particle from displacements (m) and velocities `v` (m/s).
pub fn stresses_pa(
    region: &Region,
    stencil: &Stencil,
    law: &LayerStress,
    displacements_m: &[DVec3],
    v: &[DVec3],
    stresses_pa: &mut [DMat3],
) {
    for (slot, stress) in stresses_pa.iter_mut().enumerate().take(region.len()) {
        let f = DMat3::IDENTITY + gradient_of(region, stencil, displacements_m, slot);
        let f_dot = gradient_of(region, stencil, v, slot);
        *stress = law.stress_pa(&f, &f_dot);
    }
}

/// Computes the force (N) on every slot's particle, of the volume ΔV (m³), by eq. 29.
pub fn forces_n(
    region: &Region,
    stencil: &Stencil,
    volume_m3: f64,
    pair_stress: PairStress,
    stresses_pa: &[DMat3],
    forces_n: &mut [DVec3],
) {
    for (slot, force) in forces_n.iter_mut().enumerate().take(region.len()) {
        let mut sum = DVec3::ZERO;
        for (neighbour, b) in neighbours(region, stencil, slot) {
            sum += match pair_stress {
                PairStress::Neighbour => stresses_pa[neighbour] * b,
                PairStress::Both => (stresses_pa[slot] + stresses_pa[neighbour]) * b,
            };
        }
        *force = sum * volume_m3;
    }
}

/// Returns the slots of the awake neighbours and the gradients `b` (1/m) towards them.
fn neighbours<'a>(region: &'a Region, stencil: &'a Stencil, slot: usize) -> impl Iterator<Item = (usize, DVec3)> + 'a {
    // The box reaches as far as the stencil does: no step leaves it.
    let voxel = region.voxel_of[slot] as i32;
    region.steps.iter().zip(&stencil.gradients_per_m).filter_map(move |(step, b)| {
        let neighbour = region.slot_at[(voxel + step) as usize];
        (neighbour != NONE).then_some((neighbour as usize, *b))
    })
}
