//! `palpated schema`: the JSON schema of scene files.
use miette::IntoDiagnostic;
use std::{io::Write, process::ExitCode};

/// Prints the schema to standard output.
///
/// # Errors
/// Standard output cannot be written.
pub fn run() -> miette::Result<ExitCode> {
    let text = serde_json::to_string_pretty(&palpate_scene::json_schema()).into_diagnostic()?;
    writeln!(std::io::stdout(), "{text}").into_diagnostic()?;
    Ok(ExitCode::SUCCESS)
}
