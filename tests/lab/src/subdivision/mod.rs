//! `palpate-lab subdivision`: the experiment of haptic-subdivision, figures 5 to 12, and sheets in the loop against one
//! that is fine everywhere.
//!
//! - `experiment.rs`: figures 5 to 11
//! - `dome.rs`: figure 12
//! - `contact.rs`: coarse and refined sheets beneath tools
//! - `command.rs`: the command, `subdivision.csv` and `subdivision-contact.csv`
//! - `page.rs`: `subdivision.html`
mod command;
mod contact;
mod dome;
mod experiment;
mod page;

pub use command::{Options, run};
pub use contact::{ContactError, Run, TOUCHES, Touch, compare};
pub use dome::{Dome, DomeError, domes};
pub use experiment::{Curve, Experiment, Figure, figures};
