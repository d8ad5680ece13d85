//! Time integrators, and the spectrum that bounds their step.
pub mod leapfrog;
pub mod spectrum;
