//! The reference: what a problem's answer is when no discretisation of Palpate's has a say in it.
//!
//! Where there is no formula, answers come from triquadratic hexahedra (27 nodes, 27 quadrature points), fitted to the
//! true geometry and graded towards the contact, solved in f64 by Newton's method with a sparse Cholesky factorisation. They
//! share nothing with the product but the materials' energy densities, whose derivatives have tests of their own. Elements of
//! second order hardly lock: Lamé's sphere at ν = 0.49 is 0.07 % off with 216 of them (`tests/reference.rs`).
//!
//! - `grid.rs`: graded grids of hexahedra and their sides; `bodies.rs`: the block and the ventricle
//! - `shape.rs`: shape functions and quadrature
//! - `solid.rs`: elastic forces and stiffness; `volume.rs`: volume's change, projected against locking
//! - `sphere.rs`: a rigid sphere without friction, by a stiff penalty on the surface
//! - `matrix.rs`, `ordering.rs`, `newton.rs`: the solve; `dynamics.rs`: motion in time; `modes.rs`: natural modes
pub mod bodies;
pub mod dynamics;
pub mod grid;
mod matrix;
pub mod modes;
pub mod newton;
mod ordering;
pub mod shape;
pub mod solid;
pub mod sphere;
mod volume;
