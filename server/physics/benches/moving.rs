//! A sphere that presses a hybrid body and moves along, so that particles wake before it and fall asleep behind it: the block of `hybrid`, 2 mm deep, 20 mm/s.
//! Every tick is timed alone, with what it had to do, for a device waits for the longest: `cargo bench -p palpate-physics --bench moving`.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers of a benchmark
#[path = "../tests/rig/mod.rs"]
mod rig;
use glam::DVec3;
use palpate_physics::{Settings, bodies::hybrid::Waking, contact::Coupling};
use rig::{Rig, held_below, hybrid_block, sphere};
use std::time::Instant;

const TICKS: u32 = 6000;
const DEPTH_M: f64 = 2e-3;
const RADIUS_M: f64 = 8e-3;

/// Down within 0.2 s, then to and fro along x with at most 20 mm/s.
fn tool_m(tick: u32) -> DVec3 {
    let t_s = f64::from(tick) * 1e-3;
    let depth_m = DEPTH_M * (t_s / 0.2).min(1.0);
    let along_m = 12e-3 * (20.0 / 12.0 * (t_s - 0.2).max(0.0)).sin();
    DVec3::new(along_m, 0.2 * along_m, RADIUS_M - depth_m)
}

fn print(name: &str, mut times_us: Vec<f64>) {
    times_us.sort_by(f64::total_cmp);
    let Some(last) = times_us.len().checked_sub(1) else {
        println!("  {name:20} none");
        return;
    };
    let at = |part: f64| times_us[(part * last as f64) as usize];
    println!(
        "  {name:20} {:5} ticks   median {:6.0}   90 % {:6.0}   99 % {:6.0}   longest {:6.0} µs",
        times_us.len(),
        at(0.5),
        at(0.9),
        at(0.99),
        at(1.0)
    );
}

fn main() {
    for (reach_m, most_active) in [(9.5e-3, 200), (14e-3, 600)] {
        let mut spec = held_below(hybrid_block((0.04, 2, 16), 0.45, most_active, Waking::ByTools { reach_m }));
        spec.settings = Settings::for_particles();
        spec.settings.mass_damping_per_s = 20.0;
        spec.tools = vec![sphere(RADIUS_M, DVec3::Z * (RADIUS_M + 1e-3), Coupling::Rigid)];
        let mut rig = Rig::new(spec);
        let (mut quiet, mut prestrained, mut switching, mut awake) = (Vec::new(), Vec::new(), Vec::new(), 0);
        for tick in 0..TICKS {
            let before = rig.state.body.active_particles().to_vec();
            let was_prestrained = !rig.state.body.as_hybrid().unwrap().prestrain().is_empty();
            let start = Instant::now();
            let report = rig.tick_at(tool_m(tick));
            let took_us = start.elapsed().as_secs_f64() * 1e6;
            assert!(report.quarantined.is_none());
            awake += rig.state.body.active_particles().len();
            if before != rig.state.body.active_particles() {
                switching.push(took_us);
            } else if was_prestrained {
                prestrained.push(took_us);
            } else {
                quiet.push(took_us);
            }
        }
        println!(
            "{} awake on average, {} substeps, {:.4} N at last",
            awake / TICKS as usize,
            rig.model.substeps(),
            rig.state.mechanical.tools[0].contact_force_n.length()
        );
        print("no prestrain", quiet);
        print("prestrain decays", prestrained);
        print("particles switch", switching);
    }
}
