//! `palpated check`: what a scene's body is like, and what a tick costs on this machine.
use super::{load, simulate::Run, summary::TimeNumbers};
use palpate_physics::{Model, hybrid::Waking, material::Law, seed::region::Region};
use palpate_scene::{Scene, builtin_names, wording::counted};
use std::{
    process::ExitCode,
    time::{Duration, Instant},
};

/// Flags of `palpated check`.
#[derive(Debug, Clone, clap::Args)]
#[command(
    after_help = "Exit code: 0 when the scene loads and the body survives up to half a second of it (1 with --strict if it has warnings), else 1."
)]
pub struct CheckArgs {
    /// Scene file or name of a built-in scene
    #[arg(required_unless_present = "list")]
    pub scene: Option<String>,
    /// List the built-in scenes instead
    #[arg(long)]
    pub list: bool,
    /// Fail when there are warnings
    #[arg(long)]
    pub strict: bool,
}

/// Runs the command.
///
/// # Errors
/// A scene that does not load.
pub fn run(args: &CheckArgs) -> miette::Result<ExitCode> {
    let Some(name) = args.scene.as_deref().filter(|_| !args.list) else {
        println!("{}", builtin_names().join("\n"));
        return Ok(ExitCode::SUCCESS);
    };
    let scene = load::load_scene(name)?;
    let model = load::build(&scene)?;
    print_body(&scene);
    print_particles(&model);
    print_seed(&model);
    print_contents(&scene);
    for warning in &scene.warnings {
        println!("warning: {warning}");
    }
    // What counts is a tick that is computed, not one that is slept through.
    let cost = if scene.model.settings.sleep_tolerance_m > 0.0 {
        let mut awake = scene.clone();
        awake.model.settings.sleep_tolerance_m = 0.0;
        measure(&awake, &load::build(&awake)?)?
    } else {
        measure(&scene, &model)?
    };
    print_time(&model, &cost);
    print_memory();
    let failed = args.strict && !scene.warnings.is_empty();
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

/// Runs the scene for up to half a second of wall time, or its own duration.
fn measure(scene: &Scene, model: &Model) -> miette::Result<TimeNumbers> {
    const BUDGET: Duration = Duration::from_millis(500);
    let mut run = Run::new(scene, model)?;
    let started = Instant::now();
    loop {
        run.tick();
        run.refuse_quarantined()?;
        if started.elapsed() > BUDGET || run.state.time_s(model) >= scene.output.duration_s {
            return Ok(run.cost());
        }
    }
}

fn print_body(scene: &Scene) {
    let body = &scene.summary;
    let quality = &body.quality;
    println!("{}", [scene.name.as_str(), &scene.description].map(str::trim).join(": ").trim_end_matches([':', ' ']));
    println!("body       {}", body.origin);
    let surface = counted(body.surface_triangles, "surface triangle");
    println!("           {}, {}, {surface}", counted(body.tets, "tet"), counted(body.nodes, "node"));
    println!("           volume {} ml, mass {} g", short(body.volume_m3 * 1e6), short(body.mass_kg * 1e3));
    println!(
        "quality    dihedral angles {:.1}° to {:.1}°, volume-length ratio {:.3} at worst, {:.3} in the mean",
        quality.min_dihedral_deg, quality.max_dihedral_deg, quality.min_volume_length, quality.mean_volume_length
    );
    println!("           edges {:.3} to {:.3} mm", quality.edge_range_m.0 * 1e3, quality.edge_range_m.1 * 1e3);
    for line in &body.fill_report {
        println!("           {line}");
    }
    for part in &body.parts {
        let sets = [(part.nodes, "node"), (part.triangles, "triangle"), (part.tets, "tet")];
        println!("region     {:<16} {}", part.name, sets.map(|(count, what)| counted(count, what)).join(", "));
    }
    for region in &scene.model.regions {
        let lame = region.material.lame;
        println!(
            "material   {:<16} {}, E {} Pa, nu {}, {} kg/m3",
            region.name,
            law(region.material.law),
            short(lame.young_modulus_pa()),
            short(lame.poisson_ratio()),
            region.density_kg_per_m3
        );
    }
}

fn print_particles(model: &Model) {
    let (Some(hybrid), Some(spec)) = (model.hybrid(), &model.spec().particles) else { return };
    let cage = hybrid.cage();
    println!(
        "particles  {}, {} mm apart, at most {} awake; skin of {}",
        hybrid.partition().particle_count(),
        short(spec.spacing_m * 1e3),
        spec.most_active,
        counted(spec.skin.triangles().len(), "triangle")
    );
    if let Some(depth_m) = spec.fine_depth_m {
        let doubled = hybrid.partition().cells().iter().filter(|cell| cell.doubled).count();
        println!(
            "           {} mm apart deeper than {} mm ({} of {})",
            short(spec.spacing_m * 2e3),
            short(depth_m * 1e3),
            doubled,
            counted(hybrid.partition().cells().len(), "cell")
        );
    }
    if let Waking::ByTools { reach_m } = spec.waking {
        println!("           those within {} mm of a tool's contact wake", short(reach_m * 1e3));
    }
    println!(
        "           the coarse tets' surface was moved by up to {} mm to hold them; {} outside never wake",
        short(cage.moved_m * 1e3),
        cage.outside
    );
}

/// Of the papers' hybrid.
fn print_seed(model: &Model) {
    let Some(seed) = model.seed() else { return };
    let parameters = seed.parameters();
    println!("seed       the papers' own hybrid; steps of {} ms", short(parameters.dt_s * 1e3));
    if let Some(layer) = seed.layer() {
        let spacing_m = layer.voxels.spacing_m;
        let sizes = seed.regions().iter().map(Region::len);
        println!(
            "particles  {}, {} mm apart; {} to {} awake, {:.0} on average over {}",
            layer.particle_count(),
            short(spacing_m * 1e3),
            sizes.clone().min().unwrap_or_default(),
            seed.most_awake(),
            sizes.sum::<usize>() as f64 / seed.regions().len() as f64,
            counted(seed.regions().len(), "triangle")
        );
        println!(
            "           waves cross a spacing in {} ms, by the papers' formula in {} ms",
            short(parameters.courant_s(spacing_m) * 1e3),
            short(parameters.courant_as_printed_s(spacing_m) * 1e3)
        );
    }
}

fn print_time(model: &Model, cost: &TimeNumbers) {
    let period_us = cost.tick_period_s * 1e6;
    println!(
        "time       tick {} ms, {}; highest natural frequency {} Hz",
        short(period_us * 1e-3),
        counted(cost.substeps_per_tick as usize, "substep"),
        short(model.max_natural_frequency_rad_per_s() / std::f64::consts::TAU)
    );
    let us = cost.tick_wall_us;
    let build = if cfg!(debug_assertions) { ", in an UNOPTIMISED build" } else { "" };
    println!(
        "           a tick costs {:.1} us here (p99 {:.1} us over {}{build})",
        us.p50,
        us.p99,
        counted(cost.ticks as usize, "tick")
    );
    let verdict = if us.p50 > 0.8 * period_us {
        "does NOT fit: coarsen the mesh or lengthen tick_period_s"
    } else if us.p99 > period_us {
        "fits, but other work on this machine held up more than one tick in a hundred"
    } else {
        "fits"
    };
    println!("           {:.1} % of the tick: {verdict}", 100.0 * us.p50 / period_us);
}

/// What this process holds of the machine's memory, the body and its buffers being most of it.
fn print_memory() {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB"));
    if let Some(kilobytes) = resident.and_then(|text| text.trim().parse::<f64>().ok()) {
        println!("memory     {:.0} MB in this process", kilobytes * 1.024e-3);
    }
}

fn print_contents(scene: &Scene) {
    let held: usize = scene.model.prescribed.iter().map(|set| set.nodes.len()).sum();
    let loads = counted(scene.model.loads.len(), "load");
    match scene.model.prescribed.len() {
        0 => println!("held       nothing; {loads}"),
        1 => println!("held       {}; {loads}", counted(held, "node")),
        sets => println!("held       {} in {}; {loads}", counted(held, "node"), counted(sets, "set")),
    }
    for (tool, driver) in scene.model.tools.iter().zip(&scene.drivers) {
        let driver = match driver {
            palpate_scene::Driver::Device => "a device",
            palpate_scene::Driver::Trajectory(_) => "a trajectory",
            palpate_scene::Driver::Script(_) => "a script",
        };
        println!("tool       {:<16} radius {:.3} mm, driven by {driver}", tool.name, tool.radius_m * 1e3);
    }
    let probes: Vec<&str> = scene.probes.iter().map(palpate_scene::Probe::name).collect();
    println!("probes     {}", if probes.is_empty() { "none".to_owned() } else { probes.join(", ") });
}

/// A law as scenes name it.
fn law(law: Law) -> &'static str {
    match law {
        Law::StVenantKirchhoff => "stvk",
        Law::StableNeoHookean => "stable-neo-hookean",
        Law::FixedCorotated => "fixed-corotated",
    }
}

/// Four significant digits, without the zeros behind them.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_they_need() {
        let cases = [
            (256.0, "256"),
            (3614.465, "3614"),
            (0.45, "0.45"),
            (4999.6, "5000"),
            (1e4, "10000"),
            (1.5e9, "1.5e9"),
            (0.0, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
    }
}
