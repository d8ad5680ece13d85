//! One body of code, compiled for several instruction sets, chosen at run time.
#![allow(unsafe_code)] // calls into functions compiled for an instruction set that was detected
use super::real::{Scalar, Vector};
use crate::kernels::{
    laws::{FixedCorotated, StVenantKirchhoff, StableNeoHookean},
    tangents::LaneTangent,
};
use crate::material::Law;

/// Instruction sets a kernel is compiled for. All of them give the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum InstructionSet {
    /// What every machine of the target has: SSE2 on x86-64; elsewhere what the compiler makes of plain loops.
    Baseline,
    /// AVX2 (x86-64-v3).
    Avx2,
    /// AVX-512 F, BW, DQ and VL (x86-64-v4).
    Avx512,
}

/// An instruction set that this machine was seen to have.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Available(InstructionSet);

impl Available {
    /// The best of this machine.
    pub(crate) fn best() -> Self {
        Self(InstructionSet::best())
    }

    /// The wanted one, or the best there is below it.
    pub(crate) fn at_most(wanted: InstructionSet) -> Self {
        Self(wanted.min(InstructionSet::best()))
    }
}

impl InstructionSet {
    /// The best of this machine.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            use std::arch::is_x86_feature_detected as has;
            if has!("avx512f") && has!("avx512bw") && has!("avx512dq") && has!("avx512vl") {
                return Self::Avx512;
            }
            if has!("avx2") {
                return Self::Avx2;
            }
        }
        Self::Baseline
    }

    /// All that this machine has, the narrowest first.
    pub fn available() -> Vec<Self> {
        [Self::Baseline, Self::Avx2, Self::Avx512].into_iter().filter(|&set| set <= Self::best()).collect()
    }
}

/// A pass over lists, written once for all vectors.
pub(crate) trait Sweep {
    type Found;
    /// Computed in vectors `V`.
    fn run<V: Vector<Scalar = f64>>(self) -> Self::Found;
}

pub(crate) fn sweep<S: Sweep>(set: Available, sweep: S) -> S::Found {
    match set.0 {
        // SAFETY: `Available` holds only what was detected.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => unsafe { sweep_avx2(sweep) },
        // SAFETY: `Available` holds only what was detected.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => unsafe { sweep_avx512(sweep) },
        _ => sweep.run::<<f64 as Scalar>::Baseline>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn sweep_avx2<S: Sweep>(sweep: S) -> S::Found {
    sweep.run::<<f64 as Scalar>::Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn sweep_avx512<S: Sweep>(sweep: S) -> S::Found {
    sweep.run::<<f64 as Scalar>::Avx512>()
}

/// A pass over blocks, written once for all vectors and laws.
pub(crate) trait Pass<T: Scalar> {
    /// Adds what the blocks give, computed in vectors `V`; returns the viscous power (W) if forces are what it adds.
    fn run<V: Vector<Scalar = T>, L: LaneTangent, const VISCOUS: bool>(&mut self) -> f64;
}

/// Runs a pass with a law, with or without viscous terms.
pub(crate) fn run<P: Pass<T>, T: Scalar>(set: Available, (law, with_viscosity): (Law, bool), pass: &mut P) -> f64 {
    match (law, with_viscosity) {
        (Law::StVenantKirchhoff, false) => pick::<P, T, StVenantKirchhoff, false>(set, pass),
        (Law::StVenantKirchhoff, true) => pick::<P, T, StVenantKirchhoff, true>(set, pass),
        (Law::StableNeoHookean, false) => pick::<P, T, StableNeoHookean, false>(set, pass),
        (Law::StableNeoHookean, true) => pick::<P, T, StableNeoHookean, true>(set, pass),
        (Law::FixedCorotated, false) => pick::<P, T, FixedCorotated, false>(set, pass),
        (Law::FixedCorotated, true) => pick::<P, T, FixedCorotated, true>(set, pass),
    }
}

#[cfg(target_arch = "x86_64")]
fn pick<P: Pass<T>, T: Scalar, L: LaneTangent, const VISCOUS: bool>(set: Available, pass: &mut P) -> f64 {
    match set.0 {
        InstructionSet::Baseline => pass.run::<T::Baseline, L, VISCOUS>(),
        // SAFETY: `Available` holds only what was detected.
        InstructionSet::Avx2 => unsafe { avx2::<P, T, L, VISCOUS>(pass) },
        // SAFETY: `Available` holds only what was detected.
        InstructionSet::Avx512 => unsafe { avx512::<P, T, L, VISCOUS>(pass) },
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn pick<P: Pass<T>, T: Scalar, L: LaneTangent, const VISCOUS: bool>(_: Available, pass: &mut P) -> f64 {
    pass.run::<T::Baseline, L, VISCOUS>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn avx2<P: Pass<T>, T: Scalar, L: LaneTangent, const VISCOUS: bool>(pass: &mut P) -> f64 {
    pass.run::<T::Avx2, L, VISCOUS>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn avx512<P: Pass<T>, T: Scalar, L: LaneTangent, const VISCOUS: bool>(pass: &mut P) -> f64 {
    pass.run::<T::Avx512, L, VISCOUS>()
}
