//! The hybrid body: coarse tetrahedra throughout, and particles of which only those near a contact are awake.
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
pub mod sites;
pub mod skin;
#[cfg(test)]
pub(crate) mod testing;

pub use skin::{Skin, SkinError};
