//! `palpate-lab fine-levels`: what a hybrid body's fine level may be made of, each on every body, at rest under the small patch, against the references.
//!
//! - `setting.rs`: a body with its coarse tets, lattice and load, on which any number of methods and particles are tried
//! - `level.rs`: what is awake of it; `methods`: what that may be made of in place of cells
//! - `equilibrium.rs`, `places.rs`: where it comes to rest, and what carries a point of the skin
//! - `names.rs`: all that is compared, by name
//! - `study.rs`: all cases, and what they come to
//! - `command.rs`, `page.rs`: the command, its table and page
mod command;
mod equilibrium;
mod level;
pub mod methods;
mod names;
mod page;
mod places;
mod setting;
mod study;
#[cfg(test)]
mod testing;

pub use command::{Options, run};
pub use names::FineMethod;
pub use setting::{CoarseMesh, Errors, PlacesOf, PointsOf, Setting};
