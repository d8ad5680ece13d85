//! `palpated`: the daemon that simulates a body at the haptic rate, and the offline commands on the same scenes.
pub mod bodies;
pub mod cli;
pub mod doors;
pub mod grpc;
pub mod load;
pub mod offline;
pub mod page;
mod progress;
pub mod serve;
pub mod session;
pub mod sim;
pub mod sparing;
pub mod status;
pub mod strained;
pub mod stream;
pub mod telemetry;
pub mod tick_budget;
