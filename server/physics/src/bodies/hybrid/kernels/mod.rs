//! Kernels of a hybrid body's substeps, in blocks of lanes, beside scalar oracles.
// A vector type is only fast where it is inlined into a function compiled for its instruction set.
#![allow(clippy::inline_always)]
mod cell_stress;
mod cells;
mod prestrains;
mod residual_elements;
mod row_lanes;
mod rows;

pub use cells::CutCells;
pub use prestrains::Found;
pub use residual_elements::ResidualKernel;
pub use rows::{CellRow, Room, RowKernel};
