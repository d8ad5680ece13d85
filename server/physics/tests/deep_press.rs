//! A press as deep as the tool is wide: the substeps grow as the skin below it is stretched.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{Energies, Settings, bodies::hybrid::Waking, contact::Coupling, material::Viscosity, world};
use rig::{Rig, bricks, even, held_below, hybrid_block, solid_mut, sphere};

const RADIUS_M: f64 = 0.01;
const DEPTH_M: f64 = 0.02;

/// Half of a block's thickness is pressed in. With the substeps that contact alone asks for, cells turned inside out, and where
/// no viscosity asked for more the ledger missed 6.4e-3 J.
#[test]
fn a_deep_press_turns_nothing_inside_out_and_loses_no_energy() {
    let waking = Waking::in_half_ball(2.5e-3, None, 600);
    for psi_pa_s in [0.0, 0.3] {
        let mut spec = hybrid_block((0.04, 2, 16), 0.45, 600, waking);
        let side = even(-0.04, 0.04, 4);
        let coarse = solid_mut(&mut spec);
        coarse.mesh = bricks(&side, &side, &even(-0.04, 0.0, 4));
        coarse.tet_region = vec![0; coarse.mesh.tets().len()];
        let mut spec = held_below(spec);
        spec.settings = Settings { mass_damping_per_s: 20.0, ..Settings::for_particles() };
        solid_mut(&mut spec).regions[0].material.viscosity = Viscosity::new(0.0, psi_pa_s).unwrap();
        spec.tools = vec![sphere(RADIUS_M, DVec3::Z * (RADIUS_M + 5e-3), Coupling::Rigid)];
        let mut rig = Rig::new(spec);
        let start_j = Energies::of(&rig.model, &rig.state).balance_j();
        let (mut least, mut most_n, mut most_substeps, mut repeated) = (f64::INFINITY, 0.0_f64, 0, 0);
        let heights_m = |tick: u32| match tick {
            ..300 => 5e-3 - (5e-3 + DEPTH_M) * f64::from(tick) / 300.0,
            300..500 => -DEPTH_M,
            _ => -DEPTH_M + (5e-3 + DEPTH_M) * f64::from(tick - 500) / 300.0,
        };
        for tick in 0..800 {
            let report = rig.tick_at(DVec3::Z * (RADIUS_M + heights_m(tick)));
            assert_eq!(report.quarantined, None);
            (most_substeps, repeated) = (report.substeps.max(most_substeps), repeated + report.repeated);
            most_n = most_n.max(rig.state.mechanical.tools[0].contact_force_n.length());
            if tick % 10 == 0 {
                least = least.min(world::min_volume_ratio(&rig.model, &rig.state).unwrap().ratio);
            }
        }
        let energies = Energies::of(&rig.model, &rig.state);
        let (lost_j, about_j) = (energies.balance_j() - start_j, 0.5 * most_n * DEPTH_M);
        println!(
            "{psi_pa_s} Pa s: {} to {most_substeps} substeps, {repeated} ticks repeated, {most_n:.2} N, least volume ratio {least:.3}, \
             {lost_j:.1e} J missing of some {about_j:.1e} J",
            rig.model.substeps()
        );
        assert!(least > 0.4, "{psi_pa_s} Pa s: {least}");
        assert!(lost_j.abs() < 1e-3 * about_j, "{psi_pa_s} Pa s: {lost_j} J");
        assert!(repeated < 3, "{psi_pa_s} Pa s: {repeated}");
    }
}
