//! The command line: subcommands and their flags, parsed once into types.
use crate::{offline, serve, who};
use clap::{CommandFactory, Parser, Subcommand, error::ErrorKind};
use std::{ffi::OsString, path::Path, process::ExitCode};

const EXAMPLES: &str = "\
Examples:
  palpated                                  serve the built-in heart, pressed by a simulated arm
  palpated serve my-organ.toml              serve your own scene
  palpated check my-organ.toml              what the body is like, and how long a tick takes here
  palpated fit-budget my-organ.toml         choose what its body has particles and tets for, by what a tick may take
  palpated simulate ventricle --out run     run headless: probes as CSV, frames as VTU, a JSON summary
  palpated static cantilever --out rest     find the equilibrium instead of integrating in time
  palpated schema > palpate-scene.json      JSON schema of scene files, for editors
  palpated pki init --host lab-7            keys for a daemon on a network; then serve --pki and --listen

Scenes are TOML files (docs/scenes.md), or names of built-in ones: palpated check --list.
Logs: PALPATE_LOG=debug says more, PALPATE_LOG_FORMAT=json writes lines of JSON.";

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
    Serve(Box<serve::args::ServeArgs>),
    /// Run a scene headless, as fast as it goes, and write what it measured
    Simulate(offline::simulate::SimulateArgs),
    /// Find the equilibrium of a scene under its final loads, and write the same files
    Static(offline::equilibrium::StaticArgs),
    /// Load a scene and say what its body is like and what a tick costs
    Check(offline::check::CheckArgs),
    /// Choose the particles' spacing, how many may be awake and the coarse tets by what a tick may take here
    FitBudget(offline::fit_budget::FitBudgetArgs),
    /// Find spring constants over displacement for a scene's refined mass-spring surface, and keep them beside it
    Calibrate(offline::calibrate::CalibrateArgs),
    /// Print the JSON schema of scene files
    Schema,
    /// Make keys for a daemon on a network, and say who may do what
    Pki(who::commands::PkiArgs),
}

impl Cli {
    /// Reads a command line, the program's name first. A misspelt command is told as such, and not taken for a scene to serve.
    ///
    /// # Errors
    /// What clap shows: a mistake, or the help that was asked for.
    pub fn read(arguments: Vec<OsString>) -> Result<Self, clap::Error> {
        if let Some((word, near)) = arguments.get(1).and_then(|word| misspelt(word.to_str()?)) {
            let message = format!("there is no command '{word}'; did you mean '{near}'?");
            return Err(Self::command().error(ErrorKind::InvalidSubcommand, message));
        }
        Self::try_parse_from(arguments)
    }

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
            Some(Command::FitBudget(args)) => offline::fit_budget::run(&args),
            Some(Command::Calibrate(args)) => offline::calibrate::run(&args),
            Some(Command::Schema) => offline::schema::run(),
            Some(Command::Pki(args)) => who::commands::run(&args),
        }
    }
}

/// A word that is nearly a command, and neither a scene nor a path; and that command.
fn misspelt(word: &str) -> Option<(&str, String)> {
    let is_other = word.contains(['-', '.', '/']) || Path::new(word).exists() || palpate_scene::builtin(word).is_some();
    let commands = Cli::command();
    let names = commands.get_subcommands().map(clap::Command::get_name).chain(["help"]);
    let likeness = |name: &str| strsim::jaro_winkler(word, name);
    let near = names
        .max_by(|a, b| likeness(a).total_cmp(&likeness(b)))
        .filter(|near| likeness(near) > 0.8 && *near != word)?;
    (!is_other).then(|| (word, near.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    /// `palpated chek` looked for a scene of that name.
    #[test]
    fn a_misspelt_command_is_answered_with_the_nearest() {
        let read = |words: &[&str]| {
            let words = ["palpated"].iter().chain(words).map(OsString::from).collect();
            Cli::read(words).map_err(|error| error.to_string())
        };
        for (words, near) in
            [(&["chek"][..], "check"), (&["simulat", "ventricle", "--json"], "simulate"), (&["sheme"], "schema")]
        {
            let message = read(words).unwrap_err();
            assert!(message.contains(&format!("did you mean '{near}'?")), "{message}");
        }
        for scene in ["ventricle", "organ", "check.toml", "./simulat"] {
            assert_eq!(read(&[scene]).unwrap().serve.scene, scene);
        }
        assert!(matches!(read(&["check", "ventricle"]).unwrap().command, Some(Command::Check(_))));
    }
}
