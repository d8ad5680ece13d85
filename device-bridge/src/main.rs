//! `palpate-bridge`: see `palpate_bridge`.
use clap::Parser;
use palpate_bridge::cli::Cli;
use std::process::ExitCode;

fn main() -> miette::Result<ExitCode> {
    Cli::parse().run().map_err(miette::Report::new)
}
