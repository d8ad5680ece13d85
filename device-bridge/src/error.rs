//! What stops a bridge, and what to do about it.
use crate::recording::recorder::RecordFailure;
use miette::{Diagnostic, NamedSource, SourceSpan};
use std::{path::PathBuf, process::ExitCode};
use thiserror::Error;

/// An error of the bridge.
#[derive(Debug, Error, Diagnostic)]
pub enum BridgeError {
    /// A file cannot be read.
    #[error("cannot read {what} {path}", path = path.display())]
    #[diagnostic(help(
        "check the path and its permissions; `palpate-bridge --print-config` prints a complete configuration"
    ))]
    Read {
        /// What the file is for.
        what: &'static str,
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file cannot be written.
    #[error("cannot write {what} {path}", path = path.display())]
    #[diagnostic(help("check the path and its permissions"))]
    Write {
        /// What the file is for.
        what: &'static str,
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The configuration is not TOML, or has unknown keys or wrong types.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Config(Box<ConfigError>),
    /// A value is out of range.
    #[error("{key}: {reason}")]
    #[diagnostic(help("`palpate-bridge --print-config` prints every key with its default"))]
    Value {
        /// Section and key.
        key: String,
        /// What is wrong.
        reason: String,
    },
    /// The server's address cannot be used.
    #[error("\"{address}\" is no address of a daemon: {reason}")]
    #[diagnostic(help("write http://HOST:PORT, https://HOST:PORT or unix:///path/to/socket"))]
    Address {
        /// As given.
        address: String,
        /// What is wrong with it.
        reason: String,
    },
    /// Nobody answered within the time allowed.
    #[error("no daemon answered at {address} for {seconds} s: {reason}")]
    #[diagnostic(help(
        "is `palpated` running there? it prints its address when it starts; give it with --server. Without --give-up-after-s \
         the bridge waits for it"
    ))]
    Unreachable {
        /// Address tried.
        address: String,
        /// How long (s).
        seconds: f64,
        /// The last attempt's error.
        reason: String,
    },
    /// The daemon refused this bridge, for a reason that trying again does not change.
    #[error("the daemon at {address} refused the arm: {message} ({code})")]
    #[diagnostic(help("{help}"))]
    Refused {
        /// Address.
        address: String,
        /// gRPC code.
        code: String,
        /// Its words.
        message: String,
        /// What to do.
        help: &'static str,
    },
    /// The recording ended before the arm did.
    #[error("the recording {path} ended after {written} rows: {reason}", path = failure.path.display(), written = failure.written, reason = failure.reason)]
    #[diagnostic(help("what is there is whole; make room on the disk, or record elsewhere with --record"))]
    Recording {
        /// What went wrong.
        failure: RecordFailure,
    },
    /// Somebody took the tool from this arm.
    #[error("the daemon at {address} reports: {message}")]
    #[diagnostic(help("start the bridge again when the arm is wanted again"))]
    Dismissed {
        /// Address.
        address: String,
        /// Its words.
        message: String,
    },
    /// The operating system refused something the bridge cannot do without.
    #[error("cannot {what}")]
    System {
        /// What.
        what: &'static str,
        /// Why.
        source: std::io::Error,
    },
    /// The arm could not be started.
    #[error("the arm cannot be started")]
    #[diagnostic(help("{help}"))]
    Start {
        /// What to do.
        help: &'static str,
        /// What the driver says.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The arm failed in the loop.
    #[error("the arm is lost: {fault}; its force was taken away")]
    #[diagnostic(help(
        "see to the arm, and start the bridge again: the force comes back slowly, with --latch-file once SIGUSR1 has recovered it. An arm that has stopped answering while other work held \
         this machine up may be well: end that work, or raise silence_s in [device]"
    ))]
    DeviceLost {
        /// Why.
        fault: crate::device::Fault,
    },
    /// The servo thread died; its panic message is on standard error.
    #[error("the servo thread stopped unexpectedly; the arm gets no force")]
    #[diagnostic(help("this is a defect: please report it with the output above"))]
    ServoDied,
}

impl BridgeError {
    /// What the program ends with: 3 when somebody took the tool from the arm, so that whoever starts programs again leaves it; else 1.
    pub fn exit_code(&self) -> ExitCode {
        ExitCode::from(if matches!(self, Self::Dismissed { .. }) { 3 } else { 1 })
    }
}

/// A mistake in a configuration, and where.
#[derive(Debug, Error, Diagnostic)]
#[error("{message}")]
pub struct ConfigError {
    /// What is wrong.
    pub message: String,
    /// The text.
    #[source_code]
    pub text: NamedSource<String>,
    /// Where.
    #[label("here")]
    pub at: Option<SourceSpan>,
    /// What to do.
    #[help]
    pub help: Option<String>,
}
