//! The hybrid body: coarse tetrahedra throughout, and particles of which only those near a contact are awake.
mod active;
mod balance;
pub mod body;
pub mod cage;
pub mod cell;
pub mod clusters;
mod coming;
pub mod composite;
mod energy;
pub mod equilibrium;
pub mod fade;
mod frequency;
mod handover;
pub mod kernels;
mod least_squares;
mod listed;
mod locate;
mod long_steps;
#[cfg(test)]
mod method_checks;
pub mod methods;
pub mod metric;
pub mod moments;
pub mod partition;
pub mod patch;
pub mod place;
pub mod points;
mod projection;
mod running;
mod running_metric;
pub mod share;
pub mod sites;
pub mod sizes;
pub mod skin;
mod smoothing;
pub mod spec;
mod sph;
pub(crate) mod switching;
#[cfg(test)]
pub(crate) mod testing;

pub use active::ActiveParticles;
pub(crate) use active::HybridScratch;
pub use body::Hybrid;
pub(crate) use listed::SkinView;
pub use skin::{Skin, SkinError};
pub use spec::{HybridError, ParticleSpec, Waking};
pub use switching::wake_only;
