//! `palpated simulate`: a scene headless, as fast as it goes, the same bits every time.
use std::{path::PathBuf, process::ExitCode};

/// Flags of `palpated simulate`.
#[derive(Debug, Clone, clap::Args)]
pub struct SimulateArgs {
    /// Scene file or name of a built-in scene
    pub scene: String,
    /// Folder for probes.csv, summary.json and frames; without it only the summary is printed
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Simulated time in seconds, instead of the scene's
    #[arg(long, value_name = "SECONDS")]
    pub duration_s: Option<f64>,
    /// Number of frames to write, or "none"
    #[arg(long, value_name = "N|none")]
    pub frames: Option<String>,
    /// Replace what is in the folder
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load, or a folder that cannot be written.
pub fn run(args: &SimulateArgs) -> miette::Result<ExitCode> {
    Err(miette::miette!("simulating {} is not possible yet", args.scene))
}
