//! The number of substeps that a tick needs.
use super::{EnvironmentError, error::AskedBy};
use crate::{
    material::Material,
    settings::{MAX_SUBSTEPS, Settings, Substeps},
};

/// Fraction of its stable step that a hybrid body's coarse level takes, which is less than that at which ticks are
/// judged unstable (`integrate::stability`).
const LONG_STEP_FRACTION: f64 = 0.85;

/// Number of substeps that stiffer contact needs, over those of the tick, up to which the step's safety is enough.
const WITHIN_SAFETY: f64 = 1.05;

/// Returns the factor by which the square of a frequency grows at the allowed stretch, the largest one of the laws
/// ([`Material::stiffening`]).
pub(crate) fn stiffening(settings: &Settings, materials: &[Material]) -> f64 {
    materials.iter().map(|material| material.stiffening(settings.stretch_allowance)).fold(1.0, f64::max)
}

/// How much stiffer contact was in a tick than the substeps are made for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct StifferContact {
    /// Largest factor φ by which a tool's foundation was stiffer than at rest.
    pub(crate) times: f64,
    /// Largest addition a (rad²/s²) of walls that meet to the squared frequency at a node.
    pub(crate) walls_sq: f64,
}

/// Largest frequencies (rad/s) and the largest rate of damping (1/s) of a body at rest, or stretched.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Frequencies {
    /// Where nothing touches it.
    pub(crate) alone: f64,
    /// Touched everywhere, tools on their couplings included.
    pub(crate) touched: f64,
    /// `λ_max(M^{-½} C M^{-½})`, with the damping matrix C of viscous stress; 0 where nothing is viscous.
    pub(crate) damping_per_s: f64,
}

/// Returns the factor by which the largest rate of damping grows at the allowed stretch s, `s²`.
///
/// Viscous stress takes the power `∫ φ tr²Ė + 2ψ|Ė|² dV`, `Ė = sym(Fᵀ ∇v)`. Where `F` is the same all over, that is the
/// power at rest of the velocities `Fᵀ v`, which are s times as large at most.
pub(crate) fn damping_growth(settings: &Settings) -> f64 {
    settings.stretch_allowance.powi(2)
}

/// The substeps of a tick.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Steps {
    /// Number of substeps per tick.
    pub(crate) substeps: u32,
    /// Number of substeps in a long step of a coarse level; 1 where there is none.
    pub(crate) substeps_per_long_step: u32,
    /// Number of substeps that would be enough, before it was rounded up; no more than `substeps`.
    pub(crate) enough: f64,
    /// Part of the square of the largest frequency that grows as a tool's foundation does, from 0 to 1.
    pub(crate) grows_with_contact: f64,
    /// Square (rad²/s²) of the largest frequency that they are enough for.
    pub(crate) frequency_sq: f64,
    /// How many times as many there are as without viscosity; 1 where their number is fixed.
    pub(crate) for_viscosity: f64,
}

impl Steps {
    /// Returns the substeps with which leapfrog is stable, whose viscous forces are those of velocities half a step ago:
    /// `dt = safety · (2/ω)(√(1 + ξ²) − ξ)`, `ξ = c/2ω`.
    ///
    /// Here ω is the largest frequency of the body stretched by s and touched everywhere,
    /// `ω² = λ_max(M^{-½} (χK + K_contact) M^{-½})` with the laws' stiffening χ, and `c = s² λ_max(M^{-½} C M^{-½})`.
    /// A motion `zⁿ a` is one of leapfrog if `((z − 1)² M + (z − 1) dt C + z dt² K) a = 0`. Its product with `ā` is a
    /// quadratic equation with the real numbers m, c, k of `ā·Ma`, `ā·Ca` and `ā·Ka`, and its roots are `|z| ≤ 1` as long as
    /// `dt² k + 2 dt c ≤ 4 m`. So all motions are stable where `dt² K + 2 dt C ≤ 4 M`, for which
    /// `dt² ω² + 2 dt c ≤ 4` is enough: the step above, without the safety, is where both sides are the same.
    ///
    /// # Errors
    /// The body needs more than [`MAX_SUBSTEPS`].
    pub(crate) fn choose(
        settings: &Settings,
        Frequencies { alone, touched: omega, damping_per_s }: Frequencies,
    ) -> Result<Self, EnvironmentError> {
        let wanted = wanted(settings, omega, damping_per_s);
        let for_viscosity = wanted.max(1.0) / wanted_without_viscosity(settings, omega).max(1.0);
        let all_short = |substeps: u32| Self {
            substeps,
            substeps_per_long_step: 1,
            enough: wanted.min(f64::from(substeps)),
            grows_with_contact: 0.5 * (1.0 - (alone / omega).powi(2)).clamp(0.0, 1.0),
            frequency_sq: omega * omega,
            for_viscosity,
        };
        if let Substeps::Fixed(substeps) = settings.substeps {
            return Ok(Self { for_viscosity: 1.0, ..all_short(substeps) });
        }
        let substeps = wanted.ceil().max(1.0);
        if substeps <= f64::from(MAX_SUBSTEPS) {
            Ok(all_short(substeps as u32))
        } else {
            let most = f64::from(MAX_SUBSTEPS);
            let asked_by = if self::wanted(settings, alone, damping_per_s) <= most {
                AskedBy::Tools
            } else if wanted_without_viscosity(settings, alone) <= most {
                AskedBy::Viscosity
            } else {
                AskedBy::Body
            };
            Err(EnvironmentError::TooStiff { asked_by, substeps, omega_rad_per_s: omega, limit: MAX_SUBSTEPS })
        }
    }

