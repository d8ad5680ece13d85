//! Constitutive laws: energy density `Ψ(F)` (Pa), first Piola-Kirchhoff stress `P = ∂Ψ/∂F` (Pa), and its differential
//! `δP = ∂P/∂F : δF`. One file per law; one harness (`tests/derivatives.rs`) checks energy → stress → stiffness of them all.
pub mod fixed_corotated;
pub mod neo_hookean;
pub mod parameters;
pub mod stvk;
pub mod viscous;

use glam::DMat3;
pub use parameters::{Lame, ParameterError, Viscosity};

/// Which law a material obeys.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Law {
    /// St. Venant-Kirchhoff: the papers' law; softens in compression and does not resist inversion.
    StVenantKirchhoff,
    /// Stable neo-Hookean (Smith, de Goes & Kim 2018): resists and recovers from inversion. The default.
    #[default]
    StableNeoHookean,
    /// Fixed corotated (Stomakhin et al. 2012): linear about the rotated rest state.
    FixedCorotated,
}

/// The papers' factors on elastic and viscous stress (MODEL §1.1): a seed convention halves or keeps what the formulas print.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Convention {
    /// Force is −∂U/∂x of the stated energy: factors 1 and 1.
    #[default]
    Consistent,
    /// Printed in 2006: strain with ½ and force with V/2, so the elastic factor is ½; its strain rate has no ½: viscous factor 1.
    Paper2006,
    /// Printed in 2005: strain without ½, force with V/2: both factors 1.
    Paper2005,
}

impl Convention {
    /// Factor on λ and µ.
    pub fn elastic_factor(self) -> f64 {
        match self {
            Self::Consistent | Self::Paper2005 => 1.0,
            Self::Paper2006 => 0.5,
        }
    }

    /// Factor on φ and ψ.
    pub fn viscous_factor(self) -> f64 {
        1.0
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
}

impl Material {
    /// A material with a convention's factors applied to its constants.
    pub fn new(law: Law, lame: Lame, viscosity: Viscosity, convention: Convention) -> Self {
        let (e, v) = (convention.elastic_factor(), convention.viscous_factor());
        Self {
            law,
            lame: Lame { lambda_pa: e * lame.lambda_pa, mu_pa: e * lame.mu_pa },
            viscosity: Viscosity { phi_pa_s: v * viscosity.phi_pa_s, psi_pa_s: v * viscosity.psi_pa_s },
        }
    }

    /// Energy density `Ψ(F)` (J/m³), zero at `F = I`.
    pub fn energy_density(&self, f: &DMat3) -> f64 {
        match self.law {
            Law::StVenantKirchhoff => stvk::energy_density(self.lame, f),
            Law::StableNeoHookean => neo_hookean::energy_density(self.lame, f),
            Law::FixedCorotated => fixed_corotated::energy_density(self.lame, f),
        }
    }

    /// First Piola-Kirchhoff stress `P = ∂Ψ/∂F` (Pa).
    pub fn piola(&self, f: &DMat3) -> DMat3 {
        match self.law {
            Law::StVenantKirchhoff => stvk::piola(self.lame, f),
            Law::StableNeoHookean => neo_hookean::piola(self.lame, f),
            Law::FixedCorotated => fixed_corotated::piola(self.lame, f),
        }
    }

    /// How much the P-wave modulus grows when no principal stretch exceeds `s ≥ 1`: the largest `n·(δP N)` for
    /// `δF = n Nᵀ`, unit `n` and `N`, over its rest value `λ + 2µ`.
    /// ```text
    /// St. Venant-Kirchhoff:  N·S N + (λ + 2µ) s²,  N·S N ≤ (3λ + 2µ)(s² − 1)/2     (equal stretch)
    /// stable neo-Hookean:    µ + (λ + µ)|cof F N|²,  |cof F N| ≤ s²                (J is linear along n Nᵀ)
    /// fixed corotated:       2µ + λ |cof F N|² at most
    /// ```
    /// The square of the largest natural frequency grows by about as much.
    pub fn stiffening(&self, stretch: f64) -> f64 {
        let (lambda, mu, s2) = (self.lame.lambda_pa.max(0.0), self.lame.mu_pa, stretch * stretch);
        let modulus = match self.law {
            Law::StVenantKirchhoff => (1.5 * lambda + mu) * (s2 - 1.0) + (lambda + 2.0 * mu) * s2,
            Law::StableNeoHookean => mu + (lambda + mu) * s2 * s2,
            Law::FixedCorotated => 2.0 * mu + lambda * s2 * s2,
        };
        modulus / (lambda + 2.0 * mu)
    }

    /// Differential `δP = ∂P/∂F : δF` (Pa).
    pub fn piola_differential(&self, f: &DMat3, df: &DMat3) -> DMat3 {
        match self.law {
            Law::StVenantKirchhoff => stvk::piola_differential(self.lame, f, df),
            Law::StableNeoHookean => neo_hookean::piola_differential(self.lame, f, df),
            Law::FixedCorotated => fixed_corotated::piola_differential(self.lame, f, df),
        }
    }
}
