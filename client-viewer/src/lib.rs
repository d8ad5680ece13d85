//! The command-line viewer: status, live numbers, pictures without a GPU, exports, scripted forces, control of the session.
//!
//! It knows the wire types only ([`palpate_proto`]); the surface it draws is rebuilt from the stream ([`surface`]).
pub mod cli;
pub mod connect;
pub mod control;
pub mod error;
pub mod export;
pub mod inject;
pub mod moment;
pub mod picture;
pub mod places;
pub mod refined;
pub mod status;
pub mod surface;
pub mod watch;

pub use error::ViewError;