    /// Returns the number of substeps that contact needs, `n √(1 + (φ − 1) g + a/ω²)`: with a foundation φ times as
    /// stiff as at rest, the part g of the squared frequency `ω²` that grows as it does, and what walls that meet add, a.
    ///
    /// That part is half of what is contact's, which comes from the sums of the rows of contact's stiffness. In the modes of
    /// the largest frequency, neighbours move against each other and the samples between them hardly, so that contact adds
    /// a quarter of these sums or less there (`docs/measurements/deep-press.md`). Of a body with particles it is all
    /// ([`Self::with_fine_level`]).
    pub(crate) fn with_stiffer_contact(self, stiffer: StifferContact) -> u32 {
        let needed = self.needed_by_contact(stiffer) / WITHIN_SAFETY;
        (needed.ceil() as u32).max(self.substeps).next_multiple_of(self.substeps_per_long_step)
    }

    /// Returns the same before it is rounded up.
    pub(crate) fn needed_by_contact(self, StifferContact { times, walls_sq }: StifferContact) -> f64 {
        let of_walls = if walls_sq > 0.0 { walls_sq / self.frequency_sq.max(f64::MIN_POSITIVE) } else { 0.0 };
        self.enough * (1.0 + (times - 1.0).max(0.0) * self.grows_with_contact + of_walls).sqrt()
    }

    /// Returns the same substeps for a body whose largest frequency is that of particles beside the contact. A foundation
    /// stiffens where the skin is stretched, and the cells below are stretched alike, far beyond
    /// [`Settings::stretch_allowance`] where a tool is deep: they stiffen as much (`docs/adr/deep-press.md`).
    #[must_use]
    pub(crate) fn with_fine_level(self) -> Self {
        Self { grows_with_contact: 1.0, ..self }
    }

    /// Returns the same substeps for a body whose coarse level may take longer steps; `omega` (rad/s) is the largest
    /// frequency of that level when it is stretched, `damping_per_s` its largest rate of damping.
    #[must_use]
    pub(crate) fn with_long_steps(self, settings: &Settings, omega: f64, damping_per_s: f64) -> Self {
        let least = (wanted(settings, omega, damping_per_s) / LONG_STEP_FRACTION).ceil().max(1.0);
        if !settings.long_coarse_steps || least >= f64::from(self.substeps) {
            return self;
        }
        let least = least as u32;
        match settings.substeps {
            Substeps::Measured => {
                let every = self.substeps.div_ceil(least);
                Self { substeps: every * least, substeps_per_long_step: every, ..self }
            }
            Substeps::Fixed(substeps) => {
                let long_steps = (least..=substeps).find(|long_steps| substeps.is_multiple_of(*long_steps));
                Self { substeps, substeps_per_long_step: substeps / long_steps.unwrap_or(substeps), ..self }
            }
        }
    }
}

/// Returns how many substeps are enough where nothing is viscous.
fn wanted_without_viscosity(settings: &Settings, omega: f64) -> f64 {
    settings.tick_period_s * omega / (2.0 * settings.step_safety)
}

/// Returns how many substeps are enough: `(ω/2)(√(1 + ξ²) + ξ)` to a second, over the safety; `ξ = c/2ω`.
fn wanted(settings: &Settings, omega: f64, damping_per_s: f64) -> f64 {
    // 1/(√(1 + ξ²) − ξ) = √(1 + ξ²) + ξ
    let per_s = 0.5 * ((omega * omega + 0.25 * damping_per_s * damping_per_s).sqrt() + 0.5 * damping_per_s);
    settings.tick_period_s * per_s / settings.step_safety
}

/// Returns the largest ratio of viscosity to stiffness (s) over P-waves, shear and bulk.
pub(crate) fn relaxation_time_s(material: &Material) -> f64 {
    let (lame, viscosity) = (material.lame, material.viscosity);
    let ratio = |lambdas: f64, mus: f64| {
        (lambdas * viscosity.phi_pa_s + mus * viscosity.psi_pa_s) / (lambdas * lame.lambda_pa + mus * lame.mu_pa)
    };
    ratio(1.0, 2.0).max(ratio(0.0, 1.0)).max(ratio(1.0, 2.0 / 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the largest modulus of a factor `z` by which a motion with frequency ω and damping c changes in a step:
    /// `z² − (2 − dt²ω² − dt c) z + 1 − dt c = 0`.
    fn largest_factor(omega: f64, damping_per_s: f64, dt_s: f64) -> f64 {
        let product = 1.0 - dt_s * damping_per_s;
        let half_sum = 0.5 * (1.0 + product - (dt_s * omega).powi(2));
        let square = half_sum * half_sum - product;
        if square < 0.0 { product.sqrt() } else { half_sum.abs() + square.sqrt() }
    }

    #[test]
    fn the_longest_step_is_at_the_edge_of_stability() {
        let settings = Settings { step_safety: 1.0, ..Settings::default() };
        for omega in [1.0, 300.0, 5e4] {
            for xi in [0.0, 0.02, 0.5, 3.0, 100.0] {
                let damping_per_s = 2.0 * omega * xi;
                let dt_s = settings.tick_period_s / wanted(&settings, omega, damping_per_s);
                let [below, above] = [0.999, 1.001].map(|part| largest_factor(omega, damping_per_s, part * dt_s));
                assert!(below <= 1.0 && above > 1.0, "{omega}, {xi}: {below} {above}");
            }
        }
    }

    #[test]
    fn a_body_without_stiffness_or_viscosity_needs_no_step() {
        let settings = Settings::default();
        assert_eq!(wanted(&settings, 0.0, 0.0), 0.0);
        let damped = wanted(&settings, 0.0, 1e3);
        assert!((damped - 0.5 / settings.step_safety).abs() < 1e-12, "{damped}");
    }
}
