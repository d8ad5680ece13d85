//! Why a daemon cannot start.
use crate::{doors::listen::ListenError, grpc::ReflectionError, session::PrepareError};
use miette::Diagnostic;
use std::io;
use thiserror::Error;

/// Why a daemon cannot start.
#[derive(Debug, Error, Diagnostic)]
pub enum ServeError {
    /// A setting is out of range.
    #[error("{reason}")]
    Setting {
        /// Which, and its rule.
        reason: String,
    },
    /// The scene cannot be run.
    #[error("the scene cannot be run")]
    Prepare(#[from] PrepareError),
    /// A socket.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Listen(#[from] ListenError),
    /// The loop's thread or slots.
    #[error("the operating system refused the loop's {what}")]
    System {
        /// What was asked.
        what: &'static str,
        /// Why.
        source: io::Error,
    },
    /// The build is broken.
    #[error(transparent)]
    Reflection(#[from] ReflectionError),
}
