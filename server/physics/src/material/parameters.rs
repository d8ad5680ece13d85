//! Elastic and viscous constants, checked where they enter.
use thiserror::Error;

/// Lamé's constants (Pa).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lame {
    /// First constant λ (Pa).
    pub lambda_pa: f64,
    /// Shear modulus µ (Pa).
    pub mu_pa: f64,
}

/// Why material constants were refused.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ParameterError {
    /// Young's modulus is not positive and finite.
    #[error("young_modulus_pa = {0}: must be finite and larger than 0")]
    YoungModulus(f64),
    /// Poisson's ratio outside the stable range.
    #[error(
        "poisson_ratio = {0}: must be larger than -1 and smaller than 0.5 (0.5 is incompressible: use 0.49 or 0.499)"
    )]
    PoissonRatio(f64),
    /// λ, µ do not give a positive definite law.
    #[error("lambda_pa = {lambda_pa}, mu_pa = {mu_pa}: needs mu > 0 and lambda > -2/3 mu, both finite")]
    Lame {
        /// λ (Pa).
        lambda_pa: f64,
        /// µ (Pa).
        mu_pa: f64,
    },
    /// Density is not positive and finite.
    #[error("density_kg_per_m3 = {0}: must be finite and larger than 0")]
    Density(f64),
    /// A viscosity is negative or not finite.
    #[error("{name} = {value}: must be finite and not negative")]
    Viscosity {
        /// Name of the constant.
        name: &'static str,
        /// Its value (Pa s).
        value: f64,
    },
}

impl Lame {
    /// `λ = Eν/((1+ν)(1−2ν))`, `µ = E/(2(1+ν))`.
    ///
    /// # Errors
    /// E ≤ 0, ν ≤ −1, ν ≥ ½, or not finite.
    pub fn from_young_poisson(young_modulus_pa: f64, poisson_ratio: f64) -> Result<Self, ParameterError> {
        if !(young_modulus_pa > 0.0 && young_modulus_pa.is_finite()) {
            return Err(ParameterError::YoungModulus(young_modulus_pa));
        }
        if !(poisson_ratio > -1.0 && poisson_ratio < 0.5) {
            return Err(ParameterError::PoissonRatio(poisson_ratio));
        }
        let (e, nu) = (young_modulus_pa, poisson_ratio);
        Ok(Self { lambda_pa: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), mu_pa: e / (2.0 * (1.0 + nu)) })
    }

    /// Takes λ and µ as they are.
    ///
    /// # Errors
    /// µ ≤ 0, λ ≤ −2µ/3, or not finite.
    pub fn new(lambda_pa: f64, mu_pa: f64) -> Result<Self, ParameterError> {
        let positive = mu_pa > 0.0 && lambda_pa > -2.0 / 3.0 * mu_pa;
        if positive && lambda_pa.is_finite() && mu_pa.is_finite() {
            Ok(Self { lambda_pa, mu_pa })
        } else {
            Err(ParameterError::Lame { lambda_pa, mu_pa })
        }
    }

    /// `E = µ(3λ+2µ)/(λ+µ)` (Pa).
    pub fn young_modulus_pa(self) -> f64 {
        self.mu_pa * (3.0 * self.lambda_pa + 2.0 * self.mu_pa) / (self.lambda_pa + self.mu_pa)
    }

    /// `ν = λ/(2(λ+µ))`.
    pub fn poisson_ratio(self) -> f64 {
        self.lambda_pa / (2.0 * (self.lambda_pa + self.mu_pa))
    }

    /// Returns constants whose Poisson's ratio is at most `ν'`, and which are as stiff beneath a tool: where `ν > ν'`,
    /// ```text
    /// µ' = µ (1 − ν')/(1 − ν),   λ' = 2µ'ν'/(1 − 2ν')
    /// ```
    /// keep `E/(1 − ν²) = 2µ/(1 − ν)`, by which a half-space resists indentation (Hertz 1882). In shear a body is then
    /// `(ν − ν')/(1 − ν)` stiffer, 2 % from 0.499 to 0.488, where waves of volume are 3.4 times as slow. Smaller ratios
    /// stay as they are.
    #[must_use]
    pub fn with_poisson_ratio_up_to(self, most: f64) -> Self {
        /// A ratio that was given as `most` may come back a little larger.
        const ROUNDING: f64 = 1e-9;
        let nu = self.poisson_ratio();
        if nu <= most + ROUNDING {
            return self;
        }
        let mu_pa = self.mu_pa * (1.0 - most) / (1.0 - nu);
        Self { lambda_pa: 2.0 * mu_pa * most / (1.0 - 2.0 * most), mu_pa }
    }

    /// P-wave modulus `λ + 2µ` (Pa); the wave speed is √(M/ρ).
    pub fn p_wave_modulus_pa(self) -> f64 {
        self.lambda_pa + 2.0 * self.mu_pa
    }
}

