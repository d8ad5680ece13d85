//! Linear algebra: what the model, its stepping and its equilibrium solve with.
pub(crate) mod eigen;
pub(crate) mod lanczos;
pub(crate) mod nearest_rotation;
pub(crate) mod pcg;
pub mod tensor;
