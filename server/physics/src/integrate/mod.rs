//! Time integrators, one file each, and the test of whether the explicit one's step is stable.
mod backward_euler;
mod leapfrog;
mod pace;
mod scheme;
mod seed_semi_implicit;
mod seed_verlet;
mod stability;

pub use pace::{InstantForces, Pace};
pub(crate) use scheme::Scheme;
pub(crate) use stability::{Attempt, ForceHistory, StartOfTick, Verdict, is_judged};
