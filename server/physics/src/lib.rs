//! The physics of Palpate: deformable bodies, their contact with tools, and time.
//!
//! This crate knows no clock, thread, file or network: a [`Model`] is built once from a [`ModelSpec`], and
//! [`step`] advances a [`State`] by one tick with a [`Scratch`] that holds every buffer, so that a tick allocates
//! nothing. The same model, state and inputs give the same bits.
//!
//! Notation (docs/notation.md): `X` rest position, `x` position, `v` velocity (m, m/s), `F` deformation gradient,
//! `P` first Piola-Kirchhoff stress (Pa), `b_i = ∇N_i` shape gradient (1/m), `V` rest volume (m³).

pub mod bodies;
pub mod contact;
pub mod elements;
mod hash;
pub mod health;
pub mod integrate;
pub mod kernels;
pub mod lanes;
pub mod linalg;
pub mod material;
pub mod mesh;
#[cfg(test)]
mod random;
pub mod settings;
pub mod snapshot;
pub mod statics;
pub mod world;

pub use health::{Energies, Ledger, Quarantine};
pub use integrate::step;
pub use mesh::{MeshError, Surface, TetMesh};
pub use settings::{Integrator, LoadSpec, Precision, PrescribedSpec, Settings, Skips, Substeps};
pub use world::{Model, ModelError, ModelSpec, PointForce, Region, Scratch, State, StepReport, TickInput};
