//! `palpated serve`: the haptic loop, and its doors to arms and viewers.
pub mod args;
pub mod config;
pub mod error;
pub mod report;
mod run;
mod start;

pub use config::ServeConfig;
pub use error::ServeError;
pub use run::run;
pub use start::{Running, Summary, start};
