//! The hybrid body: coarse tetrahedra throughout, and particles of which only those near a contact are awake.
pub mod moments;
pub mod sites;
pub mod skin;
#[cfg(test)]
mod testing;

pub use skin::{Skin, SkinError};
