//! Flags that `simulate` and `static` share.
use std::path::PathBuf;

/// Which scene, and where its results go.
#[derive(Debug, Clone, clap::Args)]
pub(super) struct OutputArgs {
    /// Scene file or name of a built-in scene
    pub(super) scene: String,
    /// Folder for probes.csv, summary.json and frames; without it only the summary is printed
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Print the summary as JSON
    #[arg(long)]
    pub(super) json: bool,
    /// Replace the results of an earlier run in the folder
    #[arg(long, requires = "out")]
    pub(super) force: bool,
}

/// A number larger than 0.
pub(super) fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value.is_finite() => Ok(value),
        _ => Err("give a number larger than 0".into()),
    }
}
