//! Arguments, and which file does what.
use crate::{ViewError, connect::Server, control, export, inject, picture, status, watch};
use clap::{Args, Parser, Subcommand};
use palpate_proto::connect::Credentials;
use std::{
    fs,
    io::{ErrorKind, Write as _},
    path::PathBuf,
};

/// Looks at a running palpated: status, live numbers, pictures, exports; pauses, resets and pushes what runs there.
#[derive(Debug, Parser)]
#[command(
    name = "palpate-view",
    version,
    after_help = "Examples:\n  palpate-view status\n  palpate-view watch --seconds 10\n  palpate-view snapshot dent.png --size 1200x900\n  palpate-view export dent.vtu\n  palpate-view inject push.toml\n  palpate-view pause"
)]
pub struct Arguments {
    #[command(flatten)]
    server: ServerArguments,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Args)]
struct ServerArguments {
    /// The daemon: http://HOST:PORT, https://HOST:PORT or unix:///path/to/socket
    #[arg(
        long,
        global = true,
        env = "PALPATE_SERVER",
        default_value = "http://127.0.0.1:7411",
        value_name = "ADDRESS"
    )]
    server: String,
    /// Certificate authority to trust for https:// (PEM file)
    #[arg(long, global = true, value_name = "FILE")]
    tls_ca: Option<PathBuf>,
    /// Certificate to show (PEM file, `palpated pki issue`)
    #[arg(long, global = true, value_name = "FILE", requires = "tls_key")]
    tls_cert: Option<PathBuf>,
    /// Its key (PEM file)
    #[arg(long, global = true, value_name = "FILE", requires = "tls_cert")]
    tls_key: Option<PathBuf>,
    /// Token to show (`palpated pki token`); better in the environment, where others do not see it
    #[arg(long, global = true, env = "PALPATE_TOKEN", hide_env_values = true, value_name = "TOKEN")]
    token: Option<String>,
}

impl ServerArguments {
    fn server(&self) -> Server {
        let credentials = Credentials {
            authority: self.tls_ca.clone(),
            certificate: self.tls_cert.clone().zip(self.tls_key.clone()),
            token: self.token.clone(),
        };
        Server { address: self.server.clone(), credentials }
    }
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Says what the daemon runs, how well it keeps time, and who is attached
    Status {
        /// Machine-readable
        #[arg(long)]
        json: bool,
    },
    /// Prints live numbers: rate, delay, dropped frames, force
    Watch(watch::WatchArguments),
    /// Draws the deformed surface, coloured by displacement, into a PNG (no GPU needed)
    Snapshot(picture::SnapshotArguments),
    /// Writes the deformed surface as .vtu, .obj or .ply
    Export(export::ExportArguments),
    /// Injects the forces of a script
    Inject(inject::InjectArguments),
    #[command(flatten)]
    Control(control::Control),
}

/// Runs the command.
///
/// # Errors
/// [`ViewError`], with the next step.
pub fn run(arguments: &Arguments) -> Result<(), ViewError> {
    let server = arguments.server.server();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|source| {
        ViewError::File { action: "cannot start the runtime of", path: "palpate-view".into(), source }
    })?;
    let done = runtime.block_on(async {
        match &arguments.command {
            Command::Status { json } => status::run(&server, *json).await,
            Command::Watch(arguments) => watch::run(&server, arguments).await,
            Command::Snapshot(arguments) => picture::run(&server, arguments).await,
            Command::Export(arguments) => export::run(&server, arguments).await,
            Command::Inject(arguments) => inject::run(&server, arguments).await,
            Command::Control(control) => control::run(&server, control).await,
        }
    });
    match done {
        Err(ViewError::Unread) => Ok(()),
        done => done,
    }
}

/// Prints a line.
///
/// # Errors
/// [`ViewError::Unread`] when the reader has gone, or [`ViewError::File`].
pub fn say(line: &str) -> Result<(), ViewError> {
    writeln!(std::io::stdout(), "{line}").map_err(|source| match source.kind() {
        ErrorKind::BrokenPipe => ViewError::Unread,
        _ => ViewError::File { action: "cannot write to", path: "standard output".into(), source },
    })
}

/// Reads a file.
///
/// # Errors
/// [`ViewError::File`].
pub fn read(path: &PathBuf) -> Result<Vec<u8>, ViewError> {
    fs::read(path).map_err(|source| ViewError::File { action: "cannot read", path: path.clone(), source })
}

/// Writes a whole file: beside it first, then renamed, so that a failure leaves what was there.
///
/// # Errors
/// [`ViewError::Exists`] without `force`, or [`ViewError::File`].
pub fn write_new(path: &PathBuf, bytes: &[u8], force: bool) -> Result<(), ViewError> {
    if path.exists() && !force {
        return Err(ViewError::Exists(path.clone()));
    }
    let mut beside = path.clone().into_os_string();
    beside.push(".part");
    fs::write(&beside, bytes).and_then(|()| fs::rename(&beside, path)).map_err(|source| {
        // Half a file helps nobody; that it may not be there is no second error.
        let _ = fs::remove_file(&beside);
        ViewError::File { action: "cannot write", path: path.clone(), source }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_cannot_be_written_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("taken.ply");
        fs::create_dir(&target).unwrap();
        assert!(matches!(write_new(&target, b"ply", false), Err(ViewError::Exists(_))));
        assert!(matches!(write_new(&target, b"ply", true), Err(ViewError::File { .. })));
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
