//! `palpated check`: what a scene's body is like, and what a tick costs on this machine.
use std::process::ExitCode;

/// Flags of `palpated check`.
#[derive(Debug, Clone, clap::Args)]
pub struct CheckArgs {
    /// Scene file or name of a built-in scene
    #[arg(required_unless_present = "list")]
    pub scene: Option<String>,
    /// List the built-in scenes instead
    #[arg(long)]
    pub list: bool,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load.
pub fn run(args: &CheckArgs) -> miette::Result<ExitCode> {
    Err(miette::miette!("checking {} is not possible yet", args.scene.as_deref().unwrap_or_default()))
}
