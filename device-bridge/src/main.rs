//! `palpate-bridge`: see `palpate_bridge`.
use clap::Parser;
use palpate_bridge::cli::Cli;
use std::{io::Write as _, process::ExitCode};

fn main() -> miette::Result<ExitCode> {
    // Messages are not wrapped: flags and paths stay whole, and a log has one line for one message.
    miette::set_hook(Box::new(|_| Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())))?;
    Ok(Cli::parse().run().unwrap_or_else(|error| {
        let code = error.exit_code();
        // A reader that has gone misses it, no more.
        let _ = writeln!(std::io::stderr(), "Error: {:?}", miette::Report::new(error));
        code
    }))
}
