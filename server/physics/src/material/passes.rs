//! Passes over lists of elements, each compiled for every law, with and without viscous terms, and every instruction
//! set.
use super::ConstitutiveLaw;
use crate::lanes::{
    Available,
    dispatch::{self, Pass},
    real::{Scalar, Vector},
};
use std::marker::PhantomData;

/// A pass over elements of one material, written once for all vectors and laws.
pub(crate) trait LawPass {
    /// The precision it computes in.
    type Scalar: Scalar;
    /// Adds what the elements give, computed in vectors `V`, and returns the power (W) that viscous stress takes, if
    /// forces are what it adds.
    fn run<V: Vector<Scalar = Self::Scalar>, L: ConstitutiveLaw, const VISCOUS: bool>(&mut self) -> f64;
}

/// Runs a pass with a law.
pub(super) fn run<L: ConstitutiveLaw, P: LawPass>(set: Available, viscous: bool, pass: &mut P) -> f64 {
    if viscous {
        dispatch::run(set, WithLaw::<P, L, true>(pass, PhantomData))
    } else {
        dispatch::run(set, WithLaw::<P, L, false>(pass, PhantomData))
    }
}

/// A pass whose law was chosen.
struct WithLaw<'a, P, L, const VISCOUS: bool>(&'a mut P, PhantomData<L>);

impl<P: LawPass, L: ConstitutiveLaw, const VISCOUS: bool> Pass for WithLaw<'_, P, L, VISCOUS> {
    type Scalar = P::Scalar;
    type Found = f64;

    #[inline(always)]
    fn run<V: Vector<Scalar = P::Scalar>>(self) -> f64 {
        self.0.run::<V, L, VISCOUS>()
    }
}
