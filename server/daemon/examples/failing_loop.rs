//! `palpated serve` with a loop that panics after three seconds: `tests/system` looks at what becomes of its arms.
use clap::Parser;
use palpate_realtime::TickLoop;
use palpated::{
    serve::{self, args::ServeArgs},
    sim::thread::Loop,
};
use std::process::ExitCode;

#[derive(Debug, Parser)]
struct Cli {
    #[command(flatten)]
    serve: ServeArgs,
}

fn failing(the_loop: &mut Loop, tick_loop: &mut TickLoop) {
    let mut turns = 0;
    tick_loop.run(|wakeup| {
        turns += 1;
        assert!(turns < 3000, "the loop fails here, as it was meant to");
        the_loop.turn(wakeup)
    });
}

fn main() -> miette::Result<ExitCode> {
    serve::run_with(&Cli::parse().serve, failing)
}
