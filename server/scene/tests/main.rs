//! What the crate's users see, tested: in one program, which is linked once and runs as many tests at a time as there are processors.
#![allow(clippy::unwrap_used, clippy::expect_used)] // helpers outside #[test] functions
mod cubes;

mod bad_input;
mod elements;
mod examples;
mod file_damage;
mod file_details;
mod file_gmsh;
mod file_samples;
mod file_solids;
mod file_spellings;
mod file_writers;
mod file_xdmf;
mod hybrid;
mod integrators;
mod regions;
mod schema;
mod seed;
mod self_contact;
mod separate_parts;
mod springs;
mod starts;
mod surface_alone;
