//! What a loop needs to keep its deadlines, and to say how well it does. Linux; free of tokio, tonic and prost.
//!
//! - [`Clock`], [`Deadlines`]: absolute deadlines on the monotonic clock, or on one that a test turns by hand.
//! - [`TickLoop`]: waits, measures, calls, until told to stop.
//! - [`slot()`]: the newest value from one thread to another, wait-free on both sides; the older one is dropped and counted.
//! - [`Doorbell`]: wakes an async task when a slot has something, with one system call and no lock.
//! - [`Histogram`]: fixed memory, one writer, any readers, no lock.
//! - [`os`]: priority, locked memory, processor, each with a line that says whether it was granted. The only unsafe code here.
pub mod clock;
pub mod deadline;
pub mod doorbell;
pub mod histogram;
pub mod os;
pub mod slot;
pub mod tick_loop;

pub use clock::{Clock, ManualClock};
pub use deadline::{Deadlines, PeriodError, Wakeup};
pub use doorbell::Doorbell;
pub use histogram::{Histogram, Percentiles};
pub use os::{Note, OsMeasures, give_large_blocks_back};
pub use slot::{SlotReader, SlotWriter, slot};
pub use tick_loop::{LoopMonitor, TickLoop};
