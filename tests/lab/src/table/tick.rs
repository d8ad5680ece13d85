//! µs per 1 ms tick of whole bodies, with their substeps, and the two aims.
use crate::methods::tet_body;
use crate::{bodies, press::Press, timing::Summary};
use miette::Result;
use palpate_physics::{Model, material::Law};
use palpate_scene::shapes::Shape;
use std::time::Instant;

pub(super) fn print() -> Result<()> {
    println!("Ticks of 1 ms, stable neo-Hookean, f32 kernel, one core\n");
    println!("| body | tets | nodes | tool | substeps | µs median | p99 | aim |\n|---|---|---|---|---|---|---|---|");
    for tets in [188, 1_352, 10_000, 50_000] {
        let shape = bodies::ellipsoid(tets)?;
        row("ellipsoid shell, 90 mm, E = 10 kPa, ν = 0.45", &shape, (10e3, 0.45), None, "")?;
    }
    let human = "ventricle, 90 mm, E = 10 kPa, ν = 0.45";
    for tets in [188, 1_352, 10_000, 50_000] {
        let shape = bodies::ventricle(3.6, tets)?;
        let aim = if tets == 1_352 { "40" } else { "" };
        row(human, &shape, (10e3, 0.45), None, aim)?;
        row(human, &shape, (10e3, 0.45), Some(10e-3), aim)?;
    }
    let shape = bodies::ventricle(1.0, 1_352)?;
    let small = "ventricle, 25 mm, E = 30 kPa, ν = 0.4";
    row(small, &shape, (30e3, 0.4), None, "200")?;
    row(small, &shape, (30e3, 0.4), Some(3e-3), "200")
}

fn row(name: &str, shape: &Shape, (young, nu): (f64, f64), tool_radius_m: Option<f64>, aim: &str) -> Result<()> {
    let tool = tool_radius_m.map(|radius_m| bodies::tool_beside(shape, radius_m));
    let model = bodies::model(shape, bodies::material(Law::StableNeoHookean, young, nu)?, tool)?;
    let (summary, contacts) = run(&model, tool_radius_m.unwrap_or(0.0));
    let tool = if tool_radius_m.is_some() { format!("{contacts} contacts") } else { "none".into() };
    println!(
        "| {name} | {} | {} | {tool} | {} | {:.1} | {:.1} | {aim} |",
        shape.mesh.tets().len(),
        shape.mesh.positions_m().len(),
        model.substeps(),
        summary.median_s * 1e6,
        summary.p99_s * 1e6
    );
    Ok(())
}

/// Times of ticks, and how many contact samples carried force at the end. A tool goes in by a tenth of its radius
/// during the ticks that are not counted, and stays; without one the body rings.
fn run(model: &Model, radius_m: f64) -> (Summary, u32) {
    let ticks = (20_000_000 / (model.substeps() as usize * tet_body(model).mesh().tets().len())).clamp(100, 2_000);
    let approach = ticks / 2;
    let mut press = Press::new(model, 0.1 * radius_m, approach);
    let mut times = Vec::with_capacity(ticks);
    for tick in 0..approach + ticks {
        let start = Instant::now();
        let report = press.tick();
        if tick >= approach {
            times.push(start.elapsed().as_secs_f64());
        }
        assert!(report.quarantined.is_none(), "the body did not survive its own benchmark");
    }
    (Summary::of(times), press.contacts())
}
