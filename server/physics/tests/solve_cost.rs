//! What the static solve costs: the table of docs/adr/static-solve.md. Timing is printed, never asserted.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::common;
use common::{block, held, material, spec, triangles_where};
use glam::DVec3;
use palpate_physics::{
    LoadSpec, Model, TetMesh,
    material::Law,
    statics::{Goal, StaticSettings, solve_static},
};
use std::ops::ControlFlow;

/// Time this thread has been on a processor (s): other load on the machine does not count. Linux only.
fn cpu_s() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    stat.split_whitespace().next().unwrap().parse::<f64>().unwrap() * 1e-9
}

fn cost(name: &str, mesh: TetMesh, pressure_pa: f64) {
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let side = triangles_where(&mesh, |p| p.z == 0.0);
    let loads = vec![LoadSpec::Pressure { triangles: side, pressure_pa, follower: true }];
    let (nodes, tets) = (mesh.positions_m().len(), mesh.tets().len());
    let law = material(Law::StableNeoHookean, 10e3, 0.45);
    let model = Model::build(spec(mesh, law, prescribed, loads)).unwrap();
    let start = cpu_s();
    let settings = StaticSettings::default();
    let found = solve_static(
        &model,
        &Goal { load_factors: &[1.0], prescribed_displacements_m: &[DVec3::ZERO], ..Goal::default() },
        &settings,
        &mut |_| ControlFlow::Continue(()),
    )
    .unwrap();
    println!(
        "| {name} | {tets} | {} | {} | {} | {:.2} |",
        3 * nodes,
        found.iterations,
        found.factorisations,
        cpu_s() - start
    );
}

#[test]
#[ignore = "prints times; run with --ignored --nocapture"]
fn table() {
    println!("| body | tets | unknowns | Newton iterations | factorisations | CPU s |");
    for n in [4, 8, 12, 16, 20] {
        cost(&format!("cube {n}³"), block(DVec3::splat(0.1), [n; 3]), 20.0);
    }
    for n in [4, 8, 12] {
        cost(&format!("beam {}×{n}×{n}", 10 * n), block(DVec3::new(0.1, 0.01, 0.01), [10 * n, n, n]), 0.5);
    }
}
