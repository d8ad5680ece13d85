//! How much too stiff tets are, linear and smoothed, by Poisson's ratio and by how large they are under what presses: the measurement
//! behind the warning of `palpated check` (`docs/measurements/locking.md`).
//!
//! A block of tets is pressed by a patch or a sphere, and brought to rest as `palpated static` does. What it is held
//! against are the lab's triquadratic hexahedra with linear pressure, which do not lock.
use crate::{
    methods::Subject,
    problems::{Action, Motion, Problem, body::BLOCK_M, body::Body},
    references::{limit, on_grid},
};
use miette::{IntoDiagnostic, Result};
use palpate_physics::{
    Settings,
    bodies::tet::TetElements,
    contact::ToolTarget,
    material::Law,
    statics::{Goal, StaticSettings, solve_static},
};
use std::ops::ControlFlow;

/// Poisson's ratios.
const POISSON_RATIOS: [f64; 6] = [0.0, 0.3, 0.4, 0.45, 0.49, 0.499];
/// Cells along the block's 80 mm, six tets each.
const CELLS: [u32; 4] = [4, 8, 16, 24];
/// Elements of the reference over one and a half radii of the contact.
const GRIDS: [usize; 3] = [2, 3, 4];
/// κ of the reference's sphere over `E/((1 − ν²)√(Rδ))`.
const PENALTY: f64 = 1e3;

/// What presses: a name and an action.
fn presses() -> [(&'static str, Action); 6] {
    let patch = |radius_m| Action::Patch { radius_m, force_n: 0.02 };
    let sphere = |radius_m, depth_m| Action::Sphere { radius_m, depth_m };
    [
        ("patch of 7.5 mm", patch(7.5e-3)),
        ("patch of 15 mm", patch(15e-3)),
        ("sphere of 10 mm, 5 mm deep", sphere(10e-3, 5e-3)),
        ("sphere of 20 mm, 5 mm deep", sphere(20e-3, 5e-3)),
        ("sphere of 10 mm, 1 mm deep", sphere(10e-3, 1e-3)),
        ("sphere of 20 mm, 1 mm deep", sphere(20e-3, 1e-3)),
    ]
}

/// Measures and prints, as the rows of a table.
///
/// # Errors
/// No equilibrium.
pub fn print() -> Result<()> {
    println!(
        "| press | ν | reference | tets | {} |",
        CELLS.map(|cells| format!("cells of {:.1} mm", BLOCK_M[0] * 1e3 / f64::from(cells))).join(" | ")
    );
    println!("|---|---|---|---|{}", "---|".repeat(CELLS.len()));
    for (name, action) in presses() {
        for poisson_ratio in POISSON_RATIOS {
            let problem = Problem {
                name: name.into(),
                sentence: String::new(),
                body: Body::Block,
                action,
                motion: Motion::ToRest,
                law: Law::StableNeoHookean,
                young_modulus_pa: 10e3,
                poisson_ratio,
            };
            let values = GRIDS.map(|n| on_grid(&problem, n, PENALTY, &mut |_| ()).map(|solved| solved.grid.value));
            let [first, second, third] = values;
            let found = limit([first?, second?, third?], GRIDS.map(|n| 1.0 / n as f64));
            let uncertain = (100.0 * found.uncertainty / found.value).abs();
            for (kind, elements) in [("linear", TetElements::Linear), ("smoothed", TetElements::Smoothed)] {
                let errors = CELLS.iter().map(|&cells| match at_rest(elements, &problem, cells) {
                    Ok(answer) => format!("{:+.1} %", 100.0 * (stiffness_ratio(&problem, answer, found.value) - 1.0)),
                    Err(error) => error.to_string(),
                });
                let errors = errors.collect::<Vec<_>>().join(" | ");
                println!("| {name} | {poisson_ratio} | {:.4e} ± {uncertain:.1} % | {kind} | {errors} |", found.value);
            }
        }
    }
    println!("The block is {} × {} × {} mm.", BLOCK_M[0] * 1e3, BLOCK_M[0] * 1e3, BLOCK_M[1] * 1e3);
    Ok(())
}

/// How many times as stiff as the reference: by force at a depth, or by displacement under a load.
fn stiffness_ratio(problem: &Problem, answer: f64, reference: f64) -> f64 {
    match problem.action {
        Action::Sphere { .. } => answer / reference,
        _ => reference / answer,
    }
}

/// The answer of tets at rest.
fn at_rest(elements: TetElements, problem: &Problem, cells: u32) -> Result<f64> {
    let subject = Subject::of_elements(elements, problem, cells, problem.material()?, Settings::default())?;
    let prescribed = vec![glam::DVec3::ZERO; subject.model.prescribed().len()];
    let tools: Vec<ToolTarget> =
        subject.tool.iter().map(|tool| ToolTarget { position_m: tool.centre_m(1.0), ..tool.spec().start() }).collect();
    let load_factors = vec![1.0; subject.model.loads().len()];
    let goal =
        Goal { load_factors: &load_factors, prescribed_displacements_m: &prescribed, tools: &tools, awake: None };
    let settings = StaticSettings::default();
    let solved =
        solve_static(&subject.model, &goal, &settings, &mut |_| ControlFlow::Continue(())).into_diagnostic()?;
    let force_n = solved.tools.first().map(|tool| tool.contact_force_n).unwrap_or_default();
    Ok(subject.answer(&solved.x, force_n))
}
