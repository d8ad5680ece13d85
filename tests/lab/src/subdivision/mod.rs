//! `palpate-lab subdivision`: the experiment of haptic-subdivision, figures 5 to 11.
//!
//! - `experiment.rs`: what is computed
//! - `command.rs`: the command, `subdivision.csv`
//! - `page.rs`: `subdivision.html`
mod command;
mod experiment;
mod page;

pub use command::{Options, run};
pub use experiment::{Curve, Experiment, Figure, figures};
