//! What can go wrong, with the next step.
use miette::Diagnostic;
use palpate_proto::connect::{is_transport, words_of};
use std::path::PathBuf;
use thiserror::Error;

/// An error of the viewer.
#[derive(Debug, Error, Diagnostic)]
pub enum ViewError {
    /// The server's address cannot be used.
    #[error("\"{address}\" is no address of a daemon: {reason}")]
    #[diagnostic(help("write http://HOST:PORT, https://HOST:PORT or unix:///path/to/socket"))]
    Address {
        /// As given.
        address: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The token cannot be sent.
    #[error("{0}")]
    Token(String),
    /// Nobody answers.
    #[error("no daemon answers at {address}: {reason}")]
    #[diagnostic(help("is `palpated` running there? it prints its address when it starts; give it with --server"))]
    Unreachable {
        /// Address tried.
        address: String,
        /// The transport's words.
        reason: String,
    },
    /// The daemon refused.
    #[error("the daemon refused: {message} ({code})")]
    Refused {
        /// gRPC code.
        code: String,
        /// Its message.
        message: String,
    },
    /// The connection broke while it was used.
    #[error("the connection to the daemon broke: {0}")]
    #[diagnostic(help("the daemon was stopped, or the network failed: `palpate-view status` says whether it is back"))]
    Lost(String),
    /// The daemon is connected and says nothing.
    #[error("the daemon has sent nothing for {silence_s:.1} s, though it sends updates even while time stands")]
    #[diagnostic(help("it hangs, or the network does: `palpate-view status` says whether it answers"))]
    Silent {
        /// How long nothing came (s).
        silence_s: f64,
    },
    /// The force that was waited for did not come.
    #[error(
        "no tool was pressed with {wanted_n} N within {waited_s} s; the largest contact force was {largest_n:.3} N"
    )]
    #[diagnostic(help(
        "`palpate-view watch` shows the forces; ask for less with --min-force-n, or wait longer with --timeout-s"
    ))]
    NotPressed {
        /// Force waited for (N).
        wanted_n: f64,
        /// How long (s).
        waited_s: f64,
        /// Largest force seen meanwhile (N).
        largest_n: f64,
    },
    /// Nobody reads what is printed (`| head`): the end, and no error.
    #[error("nobody reads the output")]
    Unread,
    /// The stream broke the protocol, or ended.
    #[error("the stream of the surface {0}")]
    Stream(String),
    /// A file could not be read or written.
    #[error("{action} {path}", path = path.display())]
    File {
        /// `cannot read` or `cannot write`; `source` is shown below.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Would overwrite.
    #[error("{path} exists", path = .0.display())]
    #[diagnostic(help("choose another name, or give --force to replace it"))]
    Exists(PathBuf),
    /// Unknown file ending.
    #[error("{path}: unknown ending; known are {known}", path = path.display())]
    Ending {
        /// The file.
        path: PathBuf,
        /// Endings that work.
        known: &'static str,
    },
    /// Particles are wanted of a body of tets.
    #[error("the body of \"{0}\" has no particles")]
    #[diagnostic(help("particles are written of hybrid bodies only: those whose scene has [body.particles]"))]
    NoParticles(String),
    /// A refined surface is wanted where the daemon has none to give.
    #[error("the surface of \"{0}\" is not refined near tools")]
    #[diagnostic(help(
        "leave --refined out: a mass-spring surface ([body.springs]) is always sent refined, and a surface with an edge of more than \
         two triangles cannot be (the daemon's log names it)"
    ))]
    NotRefined(String),
    /// No scene to load.
    #[error("no scene \"{scene}\": {known}")]
    NoScene {
        /// As given.
        scene: String,
        /// What there is.
        known: String,
    },
    /// A force script is wrong.
    #[error("{path}: {reason}", path = path.display())]
    #[diagnostic(help(
        "a script is TOML: [[force]] with surface_vertex = 12, nearest_to_mm = [x, y, z] or nearest_to_m = [x, y, z], \
         force_n = [x, y, z], from_tick = 0, tick_count = 100; `palpate-view inject --help` shows one"
    ))]
    Script {
        /// The script.
        path: PathBuf,
        /// What is wrong, with line where known.
        reason: String,
    },
}

impl From<tonic::Status> for ViewError {
    fn from(status: tonic::Status) -> Self {
        if is_transport(&status) {
            return Self::Lost(words_of(&status));
        }
        Self::Refused { code: format!("{:?}", status.code()), message: status.message().to_owned() }
    }
}
