//! Linear tetrahedral elements: shape gradients, lumped mass, loads on the boundary.
pub mod element;
pub mod loads;
pub mod mass;
