//! `palpate-lab fine-levels`: what a hybrid body's fine level may be made of, each on every body, at rest under the small patch, against the references.
//!
//! - `setting.rs`: a body with its coarse tets, lattice and load, on which any number of methods and particles are tried
//! - `method.rs`: the methods by name
//! - `study.rs`: all cases, and what they come to
//! - `command.rs`, `page.rs`: the command, its table and page
mod command;
mod method;
mod page;
mod setting;
mod study;

pub use command::{Options, run};
pub use method::FineMethod;
pub use setting::{CoarseMesh, Errors, PlacesOf, PointsOf, Setting};
