//! Entry of `palpated`: parse the command line, run the command, show errors with their place and a next step.
use palpated::cli::Cli;
use std::process::ExitCode;

fn main() -> miette::Result<ExitCode> {
    // Messages are not wrapped: flags and paths stay whole, and a journal has one line for one message.
    miette::set_hook(Box::new(|_| Box::new(miette::MietteHandlerOpts::new().wrap_lines(false).build())))?;
    Cli::read(std::env::args_os().collect()).unwrap_or_else(|error| error.exit()).run()
}
