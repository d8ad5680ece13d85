//! Force against depth, beyond the bench: a block with particles that a sphere on a spring presses a radius deep, beside the
//! lab's triquadratic hexahedra (`docs/measurements/deep-press.md`).
//!
//! The scene `hybrid-block`, its tool on a virtual coupling and without friction, its device going down slowly; the depth is that of
//! the tool, not of the device. The reference is a rigid sphere on the same block and law at each depth.
use crate::{
    press::Slow,
    problems::{Action, Motion, Problem, body::BLOCK_M, body::Body},
    references::{limit, on_grid},
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result, ensure, miette};
use palpate_physics::{Model, contact::Coupling, material::Law};
use palpate_scene::Limits;

/// Depths (mm). Beyond a radius the reference's sphere, which presses by its penalty alone, comes to be around the surface.
const DEPTHS_MM: [f64; 4] = [2.5, 5.0, 7.5, 10.0];
/// Elements of the reference over one and a half radii of the contact.
const GRIDS: [usize; 3] = [2, 3, 4];
/// κ of the reference's sphere over `E/((1 − ν²)√(Rδ))`; where Newton's method does not converge with the first, the next.
const PENALTIES: [f64; 3] = [1e3, 2.5e2, 1e2];
/// The coupling: stiffness (N/m), damping (N s/m) and mass (kg).
const COUPLING: Coupling = Coupling::Spring { stiffness_n_per_m: 800.0, damping_n_s_per_m: 4.0, mass_kg: 0.05 };
const RADIUS_M: f64 = 10e-3;
/// Speed (m/s) of the device, and the way (m) that it goes at most.
const SPEED_M_PER_S: f64 = 0.01;
const MOST_WAY_M: f64 = 0.045;

/// Measures and prints, as the rows of a table.
///
/// # Errors
/// A scene that is refused.
pub fn print() -> Result<()> {
    let model = block()?;
    let pressed = press(&model);
    println!(
        "coupling saturates at {:.2} N; deepest {:.2} mm",
        model.contact().force_limit_n(0),
        pressed.last().map_or(0.0, |(depth_m, _)| 1e3 * depth_m)
    );
    println!("| depth | hexahedra: {} | limit | hybrid | off by |", GRIDS.map(|n| format!("n = {n}")).join(" | "));
    println!("|---|---|---|---|---|---|---|");
    for depth_mm in DEPTHS_MM {
        let depth_m = 1e-3 * depth_mm;
        let force_n = at_depth(&pressed, depth_m);
        let found = reference(depth_m);
        let (grids, limit_n) = match &found {
            Ok((grids, limit)) => (
                grids.map(|n| format!("{n:.4} N")).join(" | "),
                format!("{:.4} ± {:.4} N", limit.value, limit.uncertainty),
            ),
            Err(error) => ([&error.to_string(), "", ""].join(" | "), String::new()),
        };
        let off = force_n.zip(found.ok()).map(|(force_n, (_, limit))| 100.0 * (force_n / limit.value - 1.0));
        println!(
            "| {depth_mm} mm | {grids} | {limit_n} | {} | {} |",
            force_n.map_or("not reached".into(), |n| format!("{n:.4} N")),
            off.map_or(String::new(), |off| format!("{off:+.1} %")),
        );
    }
    Ok(())
}

/// The force (N) of the reference at a depth (m): of every grid, and their limit.
fn reference(depth_m: f64) -> Result<([f64; 3], crate::references::Limit)> {
    let problem = Problem {
        name: "deep".into(),
        sentence: String::new(),
        body: Body::Block,
        action: Action::Sphere { radius_m: RADIUS_M, depth_m },
        motion: Motion::ToRest,
        law: Law::StableNeoHookean,
        young_modulus_pa: 10e3,
        poisson_ratio: 0.45,
    };
    let mut last = Err(miette!("no penalty"));
    for penalty in PENALTIES {
        let [first, second, third] =
            GRIDS.map(|n| on_grid(&problem, n, penalty, &mut |_| ()).map(|solved| solved.grid.value));
        last = first.and_then(|first| Ok([first, second?, third?]));
        if last.is_ok() {
            break;
        }
    }
    let grids = last?;
    Ok((grids, limit(grids, GRIDS.map(|n| 1.0 / n as f64))))
}

/// The scene's block under a sphere on a spring, without friction.
fn block() -> Result<Model> {
    let text = palpate_scene::builtin("hybrid-block").ok_or_else(|| miette!("there is no scene hybrid-block"))?;
    let mut scene = palpate_scene::parse(text, "hybrid-block", None, &Limits::local(), &mut |_, _| {})?;
    ensure!(scene.model.tools.len() == 1, "the scene hybrid-block has not one tool");
    for tool in &mut scene.model.tools {
        (tool.radius_m, tool.friction_coefficient, tool.coupling) = (RADIUS_M, 0.0, COUPLING);
        tool.start_position_m = DVec3::Z * (RADIUS_M + 1e-3);
    }
    let model = Model::build(scene.model).into_diagnostic()?;
    let (width_m, height_m) = (BLOCK_M[0], BLOCK_M[1]);
    let lowest_m = model.surface_rest_positions_m().iter().fold(DVec3::INFINITY, |low, x| low.min(*x));
    ensure!(
        lowest_m.distance(DVec3::new(-0.5 * width_m, -0.5 * width_m, -height_m)) < 1e-9,
        "the scene's block is not the reference's"
    );
    Ok(model)
}

/// Depths (m) of the tool's lowest point beneath the face at rest, and forces (N), tick by tick.
fn press(model: &Model) -> Vec<(f64, f64)> {
    let mut slow = Slow::at_rest(model);
    let step_m = SPEED_M_PER_S * model.settings().tick_period_s;
    let ticks = (MOST_WAY_M / step_m).ceil() as usize;
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
