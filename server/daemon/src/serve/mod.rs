//! `palpated serve`: the haptic loop, and its doors to arms and viewers.
pub mod args;
pub mod config;
pub mod error;
mod manager;
pub mod report;
mod run;
mod start;
mod watch;

pub use config::ServeConfig;
pub use error::ServeError;
pub use run::{run, run_with};
pub use start::{Runner, Running, Summary, start, start_with};
