//! Skipping viscous terms of materials without viscosity changes no bit. (Contact's broad phase: `broad_phase.rs`.)
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    ModelSpec, Region, State,
    contact::Coupling,
    material::{Law, Viscosity},
    snapshot,
};
use rig::{Drive, Rig, at, body, bricks, even, hold, material, nodes_where, solid_mut, sphere};

/// A block of two materials on its floor that rings and is pressed; only the upper half is viscous, or neither is.
fn pressed_block(law: Law, upper: Viscosity) -> ModelSpec {
    let side = even(-0.02, 0.02, 5);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 4));
    let centre_z = |tet: usize| mesh.corners_m(tet).iter().map(|p| p.z).sum::<f64>() / 4.0;
    let tet_region = (0..mesh.tets().len()).map(|tet| u16::from(centre_z(tet) > -0.01)).collect();
    let lower = material(law, 10e3, 0.45);
    let floor = nodes_where(&mesh, |p| p.z < -0.0199);
    let mut spec = body(mesh, lower);
    spec.prescribed = vec![hold("floor", floor, [true; 3])];
    let viscous = palpate_physics::material::Material { viscosity: upper, ..lower };
    solid_mut(&mut spec).regions.push(Region { name: "upper".into(), material: viscous, density_kg_per_m3: 1000.0 });
    solid_mut(&mut spec).tet_region = tet_region;
    spec.tools = vec![sphere(0.006, DVec3::new(0.002, 0.001, 0.0065), Coupling::Rigid)];
    spec
}

fn run(mut spec: ModelSpec, skip: bool) -> State {
    spec.settings.skips.viscous_terms = skip;
    let mut rig = Rig::new(spec);
    for (v, x) in rig.state.mechanical.v.iter_mut().zip(rig.model.rest_positions_m()) {
        *v = DVec3::new(x.y, -x.z, x.x) * 5.0;
    }
    for tick in 0..200 {
        let depth_m = 3e-5 * f64::from(tick);
        let drive = Drive { tools: vec![at(DVec3::new(0.002, 0.001, 0.0065 - depth_m))], ..rig.still() };
        rig.tick(&drive);
    }
    assert!(rig.state.quarantine.is_none() && rig.state.mechanical.tools[0].contacts > 0);
    rig.state
}

#[test]
fn with_and_without_viscous_terms_that_are_zero_the_bits_are_the_same() {
    for law in [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated] {
        for upper in [(0.0, 0.0), (0.5, 1.0), (0.0, 1.0), (0.5, 0.0)] {
            let upper = Viscosity { phi_pa_s: upper.0, psi_pa_s: upper.1 };
            let spec = pressed_block(law, upper);
            let (skipping, all) = (run(spec.clone(), true), run(spec, false));
            assert!(skipping == all, "{law:?}, {upper:?}");
        }
    }
}

/// The switch is connected, and the skip is of zeros only: viscosity moves the body.
#[test]
fn viscous_terms_that_are_not_zero_are_never_skipped() {
    let hash = |phi_pa_s, psi_pa_s| {
        let block = pressed_block(Law::StableNeoHookean, Viscosity { phi_pa_s, psi_pa_s });
        snapshot::state_hash(&run(block, true))
    };
    let inviscid = hash(0.0, 0.0);
    for (phi_pa_s, psi_pa_s) in [(0.5, 1.0), (0.0, 1.0), (0.5, 0.0)] {
        assert_ne!(hash(phi_pa_s, psi_pa_s), inviscid, "{phi_pa_s}, {psi_pa_s}");
    }
}
