//! `palpated static`: the equilibrium of a scene under its final loads.
use std::{path::PathBuf, process::ExitCode};

/// Flags of `palpated static`.
#[derive(Debug, Clone, clap::Args)]
pub struct StaticArgs {
    /// Scene file or name of a built-in scene
    pub scene: String,
    /// Folder for probes.csv, summary.json and the frame; without it only the summary is printed
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Replace what is in the folder
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load, no convergence, or a folder that cannot be written.
pub fn run(args: &StaticArgs) -> miette::Result<ExitCode> {
    Err(miette::miette!("solving {} is not possible yet", args.scene))
}
