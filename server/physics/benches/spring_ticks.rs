//! Ticks of the loop on sheets of springs: some 10 000 triangles all awake, beneath a sphere and a lying capsule, and of 10 000 and a million triangles with 800 vertices awake, beneath a sphere. The sheets take turns, tick by tick. Prints
//! load times and memory, too: `cargo bench -p palpate-physics --bench spring_ticks`.
#![allow(missing_docs, clippy::unwrap_used)] // a program that prints
#[path = "../tests/rig/mod.rs"]
mod rig;
use glam::DVec3;
use palpate_physics::{
    BodySpec, ModelSpec, Settings,
    bodies::mass_spring::{
        AnchorLaw, MassSpringSpec, Refinement, Refining, SpringSpec, body::triangles_about, net::hexagonal_patch,
        region::Constants,
    },
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
};
use rig::{Drive, Rig, sphere};
use std::time::Instant;

const EDGE_M: f64 = 2e-3;

fn sheet(rings: i32, most_awake: usize, shape: ToolShape) -> ModelSpec {
    let surface = hexagonal_patch(rings, EDGE_M).unwrap();
    let vertices = surface.positions_m().len();
    let springs = SpringSpec {
        coarse: Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 6.0 },
        fine: Constants { mesh_n_per_m: 36.0, anchor_n_per_m: 3.1 },
        anchor_law: AnchorLaw::Linear,
        mass_kg: vec![1e-3; vertices],
        held: Vec::new(),
        most_awake: most_awake.min(vertices),
        most_refined: 300.max(6 * triangles_about(2, 2.0 * shape.half_length_m(), EDGE_M)),
        surface,
    };
    ModelSpec {
        body: BodySpec::MassSpring(MassSpringSpec {
            springs,
            refinement: Some(Refinement { rings: 2, follows_dent: false, blend_s: 0.1, by: Refining::ByTools }),
            table: None,
        }),
        prescribed: Vec::new(),
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![ToolSpec { shape, ..sphere(3e-3, DVec3::Z * 0.01, Coupling::Rigid) }],
        settings: Settings { mass_damping_per_s: 30.0, ..Settings::default() },
    }
}

/// Memory in use (bytes), where the system tells it.
fn resident_bytes() -> f64 {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    let pages = pages.and_then(|text| text.split_whitespace().nth(1)?.parse::<f64>().ok());
    pages.map_or(f64::NAN, |pages| pages * 4096.0)
}

fn loaded(name: &str, rings: i32, most_awake: usize, shape: ToolShape) -> (String, Rig) {
    let (before, begun) = (resident_bytes(), Instant::now());
    let rig = Rig::new(sheet(rings, most_awake, shape));
    let triangles = rig.model.body().as_mass_spring().unwrap().model().surface().triangles().len();
    println!(
        "{name}: {triangles} triangles, {} substeps; loaded in {:.1} s, {:.0} bytes a triangle",
        rig.model.substeps(),
        begun.elapsed().as_secs_f64(),
        (resident_bytes() - before) / triangles as f64
    );
    (name.to_owned(), rig)
}

/// Medians and more of ticks (µs) along a path, the bodies by turns.
fn ticks(what: &str, rigs: &mut [(String, Rig)], path: impl Fn(u32) -> DVec3) {
    const WARM: u32 = 500;
    let mut costs = vec![Vec::new(); rigs.len()];
    for tick in 0..4500 {
        for ((_, rig), costs) in rigs.iter_mut().zip(&mut costs) {
            let begun = Instant::now();
            let drive = rig.still();
            let target = ToolTarget { position_m: path(tick), ..drive.tools[0] };
            rig.tick(&Drive { tools: vec![target], ..drive });
            if tick >= WARM {
                costs.push(begun.elapsed().as_secs_f64() * 1e6);
            }
        }
    }
    for ((name, rig), costs) in rigs.iter().zip(&mut costs) {
        costs.sort_by(f64::total_cmp);
        let at = |part: f64| costs[((costs.len() - 1) as f64 * part) as usize];
        println!(
            "{what}, {name}: median {:.1} us, p99 {:.1}, longest {:.0}; {} nodes awake",
            at(0.5),
            at(0.99),
            at(1.0),
            rig.state.mechanical.x.len()
        );
    }
}

fn main() {
    // 46 mm, 20 edges between its ends.
    let lying = ToolShape::capsule(Coupling::Rigid, 3e-3, 0.02, DVec3::X);
    let mut all = [ToolShape::Sphere, lying].map(|shape| {
        let name = if shape == ToolShape::Sphere { "all awake, sphere" } else { "all awake, capsule" };
        loaded(name, 41, usize::MAX, shape)
    });
    ticks("pressed", &mut all, |_| DVec3::Z * 2e-3);
    ticks("moving", &mut all, |tick| DVec3::new(0.01 * (f64::from(tick) * 0.005).sin(), 0.0, 2e-3));
    let mut pair = [("10 k, 800 awake", 41), ("1 M, 800 awake", 408)]
        .map(|(name, rings)| loaded(name, rings, 800, ToolShape::Sphere));
    ticks("pressed", &mut pair, |_| DVec3::Z * 2e-3);
    ticks("moving", &mut pair, |tick| DVec3::new(0.01 * (f64::from(tick) * 0.005).sin(), 0.0, 2e-3));
    ticks("far away", &mut pair, |_| DVec3::Z * 0.3);
}
