//! The bits of every scene, kept in the source tree: whether a change of the physics left every bit of every tick as it was.
//!
//! - `case.rs`: a scene, how much of it is run, and what is done to it
//! - `shipped.rs`: the scenes of `deploy/scenes`
//! - `own`: small scenes of what those do not have
//! - `hand.rs`: poses of an arm
//! - `hashing.rs`: a case from its text to its hashes
//! - `host.rs`: what else than the code decides bits
//! - `record.rs`: the file, `tests/lab/records/hashes.txt`
//! - `compare.rs`: what differs, and between which ticks
//! - `command.rs`: `palpate-lab hashes`
mod case;
mod command;
mod compare;
mod hand;
mod hashing;
mod host;
mod own;
mod record;
mod shipped;

pub use case::Case;
pub use command::{Options, all, every_case, run};
pub use compare::{Difference, differences};
pub use hashing::Seen;
pub use host::Host;
pub use record::{Line, Mark, Record};
