//! `palpate-view`: looks at a running daemon.
use clap::Parser;
use palpate_view::cli::{self, Arguments};
use std::process::ExitCode;

fn main() -> miette::Result<ExitCode> {
    let arguments = Arguments::parse();
    cli::run(&arguments)?;
    Ok(ExitCode::SUCCESS)
}
