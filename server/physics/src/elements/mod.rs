//! Linear tetrahedral elements: shape gradients, lumped mass, stiffness at rest, loads on the boundary.
pub(crate) mod free_axes;
pub mod integration_points;
pub mod linear_tet;
pub mod loads;
pub mod mass;
pub mod natural_modes;
pub mod rest_stiffness;
pub mod rigid_motion;
pub mod smoothing;
pub mod solid;
pub mod strained;