/// Viscosities of the papers' viscous stress `S_v = φ tr(Ė) I + 2ψ Ė` (Pa s).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Viscosity {
    /// Volumetric φ (Pa s).
    pub phi_pa_s: f64,
    /// Shear ψ (Pa s).
    pub psi_pa_s: f64,
}

impl Viscosity {
    /// Takes φ ≥ 0 and ψ ≥ 0.
    ///
    /// # Errors
    /// Negative or not finite.
    pub fn new(phi_pa_s: f64, psi_pa_s: f64) -> Result<Self, ParameterError> {
        for (name, value) in [("viscosity_phi_pa_s", phi_pa_s), ("viscosity_psi_pa_s", psi_pa_s)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(ParameterError::Viscosity { name, value });
            }
        }
        Ok(Self { phi_pa_s, psi_pa_s })
    }

    /// True when the viscous stress vanishes, so that it is skipped (exactly).
    pub fn is_zero(self) -> bool {
        self.phi_pa_s == 0.0 && self.psi_pa_s == 0.0
    }
}

/// Density (kg/m³), checked.
///
/// # Errors
/// Not positive, or not finite.
pub fn checked_density(density_kg_per_m3: f64) -> Result<f64, ParameterError> {
    if density_kg_per_m3 > 0.0 && density_kg_per_m3.is_finite() {
        Ok(density_kg_per_m3)
    } else {
        Err(ParameterError::Density(density_kg_per_m3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn young_and_poisson_survive_the_round_trip() {
        for (e, nu) in [(10e3, 0.45), (1.0, -0.3), (30e3, 0.0), (1e9, 0.4999)] {
            let lame = Lame::from_young_poisson(e, nu).unwrap();
            assert!((lame.young_modulus_pa() / e - 1.0).abs() < 1e-12);
            assert!((lame.poisson_ratio() - nu).abs() < 1e-12);
        }
    }

    #[test]
    fn impossible_constants_are_refused() {
        assert!(Lame::from_young_poisson(0.0, 0.3).is_err());
        assert!(Lame::from_young_poisson(1.0, 0.5).is_err());
        assert!(Lame::from_young_poisson(f64::NAN, 0.3).is_err());
        assert!(Lame::new(-1.0, 1.0).is_err());
        assert!(Viscosity::new(-1.0, 0.0).is_err());
        assert!(checked_density(-1.0).is_err());
    }

    #[test]
    fn a_smaller_poisson_ratio_leaves_the_stiffness_beneath_a_tool() {
        let hertz_pa = |lame: Lame| lame.young_modulus_pa() / (1.0 - lame.poisson_ratio().powi(2));
        for nu in [-0.3, 0.3, 0.45, 0.488, 0.49, 0.499, 0.4999] {
            let lame = Lame::from_young_poisson(10e3, nu).unwrap();
            let limited = lame.with_poisson_ratio_up_to(0.488);
            assert!((hertz_pa(limited) / hertz_pa(lame) - 1.0).abs() < 1e-12);
            if nu <= 0.488 {
                assert_eq!(limited, lame);
            } else {
                assert!((limited.poisson_ratio() - 0.488).abs() < 1e-12);
                assert!((limited.mu_pa / lame.mu_pa - 1.0 - (nu - 0.488) / (1.0 - nu)).abs() < 1e-12);
            }
            assert_eq!(lame.with_poisson_ratio_up_to(0.5), lame);
        }
    }
}
