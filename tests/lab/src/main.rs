//! `palpate-lab`: benchmark tables.
use clap::{Parser, Subcommand};

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
}

fn main() -> miette::Result<()> {
    match Arguments::parse().command {
        Command::Table => palpate_lab::table::print(),
    }
}
