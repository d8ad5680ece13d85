//! Constitutive laws: energy density `Ψ(F)` (Pa), first Piola-Kirchhoff stress `P = ∂Ψ/∂F` (Pa), and its differential
//! `δP = ∂P/∂F : δF`.
//!
//! A law is one file and one line of the registry below (docs/how-to/add-a-law.md). One harness
//! (`tests/derivatives.rs`) checks energy → stress → stiffness of all of them, another (`tests/kernel.rs`) their lanes
//! against f64.
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
pub(crate) mod constants;
pub(crate) mod crushing_limit;
pub mod fixed_corotated;
pub(crate) mod lane_matrix;
pub(crate) mod lane_strain;
pub(crate) mod law;
pub mod parameters;
pub(crate) mod passes;
mod registry;
pub mod stable_neo_hookean;
mod stretch_limit;
pub mod stvk;
pub mod viscous;

use crate::lanes::Available;
use glam::DMat3;
pub(crate) use law::ConstitutiveLaw;
pub use parameters::{Lame, ParameterError, Viscosity};
pub(crate) use passes::LawPass;

registry::laws! {
    stvk::StVenantKirchhoff,
    #[default]
    stable_neo_hookean::StableNeoHookean,
    fixed_corotated::FixedCorotated,
}

impl Law {
    /// The name that a scene file gives the law.
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The law of a name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|law| law.name() == name)
    }
}

/// The papers' factors on elastic and viscous stress (MODEL §1.1): a seed convention halves or keeps what the formulas
/// print.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Convention {
    /// Force is −∂U/∂x of the stated energy: factors 1 and 1.
    #[default]
    Consistent,
    /// Printed in 2006: strain with ½ and force with V/2, so the elastic factor is ½; its strain rate has no ½: viscous
    /// factor 1.
    Paper2006,
    /// Printed in 2005: strain without ½, force with V/2: both factors 1.
    Paper2005,
}

impl Convention {
    /// Factor on λ and µ; that on φ and ψ is 1 in all of them.
    pub fn elastic_factor(self) -> f64 {
        match self {
            Self::Consistent | Self::Paper2005 => 1.0,
            Self::Paper2006 => 0.5,
        }
    }
}

/// A law with its constants; the conventions' factors are already in them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// The law.
    pub law: Law,
    /// Lamé's constants of small strain (Pa).
    pub lame: Lame,
    /// Viscosities (Pa s).
    pub viscosity: Viscosity,
    /// Modulus κ (Pa) of resistance to being crushed ([`crushing_limit`]), 0 where there is none: tets of a smoothed body
    /// have it.
    pub crushing_pa: f64,
}

impl Material {
    /// A material with a convention's factors applied to its constants.
    pub fn new(law: Law, lame: Lame, viscosity: Viscosity, convention: Convention) -> Self {
        let factor = convention.elastic_factor();
        Self {
            law,
            lame: Lame { lambda_pa: factor * lame.lambda_pa, mu_pa: factor * lame.mu_pa },
            viscosity,
            crushing_pa: 0.0,
        }
    }

    /// Energy density `Ψ(F)` (J/m³), zero at `F = I`.
    pub fn energy_density(&self, f: &DMat3) -> f64 {
        self.law.energy_density(self.lame, f) + crushing_limit::energy_density(self.crushing_pa, f)
    }

    /// Returns whether the law stores less where the body is pressed to a point (`F = 0`) than at rest: such a body collapses. The
    /// stable neo-Hookean law does with a negative λ, as `Ψ(0) = ½λ`.
    pub fn prefers_collapse(&self) -> bool {
        self.law.energy_density(self.lame, &DMat3::ZERO) < 0.0
    }

    /// First Piola-Kirchhoff stress `P = ∂Ψ/∂F` (Pa).
    pub fn piola(&self, f: &DMat3) -> DMat3 {
        self.law.piola(self.lame, f) + crushing_limit::piola(self.crushing_pa, f)
    }

    /// Differential `δP = ∂P/∂F : δF` (Pa).
    pub fn piola_differential(&self, f: &DMat3, df: &DMat3) -> DMat3 {
        self.law.piola_differential(self.lame, f, df) + crushing_limit::piola_differential(self.crushing_pa, f, df)
    }

    /// How much the P-wave modulus grows when no principal stretch exceeds `s ≥ 1`: the largest `n·(δP N)` for
    /// `δF = n Nᵀ`, unit `n` and `N`, over its rest value `λ + 2µ`. The square of the largest natural frequency grows
    /// by about as much.
    pub fn stiffening(&self, stretch: f64) -> f64 {
        let lame = Lame { lambda_pa: self.lame.lambda_pa.max(0.0), ..self.lame };
        self.law.stretched_modulus_pa(lame, stretch * stretch) / lame.p_wave_modulus_pa()
    }

    /// Returns a material that at rest answers strain as this one's viscosity answers its rate: λ = φ, µ = ψ.
    pub(crate) fn viscosity_as_stiffness(&self) -> Self {
        let Viscosity { phi_pa_s, psi_pa_s } = self.viscosity;
        Self {
            law: Law::StVenantKirchhoff,
            lame: Lame { lambda_pa: phi_pa_s, mu_pa: psi_pa_s },
            viscosity: Viscosity::default(),
            crushing_pa: 0.0,
        }
    }

    /// Returns the material of shape alone, `(λ⁻, µ)` with `λ⁻ = min(λ, 0)`, and that of volume alone, `(λ − λ⁻, 0)`. Every
    /// law's energy is linear in λ and µ, so theirs sum to this one's.
    pub(crate) fn shape_and_volume(&self) -> (Self, Self) {
        let Lame { lambda_pa, mu_pa } = self.lame;
        let of_shape = lambda_pa.min(0.0);
        (
            Self { lame: Lame { lambda_pa: of_shape, mu_pa }, ..*self },
            Self { lame: Lame { lambda_pa: lambda_pa - of_shape, mu_pa: 0.0 }, ..*self },
        )
    }

    /// Runs a pass that was compiled for this material's law and the instruction set; viscous terms are computed if the
    /// material has any, or if `every_viscosity` asks for them.
    pub(crate) fn run<P: LawPass>(&self, set: Available, every_viscosity: bool, pass: &mut P) -> f64 {
        self.law.run(set, every_viscosity || !self.viscosity.is_zero(), pass)
    }
}
