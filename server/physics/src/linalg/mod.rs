//! Linear algebra: what the model, its stepping and its equilibrium solve with.
pub(crate) mod cholesky;
pub(crate) mod dissection;
pub(crate) mod eigen;
pub(crate) mod lanczos;
pub(crate) mod nearest_rotation;
pub mod pcg;
pub mod tensor;

pub use cholesky::CholeskyError;
