//! Entry of `palpated`: parse the command line, run the command, show errors with their place and a next step.
use palpated::cli::Cli;
use std::process::ExitCode;

fn main() -> miette::Result<ExitCode> {
    Cli::read(std::env::args_os().collect()).unwrap_or_else(|error| error.exit()).run()
}
