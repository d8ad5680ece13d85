//! Force against depth, beyond the bench: a block with particles that a sphere on a spring presses two radii deep, beside the
//! lab's triquadratic hexahedra (`docs/measurements/deep-press.md`).
//!
//! The scene `hybrid-block`, its tool on a virtual coupling and without friction, its device going down slowly; the depth is that of
//! the tool, not of the device. The reference is a rigid sphere on the same block and law at each depth.
use crate::{
    press::Slow,
    problems::body::BLOCK_M,
    reference::{
        bodies,
        newton::{Action, solve_through},
        solid::Solid,
        sphere::Sphere,
    },
    references::limit,
};
use clap::Args;
use glam::DVec3;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result, ensure, miette};
use palpate_physics::{Model, ModelSpec, contact::Coupling, material::Material};
use palpate_scene::Limits;
use std::time::Duration;

/// Depths (mm), to half of the block's height.
const DEPTHS_MM: [f64; 8] = [2.5, 5.0, 7.5, 10.0, 12.5, 15.0, 17.5, 20.0];
/// Elements of the reference over one and a half radii of the contact at the deepest of them.
const GRIDS: [usize; 3] = [4, 5, 6];
/// κ of the reference's sphere over `E/((1 − ν²)√(Rδ))`.
const PENALTY: f64 = 1e3;
/// The coupling: stiffness (N/m), damping (N s/m) and mass (kg).
const COUPLING: Coupling = Coupling::Spring { stiffness_n_per_m: 800.0, damping_n_s_per_m: 4.0, mass_kg: 0.05 };
const RADIUS_M: f64 = 10e-3;
/// Speed (m/s) of the device, and the way (m) that it goes at most.
const SPEED_M_PER_S: f64 = 0.01;
const MOST_WAY_M: f64 = 0.045;

/// At which depths the force is compared.
#[derive(Debug, Clone, Args)]
pub struct Options {
    /// Depths in mm, to half of the block's height of 40 mm
    #[arg(default_values_t = DEPTHS_MM)]
    depths_mm: Vec<f64>,
}

/// Measures and prints, as the rows of a table.
///
/// # Errors
/// A scene that is refused, or a depth that is none.
pub fn print(options: &Options) -> Result<()> {
    let deepest_mm = 0.5e3 * BLOCK_M[1];
    let is_meant = |depth_mm: &f64| *depth_mm > 0.0 && *depth_mm <= deepest_mm;
    ensure!(options.depths_mm.iter().all(is_meant), "depths have to be above 0 and at most {deepest_mm} mm");
    let mut depths_m: Vec<f64> = options.depths_mm.iter().map(|mm| 1e-3 * mm).collect();
    depths_m.sort_by(f64::total_cmp);
    let bar = ProgressBar::new(GRIDS.len() as u64);
    bar.set_style(ProgressStyle::with_template("{pos}/{len} {elapsed} {prefix} {msg}").into_diagnostic()?);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar.set_message("pressing the hybrid");
    let (model, material) = block()?;
    let pressed = press(&model, MOST_WAY_M);
    println!(
        "coupling saturates at {:.2} N; deepest {:.2} mm",
        model.contact().force_limit_n(0),
        pressed.last().map_or(0.0, |(depth_m, _)| 1e3 * depth_m)
    );
    bar.reset();
    let mut grids = Vec::new();
    for n in GRIDS {
        bar.set_prefix(format!("n = {n}"));
        let (forces_n, ended) = on_grid(n, &material, &depths_m, &mut |text| bar.set_message(text.to_owned()))?;
        if let Some(why) = ended {
            bar.suspend(|| println!("n = {n}: {why}"));
        }
        grids.push(forces_n);
        bar.inc(1);
    }
    bar.finish_and_clear();
    println!("| depth | hexahedra: {} | limit | hybrid | off by |", GRIDS.map(|n| format!("n = {n}")).join(" | "));
    println!("|---|---|---|---|---|---|---|");
    for (number, depth_m) in depths_m.iter().enumerate() {
        let of_grids: Vec<Option<f64>> = grids.iter().map(|forces_n| forces_n.get(number).copied()).collect();
        let limit = match of_grids[..] {
            [Some(first), Some(second), Some(third)] => {
                Some(limit([first, second, third], GRIDS.map(|n| 1.0 / n as f64)))
            }
            _ => None,
        };
        let force_n = at_depth(&pressed, *depth_m);
        let off = force_n.zip(limit).map(|(force_n, limit)| 100.0 * (force_n / limit.value - 1.0));
        let of_grids = of_grids.into_iter().map(|force_n| told(force_n, |n| format!("{n:.4} N")));
        println!(
            "| {} mm | {} | {} | {} | {} |",
            1e3 * depth_m,
            of_grids.collect::<Vec<_>>().join(" | "),
            told(limit, |limit| format!("{:.4} ± {:.4} N", limit.value, limit.uncertainty)),
            told(force_n, |n| format!("{n:.4} N")),
            told(off, |off| format!("{off:+.1} %")),
        );
    }
    Ok(())
}

