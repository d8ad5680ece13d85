//! Commands that run without a network: `simulate`, `static`, `check`, `schema`.
pub mod check;
pub mod equilibrium;
pub mod schema;
pub mod simulate;
