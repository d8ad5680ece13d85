//! `palpated check`: what a scene's body is like, and what a tick costs on this machine.
use super::{
    check_laws, check_tools,
    cost::{self, Cost},
    load,
    say::say,
    summary::Percentiles,
};
use crate::{bodies::served, tick_budget::USABLE};
use palpate_physics::Model;
use palpate_scene::{
    Scene, builtin_names,
    wording::{counted, short},
};
use std::process::ExitCode;

/// Flags of `palpated check`.
#[derive(Debug, Clone, clap::Args)]
#[command(after_help = "\
Exit code: 0 when the scene loads and the body survives up to half a second of it, and a hybrid body then its first \
tool in a light touch (1 with --strict if it has warnings), else 1.")]
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
        say(format_args!("{}", builtin_names().join("\n")));
        return Ok(ExitCode::SUCCESS);
    };
    let scene = load::load_scene(name)?;
    print_body(&scene);
    let warn = |warning: &String| say(format_args!("warning: {warning}"));
    let model = load::build(&scene).inspect_err(|_| scene.warnings.iter().for_each(warn))?;
    let body = served(&model);
    body.description(&model).iter().for_each(|line| say(format_args!("{line}")));
    print_contents(&scene, &model);
    print_walls(&model);
    let warnings = [scene.warnings.clone(), body.warnings(&model), check_laws::warnings(&scene, &model)].concat();
    warnings.iter().for_each(warn);
    let cost = cost::measure(&scene, &model)?;
    if let Some(least) = &cost.inverted {
        say(format_args!(
            "warning: elements turned inside out in the ticks that were run to time them: {least}. No real body does that; press or load \
             less hard, or look for constants in the wrong unit"
        ));
    }
    print_time(&model, &cost);
    print_memory();
    let failed = args.strict && (!warnings.is_empty() || cost.inverted.is_some());
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn print_body(scene: &Scene) {
    let body = &scene.summary;
    say(format_args!(
        "{}",
        [scene.name.as_str(), &scene.description].map(str::trim).join(": ").trim_end_matches([':', ' '])
    ));
    say(format_args!("body       {}", body.origin));
    let surface = counted(body.surface_triangles, "surface triangle");
    say(format_args!("           {}, {}, {surface}", counted(body.tets, "tet"), counted(body.nodes, "node")));
    if let Some(quality) = &body.quality {
        say(format_args!("           volume {} ml, mass {} g", short(body.volume_m3 * 1e6), short(body.mass_kg * 1e3)));
        say(format_args!(
            "quality    dihedral angles {:.1}° to {:.1}°, volume-length ratio {:.3} at worst, {:.3} in the mean",
            quality.min_dihedral_deg, quality.max_dihedral_deg, quality.min_volume_length, quality.mean_volume_length
        ));
        say(format_args!(
            "           edges {:.3} to {:.3} mm",
            quality.edge_range_m.0 * 1e3,
            quality.edge_range_m.1 * 1e3
        ));
    } else {
        say(format_args!("           mass {} g", short(body.mass_kg * 1e3)));
    }
    for line in &body.fill_report {
        say(format_args!("           {line}"));
    }
    for part in &body.parts {
        let sets = [(part.nodes, "node"), (part.triangles, "triangle"), (part.tets, "tet")];
        say(format_args!("region     {:<16} {}", part.name, sets.map(|(count, what)| counted(count, what)).join(", ")));
    }
    for region in scene.model.body.solid().map_or(&[][..], |solid| &solid.regions) {
        let lame = region.material.lame;
        say(format_args!(
            "material   {:<16} {}, E {} Pa, nu {}, {} kg/m3",
            region.name,
            region.material.law.name(),
            short(lame.young_modulus_pa()),
            short(lame.poisson_ratio()),
            region.density_kg_per_m3
        ));
    }
}