fn told<T>(value: Option<T>, as_text: impl Fn(T) -> String) -> String {
    value.map_or_else(|| "not reached".into(), as_text)
}

/// The forces (N) of a reference on one grid at each of the depths (m), as far as it comes, and why it comes no farther.
fn on_grid(
    n: usize,
    material: &Material,
    depths_m: &[f64],
    tell: &mut dyn FnMut(&str),
) -> Result<(Vec<f64>, Option<String>)> {
    let deepest_m = depths_m.last().copied().unwrap_or_default();
    let contact_m = (RADIUS_M * deepest_m).sqrt();
    let body = bodies::block(BLOCK_M[0], BLOCK_M[1], contact_m, n);
    let solid = Solid::new(body.grid.clone(), *material)?;
    let modulus_pa = material.lame.young_modulus_pa() / (1.0 - material.lame.poisson_ratio().powi(2));
    let penalty_pa_per_m = PENALTY * modulus_pa / contact_m;
    let sphere = Sphere::new(&solid.grid, solid.grid.faces(body.touched), body.normal, RADIUS_M, penalty_pa_per_m);
    let action = Action::Sphere { sphere, depth_m: deepest_m };
    let parts: Vec<f64> = depths_m.iter().map(|depth_m| depth_m / deepest_m).collect();
    let mut forces_n = Vec::new();
    let ended = solve_through(&solid, &body, &action, &parts, tell, &mut |_, found| forces_n.push(found.sphere_n));
    Ok((forces_n, ended.err().map(|error| error.to_string())))
}

/// The scene's block under a sphere on a spring, without friction, and what it is made of.
fn block() -> Result<(Model, Material)> {
    let text = palpate_scene::builtin("hybrid-block").ok_or_else(|| miette!("there is no scene hybrid-block"))?;
    let mut scene = palpate_scene::parse(text, "hybrid-block", None, &Limits::local(), &mut |_, _| {})?;
    ensure!(scene.model.tools.len() == 1, "the scene hybrid-block has not one tool");
    for tool in &mut scene.model.tools {
        (tool.radius_m, tool.friction_coefficient, tool.coupling) = (RADIUS_M, 0.0, COUPLING);
        tool.start_position_m = DVec3::Z * (RADIUS_M + 1e-3);
    }
    let material = material_of(&scene.model)?;
    let model = Model::build(scene.model).into_diagnostic()?;
    let (width_m, height_m) = (BLOCK_M[0], BLOCK_M[1]);
    let lowest_m = model.surface_rest_positions_m().iter().fold(DVec3::INFINITY, |low, x| low.min(*x));
    ensure!(
        lowest_m.distance(DVec3::new(-0.5 * width_m, -0.5 * width_m, -height_m)) < 1e-9,
        "the scene's block is not the reference's"
    );
    Ok((model, material))
}

/// What the scene's block is made of, without the viscosity, which has no part at rest.
fn material_of(spec: &ModelSpec) -> Result<Material> {
    let solid = spec.body.solid().ok_or_else(|| miette!("the scene's block is not made of tets"))?;
    ensure!(solid.regions.len() == 1, "the scene's block is of {} materials, not of one", solid.regions.len());
    Ok(solid.regions[0].material)
}

/// Depths (m) of the tool's lowest point beneath the face at rest, and forces (N), tick by tick, while its device goes so far (m).
fn press(model: &Model, way_m: f64) -> Vec<(f64, f64)> {
    let mut slow = Slow::at_rest(model);
    let step_m = SPEED_M_PER_S * model.settings().tick_period_s;
    let ticks = (way_m / step_m).ceil() as usize;
    let at = |tick: usize| DVec3::Z * (RADIUS_M + 1e-3 - step_m * tick as f64);
    (1..=ticks)
        .map(|tick| {
            let force_n = slow.tick(at(tick));
            (RADIUS_M - slow.tool_m().z, force_n.z)
        })
        .collect()
}

/// The mean force (N) over a twentieth of a millimetre about a depth (m).
fn at_depth(pressed: &[(f64, f64)], depth_m: f64) -> Option<f64> {
    let near: Vec<f64> =
        pressed.iter().filter(|(own_m, _)| (own_m - depth_m).abs() < 25e-6).map(|(_, force_n)| *force_n).collect();
    (!near.is_empty()).then(|| near.iter().sum::<f64>() / near.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The command refused its own scene, of which nothing but the command itself knew.
    #[test]
    fn the_scenes_block_is_taken_and_the_hybrid_is_near_its_reference() {
        let (model, material) = block().unwrap();
        assert_eq!(material.lame.poisson_ratio(), 0.45);
        let pressed = press(&model, 3e-3);
        let (depth_m, _) = *pressed.last().unwrap();
        let (forces_n, ended) = on_grid(2, &material, &[0.75 * depth_m], &mut |_| ()).unwrap();
        assert_eq!(ended, None);
        let own_n = at_depth(&pressed, 0.75 * depth_m).unwrap();
        assert!((own_n / forces_n[0] - 1.0).abs() < 0.1, "{own_n} N, {} N", forces_n[0]);
    }
}
