//! Time integrators, one file each, and what judges the explicit one's step.
mod backward_euler;
mod leapfrog;
mod scheme;
mod seed_semi_implicit;
mod seed_verlet;
mod stability;

pub(crate) use scheme::Scheme;
pub(crate) use stability::{Attempt, ForceHistory, StartOfTick, Verdict, is_judged};
pub use stability::{InstantForces, Pace};
