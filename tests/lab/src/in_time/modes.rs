//! Natural frequencies of the block, held below, beside those of the reference's elements.
use crate::{
    methods::{Subject, asleep},
    problems::{Problem, body::BLOCK_M},
    reference::{
        bodies::Body,
        grid::{HexGrid, Side},
        modes::frequencies_hz,
        solid::Solid,
    },
    references,
};
use glam::DVec3;
use miette::{IntoDiagnostic, Result};
use palpate_physics::{Model, Settings, bodies::tet::TetElements, statics::natural_modes};

const DENSITY_KG_PER_M3: f64 = 1000.0;
/// Number of modes that are compared.
const MODES: usize = 12;
/// Number of elements of the reference over half of the block's width.
const REFERENCE: [usize; 3] = [3, 4, 6];
/// Number of cells of tets along the block's width; n of them make 3 n³ tets.
const TETS: [u32; 3] = [4, 8, 16];
/// The same of coarse tets.
const COARSE: [u32; 3] = [4, 6, 8];

/// Measures and prints the table.
pub(super) fn print() -> Result<()> {
    let problem = super::bands::problem()?;
    let by_grid = REFERENCE.iter().map(|&n| reference_hz(&problem, n)).collect::<Result<Vec<_>>>()?;
    let sizes = REFERENCE.map(|n| 1.0 / n as f64);
    let limit_hz: Vec<f64> = (0..MODES)
        .map(|mode| references::limit([by_grid[0][mode], by_grid[1][mode], by_grid[2][mode]], sizes).value)
        .collect();
    let finest = &by_grid[2];
    let unsure = limit_hz.iter().zip(finest).map(|(limit, finest)| (limit / finest - 1.0).abs()).fold(0.0, f64::max);
    println!("Natural frequencies of the block, Poisson's ratio {}. The reference's are", problem.poisson_ratio);
    println!("{} Hz;", limit_hz.iter().map(|hz| format!("{hz:.2}")).collect::<Vec<_>>().join(", "));
    println!("from its finest grid to these it is {:.1} % at most.", 100.0 * unsure);
    println!();
    println!("| body | {} |", (1..=MODES).map(|mode| format!("mode {mode}")).collect::<Vec<_>>().join(" | "));
    println!("|---|{}", "---|".repeat(MODES));
    for (elements, name) in [(TetElements::Linear, "linear"), (TetElements::Smoothed, "smoothed")] {
        for cells in TETS {
            let material = problem.material()?;
            let model = Subject::of_elements(elements, &problem, cells, material, Settings::default())?.model;
            row(&format!("{} {name} tets", 3 * cells.pow(3)), &frequencies_of(&model)?, &limit_hz);
        }
    }
    for cells in COARSE {
        let model = asleep(&problem, cells)?;
        let Some(body) = model.body().as_hybrid() else { continue };
        let modes = body.sleeping_modes(MODES).into_diagnostic()?;
        let name = format!("{} coarse tets", 3 * cells.pow(3));
        row(&name, &modes.iter().map(|mode| mode.frequency_hz).collect::<Vec<_>>(), &limit_hz);
        let with_particles_hz = modes
            .iter()
            .map(|mode| mode.frequency_hz / body.particles_kinetic_share(&mode.shape_per_sqrt_kg).sqrt())
            .collect::<Vec<_>>();
        row(&format!("{name}, with the particles' kinetic energy"), &with_particles_hz, &limit_hz);
    }
    Ok(())
}

fn row(name: &str, found_hz: &[f64], reference_hz: &[f64]) {
    let off =
        found_hz.iter().zip(reference_hz).map(|(found, right)| format!("{:+.1} %", 100.0 * (found / right - 1.0)));
    println!("| {name} | {} |", off.collect::<Vec<_>>().join(" | "));
}

fn frequencies_of(model: &Model) -> Result<Vec<f64>> {
    let modes = natural_modes(model, MODES).into_diagnostic()?;
    Ok(modes.into_iter().map(|mode| mode.frequency_hz).collect())
}

/// The whole block, in `2n × 2n × n` elements.
fn reference_hz(problem: &Problem, n: usize) -> Result<Vec<f64>> {
    let [width_m, height_m] = BLOCK_M;
    let even = |from: f64, to: f64, n: usize| (0..=n).map(|i| from + (to - from) * i as f64 / n as f64).collect();
    let across: Vec<f64> = even(-0.5 * width_m, 0.5 * width_m, 2 * n);
    let grid = HexGrid::new([across.clone(), across, even(-height_m, 0.0, n)], |p| p);
    let body = Body {
        grid: grid.clone(),
        held: vec![(Side { parameter: 2, upper: false }, [true; 3])],
        touched: Side { parameter: 2, upper: true },
        multiplicity: 1.0,
        touch_m: DVec3::ZERO,
        normal: DVec3::Z,
    };
    frequencies_hz(&Solid::new(grid, problem.material()?)?, &body, DENSITY_KG_PER_M3, MODES)
}
