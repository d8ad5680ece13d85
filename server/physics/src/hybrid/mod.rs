//! The hybrid body: coarse tetrahedra throughout, and particles of which only those near a contact are awake.
pub mod body;
pub mod cage;
pub mod cell;
pub mod composite;
pub mod equilibrium;
mod locate;
pub mod metric;
pub mod moments;
pub mod partition;
pub mod patch;
pub mod place;
pub mod share;
mod running;
mod running_metric;
pub mod sites;
pub mod skin;
pub mod spec;
#[cfg(test)]
pub(crate) mod testing;

pub use body::Hybrid;
pub(crate) use running::RunningPatch;
pub use skin::{Skin, SkinError};
pub use spec::{HybridError, ParticleSpec, Waking};
