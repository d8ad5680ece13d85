//! The lab: what Palpate costs, measured beside what it gets wrong.
pub mod bodies;
pub mod convergence;
pub mod deep;
pub mod fine_levels;
pub mod hashes;
pub mod hearts;
pub mod in_time;
pub mod jitter;
pub mod locking;
pub mod machine;
pub mod measure;
pub mod methods;
pub mod peers;
pub mod press;
pub mod problems;
mod random;
pub mod reference;
pub mod references;
pub mod report;
pub mod ripple;
pub mod skips;
pub mod stress;
pub mod subdivision;
pub mod table;
pub mod timing;

/// The only allocator of the lab: it counts what is held, for the memory of methods, and can be forbidden to allocate
/// ([`assert_no_alloc::assert_no_alloc`]). Ticks allocate nothing, so it costs them nothing.
#[global_allocator]
pub static MEMORY: cap::Cap<assert_no_alloc::AllocDisabler> = cap::Cap::new(assert_no_alloc::AllocDisabler, usize::MAX);
