//! Vectors of numbers, the instruction sets that work on them, and operations on whole lists: one of the three places
//! of Palpate with `unsafe`.
//!
//! All of it gives the same bits on every instruction set.
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
pub(crate) mod blocks;
pub(crate) mod dense;
pub(crate) mod dispatch;
pub(crate) mod grid;
pub(crate) mod kicks;
pub(crate) mod nodes;
pub(crate) mod real;
pub(crate) mod step_forces;
pub(crate) mod vector_operations;
#[cfg(target_arch = "x86_64")]
pub(crate) mod x86;

pub(crate) use dispatch::Available;
pub use dispatch::InstructionSet;
pub(crate) use step_forces::StepForces;

/// Lanes of a block: a block is one or more whole vectors on every instruction set.
pub(crate) const LANES_F32: usize = 16;
pub(crate) const LANES_F64: usize = 8;
