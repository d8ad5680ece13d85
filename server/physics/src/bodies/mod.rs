//! The kinds of body.
pub mod hybrid;
pub mod mass_spring;
pub mod seed;
