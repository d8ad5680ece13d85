//! Why a daemon cannot start.
use crate::{
    doors::listen::ListenError, grpc::ReflectionError, kept::folder::KeptError, session::PrepareError,
    who::folder::FolderError,
};
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
    /// Others could reach it, and nobody would ask who they are.
    #[error("{address} can be reached by a network, and whoever reaches it could move the arm")]
    #[diagnostic(help(
        "make keys with `palpated pki init` and give --pki FOLDER; or, where everybody who reaches this machine may do everything, \
         --trust-the-network. Alone on this machine: --listen 127.0.0.1:{}",
        address.port()
    ))]
    Untrusted {
        /// The address.
        address: std::net::SocketAddr,
    },
    /// The kept session.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Kept(#[from] KeptError),
    /// The kept session's state is not of its scene.
    #[error("the kept session cannot be taken up again: {reason}")]
    #[diagnostic(help(
        "its scene, or this version's way to build it, has changed since: start without --resume to begin at rest"
    ))]
    Resume {
        /// Why.
        reason: String,
    },
    /// Keys.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Keys(#[from] FolderError),
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
