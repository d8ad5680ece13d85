//! What the daemon and the commands of its program do, tested: in one program, which is linked once and runs as many tests at a time as there are processors.
#![allow(clippy::unwrap_used, clippy::expect_used)] // helpers outside #[test] functions
mod common;

mod device;
mod doors;
mod endings;
mod exit_codes;
mod fit_budget;
mod hybrid;
mod identities;
mod kept;
mod lane;
mod leases;
mod limits;
mod offline;
mod particles;
mod ramps;
mod refined;
mod resumed;
mod seed;
mod session;
mod springs;
mod static_particles;
mod status;
mod strangers;
mod surface;
mod torque;
