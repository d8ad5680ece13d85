//! `palpate-lab`: benchmark tables.
use clap::{Parser, Subcommand};
use palpate_lab::jitter;

#[derive(Parser)]
#[command(name = "palpate-lab", about = "Run time beside error: benchmark tables of Palpate's physics")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Cost of the force kernel per tet and of a tick per body, each with its error or its aim
    Table,
    /// How late a 1 kHz loop wakes and what its ticks cost, with a pressed body in it, beside `cyclictest`
    ///
    /// The two take turns, so that a slow moment of the machine strikes both. Run it as a user with real-time privileges, on
    /// a machine that is doing what it will do in use.
    Jitter(jitter::Options),
}

fn main() -> miette::Result<()> {
    match Arguments::parse().command {
        Command::Table => palpate_lab::table::print(),
        Command::Jitter(options) => jitter::print(&options),
    }
}