fn print_time(model: &Model, cost: &Cost) {
    let period_us = cost.all.tick_period_s * 1e6;
    let for_viscosity = model.substeps_for_viscosity();
    let viscous = if for_viscosity > 2.0 {
        format!(" ({} times as many as without viscosity)", short(for_viscosity))
    } else {
        String::new()
    };
    say(format_args!(
        "time       tick {} ms, {}{viscous}; highest natural frequency {} Hz",
        short(period_us * 1e-3),
        counted(cost.all.substeps_per_tick as usize, "substep"),
        short(model.body().max_natural_frequency_rad_per_s() / std::f64::consts::TAU)
    ));
    let line = |us: &Percentiles, ticks: u64, with: &str| {
        let build = if cfg!(debug_assertions) { ", in an UNOPTIMISED build" } else { "" };
        let ticks = counted(ticks as usize, "tick");
        say(format_args!(
            "           a tick{with} costs {:.1} us here (p99 {:.1} us over {ticks}{build})",
            us.p50, us.p99
        ));
    };
    line(&cost.all.tick_wall_us, cost.all.ticks, "");
    let deciding = cost.awake.as_ref().map_or(&cost.all.tick_wall_us, |awake| &awake.tick_wall_us);
    if let Some(awake) = &cost.awake {
        let how = awake.touched_m.map_or_else(String::new, |touched_m| {
            format!(", the first tool pressed {} mm into the body,", short(touched_m * 1e3))
        });
        line(&awake.tick_wall_us, awake.ticks, &format!(" with up to {} particles awake{how}", awake.most));
    }
    say(format_args!(
        "           {:.1} % of the tick: {}",
        100.0 * deciding.p50 / period_us,
        verdict(deciding, period_us, cost)
    ));
}

fn verdict(us: &Percentiles, period_us: f64, cost: &Cost) -> String {
    let awake = cost.awake.is_some();
    if us.p50 > USABLE * period_us {
        let lighter = if awake {
            "lower most_active, or raise spacing_m or tick_period_s"
        } else {
            "coarsen the mesh or lengthen tick_period_s"
        };
        return format!(
            "does NOT fit into the {:.0} % that it may take: {lighter}; or other work held this machine up",
            100.0 * USABLE
        );
    }
    let late = us.p99 > period_us;
    let fits = match (late, awake) {
        (true, true) => {
            "fits, but for more than one tick in a hundred: particles switched in them, or other work held this machine up"
        }
        (true, false) => "fits, but other work on this machine held up more than one tick in a hundred",
        (false, _) => "fits",
    };
    fits.to_owned()
}

/// Whether walls of the body press each other where they meet.
fn print_walls(model: &Model) {
    if !model.has_self_contact() {
        say(format_args!("walls      pass through each other where they meet"));
        return;
    }
    say(format_args!("walls      press each other where they meet"));
    if model.wall_triangles() < model.surface().triangles.len() {
        let triangles = counted(model.wall_triangles(), "triangle");
        say(format_args!(
            "           they are made of {triangles}, whose edges are about as long as particles are apart"
        ));
    }
    let left_out = model.vertices_against_themselves();
    if left_out > 0 {
        say(format_args!("           {left_out} of its vertices do not: the body lies against itself there at rest"));
    }
}

/// What this process holds of the machine's memory, the body and its buffers being most of it.
fn print_memory() {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let resident = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.trim().strip_suffix(" kB"));
    if let Some(kilobytes) = resident.and_then(|text| text.trim().parse::<f64>().ok()) {
        say(format_args!("memory     {:.0} MB in this process", kilobytes * 1.024e-3));
    }
}

fn print_contents(scene: &Scene, model: &Model) {
    let held: usize = scene.model.prescribed.iter().map(|set| set.nodes.len()).sum();
    let loads = counted(scene.model.loads.len(), "load");
    match scene.model.prescribed.len() {
        0 => say(format_args!("held       nothing; {loads}")),
        1 => say(format_args!("held       {}; {loads}", counted(held, "node"))),
        sets => say(format_args!("held       {} in {}; {loads}", counted(held, "node"), counted(sets, "set"))),
    }
    for line in check_tools::lines(scene, model) {
        say(format_args!("{line}"));
    }
    let probes: Vec<&str> = scene.probes.iter().map(palpate_scene::Probe::name).collect();
    say(format_args!("probes     {}", if probes.is_empty() { "none".to_owned() } else { probes.join(", ") }));
}
