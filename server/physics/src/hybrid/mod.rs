//! The hybrid body: coarse tetrahedra throughout, and particles of which only those near a contact are awake.
pub mod cage;
pub mod cell;
pub mod composite;
pub mod equilibrium;
pub mod kernels;
mod least_squares;
mod locate;
#[cfg(test)]
mod method_checks;
pub mod methods;
pub mod metric;
pub mod moments;
pub mod partition;
pub mod patch;
pub mod place;
pub mod points;
pub mod share;
pub mod sites;
pub mod skin;
mod smoothing;
mod sph;
#[cfg(test)]
pub(crate) mod testing;

pub use skin::{Skin, SkinError};
