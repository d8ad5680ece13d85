//! Time integrators, one file each, and the spectrum that bounds the explicit ones' step.
mod backward_euler;
mod forces;
mod hybrid;
mod leapfrog;
mod motion;
mod scheme;
mod seed_body;
pub mod seed_semi_implicit;
mod seed_verlet;
mod sleep;
mod springs;
mod stability;
mod tick;

pub(crate) use scheme::{Body, ImplicitScratch, Scheme};
pub(crate) use seed_body::SeedBodyScratch;
pub(crate) use sleep::RestBound;
pub use sleep::Sleep;
pub(crate) use springs::SpringBodyScratch;
pub(crate) use stability::ForceHistory;
pub use stability::{InstantForces, Pace};
pub use tick::step;
