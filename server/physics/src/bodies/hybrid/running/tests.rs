//! The running patch against its oracle.
use super::*;
use crate::{
    bodies::hybrid::{
        composite::PARTS,
        mass_matrix::MassMatrix,
        patch::{Field, Patch},
        prestrain::{CellPrestrain, DECAY_S, ResidualPrestrain},
        testing::{Random, hybrid_ball_of, tissue},
    },
    material::{Material, Viscosity},
};
use glam::DMat3;
use std::collections::BTreeSet;

fn some(hybrid: &HybridBody, wanted: impl Fn(DVec3) -> bool) -> Vec<u32> {
    let particles = 0..hybrid.partition.particle_count() as u32;
    particles.filter(|&p| hybrid.may_wake(p) && wanted(hybrid.partition.particle_m(p))).collect()
}

fn largest(list: &[DVec3]) -> f64 {
    list.iter().map(|a| a.length()).fold(0.0, f64::max)
}

/// Returns prestrain in some of the cells and tets, of the size of the strains of this test.
fn some_prestrain(hybrid: &HybridBody, cells: &[u32], random: &mut Random) -> PrestrainDecay {
    let mut matrix = || DMat3::from_cols(random.vector(), random.vector(), random.vector()) * 0.1;
    let cells = cells.iter().filter(|cell| **cell / 7 % 3 == 1);
    let tets = (0..hybrid.partition.residual_elements().len() as u32).filter(|tet| tet % 4 == 1);
    let cells = cells.map(|&cell| CellPrestrain { cell, shape: matrix(), volume: matrix(), modes: 0.3 }).collect();
    let tets =
        tets.map(|tet| ResidualPrestrain { tet, parts: [(); PARTS].map(|()| matrix()), whole: matrix() }).collect();
    let mut decay = PrestrainDecay::new(cells, tets);
    decay.advance(0.01);
    decay
}

/// Forces, power, accelerations and momenta are those of the oracle, whichever particles were awake before, with
/// whichever prestrain.
#[test]
fn running_patch_and_oracle_agree() {
    let [stvk, neo, corotated] = tissue();
    let mut random = Random(51);
    let still = [corotated, neo].map(|m: Material| Material { viscosity: Viscosity::default(), ..m });
    for (materials, fine_depth_m) in [([neo, stvk], None), (still, None), ([neo, stvk], Some(1.1e-3))] {
        let hybrid = hybrid_ball_of(&materials, 1.1e-3, fine_depth_m);
        let doubled = hybrid.partition.cells().iter().filter(|cell| cell.doubled).count();
        assert_eq!(doubled > 20, fine_depth_m.is_some(), "{doubled}");
        for (precision, bound) in [(Precision::Double, 1e-11), (Precision::Single, 3e-5)] {
            let mut running = RunningPatch::new(&hybrid, 2000, precision);
            let near = |p: DVec3| p.distance(DVec3::new(2e-3, 1e-3, 9e-3)) < 4e-3;
            let far = |p: DVec3| near(p) || p.distance(DVec3::new(-8e-3, 0.0, 0.0)) < 3e-3;
            let sets = [some(&hybrid, near), some(&hybrid, far), vec![], some(&hybrid, |p| p.x > 0.2e-3)];
            for (active, is_prestrained) in sets.iter().flat_map(|set| [(set, true), (set, false)]) {
                running.wake(&hybrid, active, &PrestrainDecay::default());
                let decay = some_prestrain(&hybrid, running.cells(), &mut random);
                let decay = if is_prestrained { decay } else { PrestrainDecay::default() };
                running.put_prestrains(&decay);
                let set: BTreeSet<u32> = active.iter().copied().collect();
                let patch = Patch::new(&hybrid.partition, &set).with_prestrain(decay.clone());
                let rest = patch.at_rest(&hybrid.partition);
                let shaken = |list: &[DVec3], size: f64, random: &mut Random| -> Vec<DVec3> {
                    list.iter().map(|p| *p + DVec3::new(3.0, 2.0, 1.0) * size + random.vector() * size).collect()
                };
                let at = Field {
                    nodes: shaken(&rest.nodes, 0.1e-3, &mut random),
                    particles: shaken(&rest.particles, 0.1e-3, &mut random),
                };
                let zero = |list: &[DVec3]| vec![DVec3::ZERO; list.len()];
                let rate = Field {
                    nodes: shaken(&zero(&rest.nodes), 0.1, &mut random),
                    particles: shaken(&zero(&rest.particles), 0.1, &mut random),
                };
                let (expected, expected_w) = patch.forces_n(&hybrid.materials(), &at, &rate);
                let joined = |field: &Field| [&field.nodes[..], &field.particles].concat();
                let (expected, x, v) = (joined(&expected), joined(&at), joined(&rate));
                let mut forces = x.clone();
                running.displace(&hybrid, &x);
                forces.fill(DVec3::ZERO);
                let mut found = running.add_coarse_forces_n(&v, decay.left(), &mut forces);
                found += running.add_cell_forces_n(&hybrid, &v, decay.left(), &mut forces);
                let worst = forces.iter().zip(&expected).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                println!("{precision:?}: {:.1e}", worst / largest(&expected));
                assert!(worst < bound * largest(&expected), "{precision:?}, {}: {worst:e}", active.len());
                assert!((found.viscous_w - expected_w).abs() <= 10.0 * bound * expected_w, "{found:?} {expected_w}");
                // s ∂U/∂s
                let energy_j = |time_s: f64| {
                    let mut decay = decay.clone();
                    decay.advance(time_s);
                    patch.clone().with_prestrain(decay).energy_j(&hybrid.materials(), &at)
                };
                let step_s = 1e-6;
                let slope_w = (energy_j(step_s) - energy_j(-step_s)) / (2.0 * step_s);
                let difference_j = found.prestrain_j + DECAY_S * slope_w;
                assert!(difference_j.abs() <= 100.0 * bound.max(1e-9) * energy_j(0.0), "{found:?} {slope_w}");
                assert_eq!(found.prestrain_j != 0.0, is_prestrained);

                let mass_matrix =
                    MassMatrix::new(&hybrid.partition, &hybrid.masses, &set).factorise(&hybrid.free).unwrap();
                let nodes = hybrid.node_count();
                let mut accelerations = expected[..nodes].to_vec();
                mass_matrix.accelerate(&hybrid.free, &mut accelerations);
                let particles = expected[nodes..].iter().zip(mass_matrix.matrix().particle_kg()).map(|(f, m)| *f / *m);
                accelerations.extend(particles);
                let mut found = expected.clone();
                running.mass_matrix.accelerate(&mut found);
                let worst = found.iter().zip(&accelerations).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                assert!(worst < 1e-9 * largest(&accelerations), "{worst:e} of {:e}", largest(&accelerations));
                let mut momenta = v.clone();
                running.mass_matrix.momenta(&hybrid, &v, &mut momenta);
                let of_nodes = mass_matrix.matrix().momenta(&v[..nodes]);
                let worst = momenta.iter().zip(&of_nodes).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                assert!(worst < 1e-12 * largest(&of_nodes), "{worst:e}");
                // Gravity moves everything alike.
                let mut weight = zero(&x);
                running.mass_matrix.add_weight_n(DVec3::X, &mut weight);
                running.mass_matrix.momenta(&hybrid, &vec![DVec3::X; x.len()], &mut momenta);
                let worst = weight.iter().zip(&momenta).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
                assert!(worst < 1e-12 * largest(&weight), "{worst:e}");
            }
        }
    }
}
