//! A flat sheet of springs and a sphere above it: what the tests of mass-spring surfaces share.
#![allow(dead_code, missing_docs, unreachable_pub, clippy::unwrap_used)]
use crate::rig::{Rig, sphere};
use glam::DVec3;
use palpate_physics::{
    BodySpec, Energies, ModelSpec, PrescribedSpec, Settings,
    bodies::mass_spring::{
        AnchorLaw, MassSpringSpec, Refinement, Refining, SpringSpec, net::hexagonal_patch, region::Constants,
    },
    contact::Coupling,
};

pub const EDGE_M: f64 = 4e-3;
pub const COARSE: Constants = Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 12.0 };
/// With which a sphere of 3 mm feels much the same where it is refined: a fifth stiffer at most.
pub const FINE: Constants = Constants { mesh_n_per_m: 36.0, anchor_n_per_m: 6.2 };

/// A flat sheet whose boundary is held, and a sphere of 3 mm above its middle.
pub fn sheet(rings: i32, refinement: Option<Refinement>) -> ModelSpec {
    let surface = hexagonal_patch(rings, EDGE_M).unwrap();
    let vertices = surface.positions_m().len();
    let boundary: Vec<u32> = (0..vertices as u32).filter(|&vertex| surface.is_boundary(vertex)).collect();
    ModelSpec {
        body: BodySpec::MassSpring(MassSpringSpec {
            springs: SpringSpec {
                coarse: COARSE,
                fine: FINE,
                anchor_law: AnchorLaw::Linear,
                mass_kg: vec![2e-4; vertices],
                held: Vec::new(),
                most_awake: vertices,
                most_refined: 300,
                surface,
            },
            refinement,
            table: None,
        }),
        prescribed: vec![PrescribedSpec { name: "boundary".into(), nodes: boundary, axes: [true; 3], is_fixed: false }],
        loads: Vec::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![sphere(3e-3, DVec3::Z * 0.01, Coupling::Rigid)],
        settings: Settings { mass_damping_per_s: 60.0, ..Settings::default() },
    }
}

pub fn refined(rings: u32, by: Refining) -> Refinement {
    Refinement { rings, follows_dent: false, blend_s: 0.1, by }
}

pub fn refined_nodes(rig: &Rig) -> usize {
    rig.state.body.as_mass_spring().unwrap().refined_nodes(rig.model.body().as_mass_spring().unwrap())
}

pub fn energies(rig: &Rig) -> Energies {
    Energies::of(&rig.model, &rig.state)
}

/// Down over so many ticks, to a centre at height `z_m`.
pub fn press(rig: &mut Rig, z_m: f64, ticks: u32) {
    let from = rig.state.mechanical.tools[0].target.position_m;
    for tick in 1..=ticks {
        let part = f64::from(tick) / f64::from(ticks);
        rig.tick_at(DVec3::new(from.x, from.y, from.z + (z_m - from.z) * part));
    }
}

pub fn force_n(rig: &Rig) -> f64 {
    rig.state.mechanical.tools[0].device_force_n.length()
}
