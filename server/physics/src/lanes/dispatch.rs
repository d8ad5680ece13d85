//! One body of code, compiled for several instruction sets, chosen at run time.
#![allow(unsafe_code)] // calls into functions compiled for an instruction set that was detected
use super::real::{Scalar, Vector};

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

/// A computation that is written once for all vectors.
pub(crate) trait Pass {
    /// The precision it computes in.
    type Scalar: Scalar;
    /// What it finds.
    type Found;
    /// Computes in vectors `V`. Implementations are `#[inline(always)]`: a vector type is only fast where it is inlined
    /// into a function compiled for its instruction set.
    fn run<V: Vector<Scalar = Self::Scalar>>(self) -> Self::Found;
}

/// Runs a pass that was compiled for an instruction set.
pub(crate) fn run<P: Pass>(set: Available, pass: P) -> P::Found {
    match set.0 {
        // SAFETY: `Available` holds only what was detected.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx2 => unsafe { run_avx2(pass) },
        // SAFETY: `Available` holds only what was detected.
        #[cfg(target_arch = "x86_64")]
        InstructionSet::Avx512 => unsafe { run_avx512(pass) },
        _ => pass.run::<<P::Scalar as Scalar>::Baseline>(),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_avx2<P: Pass>(pass: P) -> P::Found {
    pass.run::<<P::Scalar as Scalar>::Avx2>()
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn run_avx512<P: Pass>(pass: P) -> P::Found {
    pass.run::<<P::Scalar as Scalar>::Avx512>()
}
