//! A material's constants as its law reads them in lanes.
use super::{Lame, Material};
use crate::lanes::real::{Real, Scalar};

/// A material's constants in the kernel's precision.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Constants<T> {
    /// λ (Pa).
    pub(crate) lambda: T,
    /// µ (Pa).
    pub(crate) mu: T,
    /// φ (Pa s).
    pub(crate) phi: T,
    /// 2ψ (Pa s).
    pub(crate) two_psi: T,
    /// κ (Pa) of [`super::crushing_limit`].
    pub(crate) crushing: T,
}

impl<T: Scalar> Constants<T> {
    pub(crate) fn of(material: &Material) -> Self {
        Self {
            lambda: T::of(material.lame.lambda_pa),
            mu: T::of(material.lame.mu_pa),
            phi: T::of(material.viscosity.phi_pa_s),
            two_psi: T::of(2.0 * material.viscosity.psi_pa_s),
            crushing: T::of(material.crushing_pa),
        }
    }

    /// The same constants in every lane of `V`, or in f64; both are exact.
    #[inline(always)]
    pub(crate) fn converted<V: Real>(&self) -> Constants<V> {
        Constants {
            lambda: V::of(self.lambda.into()),
            mu: V::of(self.mu.into()),
            phi: V::of(self.phi.into()),
            two_psi: V::of(self.two_psi.into()),
            crushing: V::of(self.crushing.into()),
        }
    }

    /// λ and µ as they were rounded to the kernel's precision.
    pub(crate) fn lame(&self) -> Lame {
        Lame { lambda_pa: self.lambda.into(), mu_pa: self.mu.into() }
    }
}
