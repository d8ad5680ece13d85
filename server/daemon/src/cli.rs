//! The command line: subcommands and their flags, parsed once into types.
use crate::{offline, serve};
use clap::{Parser, Subcommand};
use std::process::ExitCode;

const EXAMPLES: &str = "\
Examples:
  palpated                                  serve the built-in ventricle, pressed by a simulated arm
  palpated serve my-organ.toml              serve your own scene
  palpated check my-organ.toml              what the body is like, and how long a tick takes here
  palpated simulate ventricle --out run     run headless: probes as CSV, frames as VTU, a JSON summary
  palpated static cantilever --out rest     find the equilibrium instead of integrating in time
  palpated schema > palpate-scene.json      JSON schema of scene files, for editors

Scenes are TOML files (docs/scenes.md), or names of built-in ones: palpated check --list.";

/// Simulates soft bodies at the haptic rate: serves arms and viewers, or runs scenes offline.
///
/// Without a subcommand it serves.
#[derive(Debug, Parser)]
#[command(name = "palpated", version, args_conflicts_with_subcommands = true, after_help = EXAMPLES)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    serve: serve::args::ServeArgs,
}

/// What to do.
#[derive(Debug, Subcommand)]
enum Command {
    /// Run a scene in real time for arms and viewers (the default)
    Serve(serve::args::ServeArgs),
    /// Run a scene headless, as fast as it goes, and write what it measured
    Simulate(offline::simulate::SimulateArgs),
    /// Find the equilibrium of a scene under its final loads, and write the same files
    Static(offline::equilibrium::StaticArgs),
    /// Load a scene and say what its body is like and what a tick costs
    Check(offline::check::CheckArgs),
    /// Print the JSON schema of scene files
    Schema,
}

impl Cli {
    /// Runs the chosen command.
    ///
    /// # Errors
    /// Whatever stops it, ready to be shown to a user.
    pub fn run(self) -> miette::Result<ExitCode> {
        match self.command {
            None => serve::run(&self.serve),
            Some(Command::Serve(args)) => serve::run(&args),
            Some(Command::Simulate(args)) => offline::simulate::run(&args),
            Some(Command::Static(args)) => offline::equilibrium::run(&args),
            Some(Command::Check(args)) => offline::check::run(&args),
            Some(Command::Schema) => offline::schema::run(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn serve_is_the_default_and_takes_its_flags_without_being_named() {
        assert!(Cli::try_parse_from(["palpated"]).unwrap().command.is_none());
        let cli = Cli::try_parse_from(["palpated", "simulate", "ventricle", "--json"]).unwrap();
        assert!(matches!(cli.command, Some(Command::Simulate(_))));
    }
}
