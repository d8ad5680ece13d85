//! The loop and what it exchanges with the rest of the daemon.
pub mod arm;
pub mod bell;
pub mod command;
pub mod exchange;
pub mod inject;
pub mod inside;
pub mod simulation;
pub mod thread;
pub mod tick;
pub mod timing;
pub mod tool;
