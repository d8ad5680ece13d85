//! `palpated check`: what a scene's body is like, and what a tick costs on this machine.
use super::{
    cost::{self, Cost},
    load,
    summary::Percentiles,
};
use palpate_physics::{
    Model,
    bodies::{
        hybrid::Waking,
        mass_spring::{Refinement, region::Constants},
        seed::region::Region,
    },
};
use palpate_scene::{Scene, builtin_names, wording::counted};
use std::process::ExitCode;

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
    print_springs(&model);
    print_contents(&scene);
    let warnings = [scene.warnings.clone(), particle_warnings(&model)].concat();
    for warning in &warnings {
        println!("warning: {warning}");
    }
    print_time(&model, &cost::measure(&scene, &model)?);
    print_memory();
    let failed = args.strict && !warnings.is_empty();
    Ok(if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS })
}

fn print_body(scene: &Scene) {
    let body = &scene.summary;
    let quality = &body.quality;
    println!("{}", [scene.name.as_str(), &scene.description].map(str::trim).join(": ").trim_end_matches([':', ' ']));
    println!("body       {}", body.origin);
    let surface = counted(body.surface_triangles, "surface triangle");
    println!("           {}, {}, {surface}", counted(body.tets, "tet"), counted(body.nodes, "node"));
    if body.tets > 0 {
        println!("           volume {} ml, mass {} g", short(body.volume_m3 * 1e6), short(body.mass_kg * 1e3));
        println!(
            "quality    dihedral angles {:.1}° to {:.1}°, volume-length ratio {:.3} at worst, {:.3} in the mean",
            quality.min_dihedral_deg, quality.max_dihedral_deg, quality.min_volume_length, quality.mean_volume_length
        );
        println!("           edges {:.3} to {:.3} mm", quality.edge_range_m.0 * 1e3, quality.edge_range_m.1 * 1e3);
    } else {
        println!("           mass {} g", short(body.mass_kg * 1e3));
    }
    for line in &body.fill_report {
        println!("           {line}");
    }
    for part in &body.parts {
        let sets = [(part.nodes, "node"), (part.triangles, "triangle"), (part.tets, "tet")];
        println!("region     {:<16} {}", part.name, sets.map(|(count, what)| counted(count, what)).join(", "));
    }
    for region in scene.model.body.solid().map_or(&[][..], |solid| &solid.regions) {
        let lame = region.material.lame;
        println!(
            "material   {:<16} {}, E {} Pa, nu {}, {} kg/m3",
            region.name,
            region.material.law.name(),
            short(lame.young_modulus_pa()),
            short(lame.poisson_ratio()),
            region.density_kg_per_m3
        );
    }
}

fn print_particles(model: &Model) {
    let Some(hybrid) = model.body().as_hybrid() else { return };
    let spec = hybrid.particles();
    let embedding = hybrid.embedding();
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
        short(embedding.moved_m * 1e3),
        embedding.outside
    );
    println!(
        "           coarse level of {}; {:.0} % of the volume is in whole cells, the surface cuts the others",
        counted(hybrid.node_count(), "node"),
        100.0 * hybrid.partition().whole_part()
    );
}

/// What one would want to change, of a hybrid body.
fn particle_warnings(model: &Model) -> Vec<String> {
    /// Of the volume in whole cells: less is a lattice that hardly sees the body.
    const FEW_WHOLE: f64 = 0.2;
    /// Of the particles outside the coarse tets.
    const MANY_OUTSIDE: f64 = 0.1;
    let Some(hybrid) = model.body().as_hybrid() else { return Vec::new() };
    let spec = hybrid.particles();
    let partition = hybrid.partition();
    let mut warnings = Vec::new();
    if partition.whole_part() < FEW_WHOLE {
        warnings.push(format!(
            "only {:.0} % of the volume is in whole cells: particles {} mm apart are coarse for this body; lower their spacing in [body.particles]",
            100.0 * partition.whole_part(),
            short(spec.spacing_m * 1e3)
        ));
    }
    let outside = hybrid.embedding().outside;
    if outside as f64 > MANY_OUTSIDE * partition.particle_count() as f64 {
        warnings.push(format!(
            "{outside} of {} particles are outside the coarse tets and never wake: where they are, the body answers as coarsely as its tets; ask for more tets",
            partition.particle_count()
        ));
    }
    if spec.fine_depth_m.is_some() && !partition.cells().iter().any(|cell| cell.doubled) {
        warnings.push(
            "fine depth in [body.particles]: no cell is of twice the spacing, the body is too thin for any deeper down; leave the key out"
                .to_owned(),
        );
    }
    warnings
}

