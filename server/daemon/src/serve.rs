//! `palpated serve`: the haptic loop, and its doors to arms and viewers.
pub mod args;

use args::ServeArgs;
use std::process::ExitCode;

/// Serves a scene until it is told to stop.
///
/// # Errors
/// A scene that does not load, or an address that cannot be bound.
pub fn run(args: &ServeArgs) -> miette::Result<ExitCode> {
    Err(miette::miette!("serving {} is not possible yet", args.scene))
}
