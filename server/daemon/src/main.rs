//! Entry of `palpated`: parse the command line, run the command, show errors with their place and a next step.
use clap::Parser;
use palpated::cli::Cli;
use std::process::ExitCode;

fn main() -> miette::Result<ExitCode> {
    Cli::parse().run()
}