/// Of the papers' hybrid.
fn print_seed(model: &Model) {
    let Some(seed) = model.body().as_seed().map(palpate_physics::bodies::seed::SeedBody::model) else { return };
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

/// Of a mass-spring surface.
fn print_springs(model: &Model) {
    let Some(body) = model.body().as_mass_spring() else { return };
    let spec = body.model().spec();
    let of = |constants: &Constants| {
        format!("K_m {} N/m, K_h {} N/m", short(constants.mesh_n_per_m), short(constants.home_n_per_m))
    };
    println!("springs    {}; edges {} mm long in the mean", of(&spec.coarse), short(body.edge_m() * 1e3));
    match body.refinement() {
        None => println!("           coarse everywhere"),
        Some(Refinement { rings, fade_s, .. }) => println!(
            "           {} around what is touched are refined within {} s: at most {}",
            counted(rings as usize, "ring"),
            short(fade_s),
            of(&spec.fine)
        ),
    }
    if body.is_all_awake() {
        println!("           all vertices are awake always");
    } else {
        println!("           the {} vertices nearest to tools are awake", spec.most_awake);
    }
}

fn print_time(model: &Model, cost: &Cost) {
    let period_us = cost.all.tick_period_s * 1e6;
    println!(
        "time       tick {} ms, {}; highest natural frequency {} Hz",
        short(period_us * 1e-3),
        counted(cost.all.substeps_per_tick as usize, "substep"),
        short(model.body().max_natural_frequency_rad_per_s() / std::f64::consts::TAU)
    );
    let line = |us: &Percentiles, ticks: u64, with: &str| {
        let build = if cfg!(debug_assertions) { ", in an UNOPTIMISED build" } else { "" };
        let ticks = counted(ticks as usize, "tick");
        println!("           a tick{with} costs {:.1} us here (p99 {:.1} us over {ticks}{build})", us.p50, us.p99);
    };
    line(&cost.all.tick_wall_us, cost.all.ticks, "");
    let deciding = cost.awake.as_ref().map_or(&cost.all.tick_wall_us, |awake| &awake.tick_wall_us);
    if let Some(awake) = &cost.awake {
        let how = if awake.untouched { ", nothing touching them," } else { "" };
        line(&awake.tick_wall_us, awake.ticks, &format!(" with up to {} particles awake{how}", awake.most));
    }
    println!(
        "           {:.1} % of the tick: {}",
        100.0 * deciding.p50 / period_us,
        verdict(deciding, period_us, cost)
    );
}

fn verdict(us: &Percentiles, period_us: f64, cost: &Cost) -> &'static str {
    let awake = cost.awake.is_some();
    if us.p50 > 0.8 * period_us {
        if awake {
            "does NOT fit: lower most_active, or raise spacing_m or tick_period_s"
        } else {
            "does NOT fit: coarsen the mesh or lengthen tick_period_s"
        }
    } else if us.p99 > period_us {
        if awake {
            "fits, but for more than one tick in a hundred: particles switched in them, or other work held this machine up"
        } else {
            "fits, but other work on this machine held up more than one tick in a hundred"
        }
    } else {
        "fits"
    }
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
