//! The hybrid body: coarse tetrahedra throughout, and particles of which only those near a contact are awake.
mod active;
pub mod body;
pub mod cage;
pub mod cell;
pub mod clusters;
pub mod composite;
mod energy;
pub mod equilibrium;
mod frequency;
mod listed;
mod locate;
pub mod metric;
pub mod moments;
pub mod partition;
pub mod patch;
pub mod place;
mod running;
mod running_metric;
pub mod share;
pub mod sites;
pub mod skin;
pub mod spec;
mod switching;
#[cfg(test)]
pub(crate) mod testing;

pub use active::ActiveParticles;
pub(crate) use active::HybridScratch;
pub use body::Hybrid;
pub(crate) use listed::SkinView;
pub use skin::{Skin, SkinError};
pub use spec::{HybridError, ParticleSpec, Waking};
