//! `palpate-lab`: run time beside error.
use clap::{Parser, Subcommand};
use palpate_lab::{
    deep, fine_levels, hashes, hearts, in_time, jitter, locking, references, report, ripple, skips, stress, subdivision,
};

#[derive(Parser)]
#[command(
    name = "palpate-lab",
    about = "Run time beside error: problems, references and benchmark tables of Palpate's physics"
)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Runs methods on problems and writes report.html and results.csv
    Run(report::Options),
    /// What got slower or less accurate between two results.csv, beyond noise; exit code 1 then
    Compare(report::CompareOptions),
    /// Makes the problems' reference answers, where they are missing, and prints them
    References(references::Options),
    /// Cost of the force kernel per tet and of a tick per body, each with its error or its aim
    Table,
    /// How late a 1 kHz loop wakes and what its ticks cost, with a pressed body in it, beside `cyclictest`
    ///
    /// The two take turns, so that a slow moment of the machine strikes both. Run it as a user with real-time privileges, on
    /// a machine that is doing what it will do in use.
    Jitter(jitter::Options),
    /// Numerical stress: every row with its pass criterion
    Stress(stress::Command),
    /// What a hybrid body's fine level may be made of, on every body and number of particles, at rest against the references: some minutes
    FineLevels(fine_levels::Options),
    /// Haptic subdivision's experiment: figures 5 to 11 as plots and data
    ///
    /// A sheet of springs pulled at one vertex, before and after one ring or two about it are refined: which constants make it feel the same.
    Subdivision(subdivision::Options),
    /// How much too stiff tets are, linear and smoothed, by Poisson's ratio and size: a block pressed by patches and spheres, some 20 minutes
    Locking,
    /// Force against depth of a block with particles that a sphere on a spring presses two radii deep, beside the reference's: some minutes a depth
    Deep(deep::Options),
    /// How much the force on a tool ripples with the particles beneath it, by their spacing: a block dragged over and pressed by spheres: some minutes
    Ripple,
    /// What ticks of irregular hearts cost: at rest, pressed and dragged, and swaying after it
    Hearts(hearts::Options),
    /// How far bodies are off in time: their natural frequencies, and how stiff they are under a patch that swings, by frequency: some minutes
    InTime,
    /// What a tick takes with each thing left out that a scene does not need, and without: some minutes
    Skips,
    /// Makes the two surfaces of the heart that is shipped (deploy/scenes/heart.toml)
    HeartSurfaces(hearts::ShippedOptions),
    /// Whether every bit of every scene is as it was (tests/lab/records/hashes.txt); exit code 1 if not
    Hashes(hashes::Options),
}

fn main() -> miette::Result<()> {
    match Arguments::parse().command {
        Command::Run(options) => report::run(&options),
        Command::Compare(options) => report::run_compare(&options),
        Command::References(options) => references::run(&options),
        Command::Table => palpate_lab::table::print(),
        Command::Jitter(options) => jitter::print(&options),
        Command::Stress(command) => stress::run(&command),
        Command::FineLevels(options) => fine_levels::run(&options),
        Command::Subdivision(options) => subdivision::run(&options),
        Command::Locking => locking::print(),
        Command::Deep(options) => deep::print(&options),
        Command::Ripple => ripple::print(),
        Command::Hearts(options) => hearts::print(&options),
        Command::InTime => in_time::print(),
        Command::Skips => skips::print(),
        Command::HeartSurfaces(options) => hearts::write_shipped(&options),
        Command::Hashes(options) => hashes::run(&options),
    }
}
