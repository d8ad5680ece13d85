//! The device bridge: runs beside a haptic arm and connects it to a Palpate daemon.
//!
//! ```text
//! arm ◀─force── servo thread (1 kHz, absolute deadlines) ◀──slot── uplink task ◀── DeviceDown
//!  └────pose───▶   renders the newest local model       ───slot──▶ (reconnects)  ──▶ DeviceUp
//! ```
//! The stiff loop closes here, on the newest local contact model, and never across the network. What comes from the daemon
//! is checked in [`convert`]; what goes to the arm passes the passivity controller, the force limiter and the watchdog's ramp
//! in [`servo`].
pub mod backoff;
pub mod cli;
pub mod config;
pub mod convert;
pub mod device;
pub mod emulate;
pub mod error;
pub mod guard;
pub mod latch;
pub mod measure;
pub mod probe;
pub mod recording;
pub mod run;
pub mod servo;
pub mod settings;
pub mod stats;
pub mod uplink;
pub mod vrpn_server;
mod watcher;

pub use config::Config;
pub use error::BridgeError;
pub use run::{Handle, run, run_with};
pub use stats::{Stats, Summary};
