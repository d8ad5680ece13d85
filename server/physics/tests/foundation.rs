//! The foundation's stiffness: what it adds to the highest frequency, and that its bound holds.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{Energies, ModelSpec, contact::Coupling, material::Law};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, sphere};

fn block(h_m: f64, radius_m: f64, coupling: Coupling) -> ModelSpec {
    let cells = (0.04 / h_m).round() as usize;
    let side = even(-0.02, 0.02, cells);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, cells / 2));
    let bottom = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec.tools = vec![sphere(radius_m, DVec3::Z * radius_m * 1.001, coupling)];
    spec
}

fn coupled() -> Coupling {
    Coupling::Spring { stiffness_n_per_m: 500.0, damping_n_s_per_m: 0.0, mass_kg: 0.02 }
}

#[test]
fn a_tool_costs_few_substeps_whatever_its_size() {
    for h in [0.01, 0.005, 0.0025] {
        for radius in [0.002, 0.004, 0.008] {
            let mut spec = block(h, radius, coupled());
            // A long tick, so that the number of substeps is fine-grained.
            spec.settings.tick_period_s = 0.1;
            let touched = Rig::new(spec.clone()).model;
            spec.tools.clear();
            let bare = Rig::new(spec).model.substeps();
            let limit_n = touched.contact().force_limit_n(0);
            println!(
                "h {h}, R {radius}: {} substeps, {bare} without the tool, limit {limit_n:.3} N",
                touched.substeps()
            );
            // √((1.66 + 1.5)/1.66) = 1.38, and what the tool's mass adds.
            assert!(f64::from(touched.substeps()) < 1.45 * f64::from(bare));
        }
    }
}

/// Nothing is damped: a step over the limit would grow without bound within the 2000 ticks.
#[test]
fn the_step_is_stable_in_contact_at_the_bound_itself() {
    for (radius, depth) in [(0.004, 0.001), (0.016, 0.004)] {
        let mut spec = block(0.005, radius, coupled());
        spec.settings.step_safety = 1.0;
        let mut rig = Rig::new(spec);
        let device = DVec3::Z * (radius - depth);
        let mut most = 0.0_f64;
        for tick in 0..2000 {
            rig.tick_at(device);
            assert!(rig.state.quarantine.is_none(), "tick {tick}");
            let held = Energies::of(&rig.model, &rig.state).held_j() + rig.state.mechanical.tools[0].contact_energy_j;
            most = most.max(held);
        }
        // The coupling's spring is all the energy there is: it was stretched by the depth, and gives at most that.
        let given = 0.5 * 500.0 * (depth + 0.001 * radius).powi(2);
        println!("R {radius}: {} substeps, most {most:.3e} J of {given:.3e} J", rig.model.substeps());
        assert!(most > 0.05 * given && most < 1.05 * given, "{most:e} {given:e}");
    }
}
