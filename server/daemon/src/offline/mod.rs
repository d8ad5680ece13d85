//! Commands that run without a network: `simulate`, `static`, `check`, `fit-budget`, `schema`. They run the same scenes and the same
//! physics as `serve`; nothing in them is random, so equal scenes give equal results, bit for bit.
mod args;
pub mod calibrate;
pub mod check;
mod check_laws;
mod check_tools;
mod checkpoint;
mod cost;
pub mod equilibrium;
mod exit;
pub mod fit_budget;
mod folder;
mod frames;
mod interrupt;
mod load;
mod plan;
mod probe_rows;
mod say;
pub mod schema;
pub mod simulate;
mod summary;
mod walls;
mod whole_rows;
