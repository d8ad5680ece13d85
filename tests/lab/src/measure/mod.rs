//! Measuring: every method goes through a problem and comes to rest; then all take turns, ticks in the pressed state being timed.
mod csv;
mod row;
mod run;

pub use csv::{Run, read, write};
pub use row::{Row, TIE_ERROR};
pub use run::{Effort, LAST, Turn, problem};
