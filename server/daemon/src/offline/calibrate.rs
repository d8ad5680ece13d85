//! `palpated calibrate`: spring constants over displacement for a scene's refined surface, found on the surface itself.
use super::say::say;
use crate::progress::Progress;
use miette::{IntoDiagnostic, Report, WrapErr};
use palpate_physics::bodies::mass_spring::constants_table::{Calibration, ConstantsTable};
use palpate_scene::{Limits, ToCalibrate};
use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

/// Flags of `palpated calibrate`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
The scene has [body.springs] and, in [body.springs.refine], `rings` and `table_file`: the table is written there, beside the scene.

What is matched is the force of one vertex that is displaced, so that a tool which touches little else feels what it felt on the coarse \
surface; one that touches many feels them too stiff. To come near to a surface that is fine everywhere, write constants = \"area\" instead. \
Where the vertices tried differ much (`spread`), no table suits all of the surface.")]
pub struct CalibrateArgs {
    /// Scene file
    pub scene: PathBuf,
    /// K'_m/K'_h of the refined springs; that of the coarse ones by default
    #[arg(long)]
    pub ratio: Option<f64>,
    /// How many vertices of the surface are tried
    #[arg(long, default_value_t = 12)]
    pub samples: usize,
    /// Overwrite a table that is there
    #[arg(long)]
    pub force: bool,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load or asks for no table, constants that cannot be found, or a file that cannot be written.
pub fn run(args: &CalibrateArgs) -> miette::Result<ExitCode> {
    if !args.scene.exists() && palpate_scene::builtin(&args.scene.display().to_string()).is_some() {
        return Err(miette::miette!(
            help = "copy its file from deploy/scenes, and give the copy",
            "\"{}\" is built in: there is no folder for its table",
            args.scene.display()
        ));
    }
    let ToCalibrate { surface, coarse, rings, table } =
        palpate_scene::to_calibrate(&args.scene, &Limits::local()).map_err(Report::new)?;
    if table.exists() && !args.force {
        return Err(miette::miette!(help = "add --force to overwrite it", "{} is there already", table.display()));
    }
    let ratio = args.ratio.unwrap_or(coarse.mesh_n_per_m / coarse.anchor_n_per_m);
    let of = Calibration { coarse, rings, ratio, samples: args.samples };
    let mut bar = Progress::new(&args.scene.display().to_string());
    let found = ConstantsTable::calibrate(&surface, of, &mut |part| bar.show(part, "calibrating"));
    bar.finish();
    let found = found.into_diagnostic().wrap_err("there is no table for this surface")?;
    write(&found, &table)?;
    say(format_args!(
        "K'_h and K'_m = {ratio:.4} K'_h of {rings} refined rings, over displacement x/L, L the edges' mean length:"
    ));
    say(format_args!("     x/L   K'_h/K_h     K'_h (N/m)   spread   energy"));
    for row in &found.rows {
        say(format_args!(
            "  {:6.2} {:10.4} {:14.4} {:7.1} % {:8.3}",
            row.xi,
            row.anchor_ratio,
            row.anchor_ratio * coarse.anchor_n_per_m,
            100.0 * row.spread,
            row.energy_ratio
        ));
    }
    say(format_args!(
        "spread: how far the farthest of the vertices tried is off; energy: refined over coarse, at the same force"
    ));
    say(format_args!("written to {}", table.display()));
    Ok(ExitCode::SUCCESS)
}

fn write(found: &ConstantsTable, path: &Path) -> miette::Result<()> {
    let text = serde_json::to_string_pretty(found).into_diagnostic()?;
    std::fs::write(path, text + "\n").into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))
}
