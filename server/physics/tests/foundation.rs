//! The foundation's stiffness: what it adds to the highest frequency, and that its bound holds.
#![allow(clippy::unwrap_used)]
mod rig;
use glam::DVec3;
use palpate_physics::{ModelSpec, Substeps, contact::Coupling, health::Energies, material::Law};
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

#[test]
fn explore() {
    for h in [0.01, 0.005, 0.0025] {
        for r in [0.002, 0.004, 0.008, 0.016] {
            let coupling = Coupling::Spring { stiffness_n_per_m: 500.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 };
            let rig = Rig::new(block(h, r, coupling));
            let bare = {
                let mut s = block(h, r, coupling);
                s.tools.clear();
                Rig::new(s)
            };
            let elastic = rig.model.max_natural_frequency_rad_per_s().powi(2);
            println!(
                "h {h} R {r}: contact/elastic w2 {:.2}, substeps {} without tool {}",
                rig.model.contact().frequency_bound_sq / elastic,
                rig.model.substeps(),
                bare.model.substeps()
            );
        }
    }
}
