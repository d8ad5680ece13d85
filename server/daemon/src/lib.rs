//! `palpated`: the daemon that simulates a body at the haptic rate, and the offline commands on the same scenes.
pub mod cli;
pub mod offline;
pub mod serve;
