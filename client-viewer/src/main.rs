//! `palpate-view`: looks at a running daemon.
use clap::Parser;
use palpate_view::cli::{self, Arguments};
use std::process::ExitCode;

fn main() -> miette::Result<ExitCode> {
    // Messages are not wrapped: flags and paths stay whole, and a log has one line for one message.
    miette::set_hook(Box::new(|_| Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())))?;
    let arguments = Arguments::parse();
    cli::run(&arguments)?;
    Ok(ExitCode::SUCCESS)
}
