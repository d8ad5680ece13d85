//! The physics of Palpate: deformable bodies, their contact with tools, and time.
//!
//! This crate knows no clock, thread, file or network: a [`Model`] is built once from a [`ModelSpec`], and
//! [`step`] advances a [`State`] by one tick with a [`Scratch`] that holds every buffer, so that a tick allocates
//! nothing. The same model, state and inputs give the same bits.
//!
//! Its folders are a ladder: each uses only those above it in this list (`tests/ladder.rs`).
//!
//! | folder | what it is |
//! |---|---|
//! | `hash` | hashes that are the same on every machine: of what prints, and of every bit of every tick |
//! | [`settings`] | how a scene is computed; loads and constraints |
//! | [`linalg`] | conjugate gradients, Lanczos' method, sparse Cholesky, nested dissection, small eigenproblems |
//! | [`lanes`] | vectors of numbers, instruction sets, operations on whole lists: all the `unsafe` |
//! | [`mesh`] | tetrahedra and surfaces |
//! | [`material`] | constitutive laws |
//! | [`elements`] | the linear tetrahedron: gradients, mass, stiffness at rest, loads |
//! | [`kernels`] | internal forces of many tets at once |
//! | [`contact`] | tools against a surface |
//! | [`tick`] | what every kind of body shares in a tick |
//! | [`bodies`] | the kinds of body, behind one enum |
//! | [`integrate`] | time integrators, and the judge of the explicit one's step |
//! | [`world`] | model, state, and the step |
//! | [`snapshot`] | a state as bytes |
//! | [`statics`] | equilibrium and natural modes |
//!
//! Notation (docs/notation.md): `X` rest position, `x` position, `v` velocity (m, m/s), `F` deformation gradient,
//! `P` first Piola-Kirchhoff stress (Pa), `b_i = ∇N_i` shape gradient (1/m), `V` rest volume (m³).

pub mod bodies;
pub mod contact;
pub mod elements;
mod hash;
pub mod integrate;
pub mod kernels;
pub mod lanes;
pub mod linalg;
pub mod material;
pub mod mesh;
pub mod settings;
pub mod snapshot;
pub mod statics;
#[cfg(test)]
mod testing;
pub mod tick;
pub mod world;

pub use crate::bodies::{Body, BodySpec, BodyState};
pub use crate::elements::solid::{Region, Solid};
pub use crate::hash::Chain;
pub use crate::mesh::{MeshError, Surface, TetMesh};
pub use crate::settings::{
    Integrator, LoadSpec, Precision, PrescribedSpec, SelfContactChoice, Settings, Skips, Substeps,
};
pub use crate::tick::{AwakeFor, Energies, Ledger, PointForce, TickInput};
pub use crate::world::{Model, ModelError, ModelSpec, Quarantine, Scratch, State, StepReport, step};
