//! Bodies with particles, tick by tick.
#![allow(clippy::unwrap_used)]
mod rig;
use glam::DVec3;
use palpate_physics::{
    Energies, LoadSpec, ModelSpec, Precision, Settings, Surface,
    contact::Coupling,
    hybrid::{
        ParticleSpec, Skin, Waking,
        equilibrium::equilibrium,
        patch::{Field, Patch},
        place::Place,
    },
    material::Law,
    snapshot,
};
use rig::{Rig, at, body, bricks, even, hold, material, nodes_where, sphere};
use std::collections::BTreeSet;

const H_M: f64 = 2.5e-3;

/// 40 × 40 × 20 mm in 24 coarse tets, particles 2.5 mm apart, its lower face at z = −20 mm.
fn block(poisson_ratio: f64) -> ModelSpec {
    let axes = |cells: usize| {
        let side = even(-0.02, 0.02, 2 * cells);
        bricks(&side, &side, &even(-0.02, 0.0, cells))
    };
    let (coarse, fine) = (axes(1), axes(8));
    let surface = Surface::of(&fine).unwrap();
    let positions = surface.nodes.iter().map(|&n| fine.positions_m()[n as usize]).collect();
    let skin = Skin::new(positions, surface.triangles).unwrap();
    let mut spec = body(coarse, material(Law::StableNeoHookean, 10e3, poisson_ratio));
    spec.particles = Some(ParticleSpec {
        skin,
        spacing_m: H_M,
        lattice_through_m: DVec3::ZERO,
        most_active: 400,
        waking: Waking::ByHand,
    });
    spec
}

fn held(mut spec: ModelSpec) -> ModelSpec {
    let bottom = nodes_where(&spec.mesh, |p| p.z < -0.0199);
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec
}

/// Particles within a distance of a point, at rest.
fn near(rig: &Rig, point: DVec3, distance_m: f64) -> Vec<u32> {
    let partition = rig.model.hybrid().unwrap().partition();
    (0..partition.particle_count() as u32).filter(|&p| partition.particle_m(p).distance(point) < distance_m).collect()
}

/// Vertices of the skin within a distance of a point.
fn vertices_near(spec: &ModelSpec, point: DVec3, distance_m: f64) -> Vec<u32> {
    let positions = spec.particles.as_ref().unwrap().skin.positions_m();
    (0..positions.len() as u32).filter(|&v| positions[v as usize].distance(point) < distance_m).collect()
}

#[test]
fn damped_the_loop_comes_to_rest_where_newtons_method_says() {
    let mut spec = held(block(0.45));
    let pressed = vertices_near(&spec, DVec3::ZERO, 5e-3);
    let force_n = DVec3::new(2e-3, 0.0, -2e-2) / pressed.len() as f64;
    spec.loads = vec![LoadSpec::NodalForces(pressed.iter().map(|&v| (v, force_n)).collect())];
    spec.settings.mass_damping_per_s = 40.0;
    let mut rig = Rig::new(spec);
    let awake = near(&rig, DVec3::ZERO, 10e-3);
    rig.state.wake_only(&rig.model, awake);
    assert!(rig.state.active.len() > 120, "{}", rig.state.active.len());
    let mut drive = rig.still();
    drive.load_factors = vec![1.0];
    for _ in 0..1500 {
        let report = rig.tick(&drive);
        assert!(report.quarantined.is_none());
    }
    let hybrid = rig.model.hybrid().unwrap();
    let active: BTreeSet<u32> = rig.state.active.ids().iter().copied().collect();
    let patch = Patch::new(hybrid.partition(), &active);
    let rest = patch.at_rest(hybrid.partition());
    let zero = |list: &[DVec3]| vec![DVec3::ZERO; list.len()];
    let mut loads_n = Field { nodes: zero(&rest.nodes), particles: zero(&rest.particles) };
    let skin = rig.model.surface_rest_positions_m();
    let place = |v: u32| Place::new(hybrid.partition(), skin[v as usize]);
    pressed.iter().for_each(|&v| place(v).push(hybrid.partition(), &patch, force_n, &mut loads_n));
    let found = equilibrium(hybrid.partition(), &patch, &hybrid.materials(), hybrid.free(), &loads_n, 1e-10).unwrap();
    let mut positions = Vec::new();
    rig.model.surface_positions_m(&rig.state, &mut positions);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (v, x) in positions.iter().enumerate() {
        let expected = place(v as u32).of(hybrid.partition(), &patch, &found);
        worst = worst.max(x.distance(expected));
        largest = largest.max(expected.distance(skin[v]));
    }
    assert!(largest > 2e-4 && worst < 1e-9 * largest, "{worst:e} of {largest:e}");
}

#[test]
fn free_flight_keeps_momenta_and_energy() {
    let mut rig = Rig::new(block(0.45));
    let awake = near(&rig, DVec3::ZERO, 10e-3);
    let nodes = rig.state.x.len();
    for (x, v) in rig.state.x.iter().zip(&mut rig.state.v) {
        *v = DVec3::new(0.3, 0.0, 0.0) + DVec3::new(5.0, 0.0, 20.0).cross(*x) + DVec3::new(x.z, 0.0, x.x) * 8.0;
    }
    rig.state.wake_only(&rig.model, awake);
    assert!(rig.state.x.len() > nodes + 120);
    let hybrid = rig.model.hybrid().unwrap();
    let (linear, angular) = hybrid.momentum(&rig.state);
    let start = Energies::of(&rig.model, &rig.state).held_j();
    let drive = rig.still();
    for _ in 0..200 {
        rig.tick(&drive);
    }
    let hybrid = rig.model.hybrid().unwrap();
    let (p, l) = hybrid.momentum(&rig.state);
    assert!((p - linear).length() < 1e-12 * linear.length(), "{p} {linear}");
    assert!((l - angular).length() < 1e-12 * angular.length(), "{l} {angular}");
    let end = Energies::of(&rig.model, &rig.state).held_j();
    assert!((end / start - 1.0).abs() < 1e-3, "{start} {end}");
}

/// A sphere pressed on the block.
fn pressed(precision: Precision) -> Rig {
    let mut spec = held(block(0.45));
    spec.settings = Settings { precision, mass_damping_per_s: 20.0, ..spec.settings };
    spec.tools = vec![sphere(6e-3, DVec3::Z * 7e-3, Coupling::Rigid)];
    spec.tools[0].friction_coefficient = 0.3;
    spec.gravity_m_per_s2 = DVec3::Z * -9.81;
    Rig::new(spec)
}

#[test]
fn a_sphere_is_pushed_back_with_the_work_it_does() {
    let mut rig = pressed(Precision::Double);
    let awake = near(&rig, DVec3::ZERO, 10e-3);
    rig.state.wake_only(&rig.model, awake);
    let balance = Energies::of(&rig.model, &rig.state).balance_j();
    for tick in 0..600 {
        let depth_m = 2e-3 * f64::from(tick.min(300)) / 300.0;
        rig.tick_at(DVec3::new(0.0, 1e-3 * f64::from(tick) / 600.0, 6e-3 - depth_m));
    }
    let tool = &rig.state.tools[0];
    assert!(tool.contact_force_n.z > 0.05 && tool.contact_force_n.y < 0.0, "{}", tool.contact_force_n);
    let energies = Energies::of(&rig.model, &rig.state);
    let error = (energies.balance_j() - balance).abs() / energies.external_work_j;
    assert!(error < 2e-3, "{error:e}");
}

#[test]
fn what_was_saved_goes_on_with_the_same_bits() {
    let mut rig = pressed(Precision::Single);
    let awake = near(&rig, DVec3::ZERO, 9e-3);
    rig.state.wake_only(&rig.model, awake);
    let way = |tick: u32| DVec3::Z * (6e-3 - 2e-3 * (f64::from(tick) * 0.02).sin());
    for tick in 0..100 {
        rig.tick_at(way(tick));
    }
    let bytes = snapshot::save(&rig.model, &rig.state);
    let mut other = pressed(Precision::Single);
    other.state = snapshot::restore(&other.model, &bytes).unwrap();
    assert_eq!(other.state.active, rig.state.active);
    for tick in 100..200 {
        rig.tick_at(way(tick));
        other.tick_at(way(tick));
    }
    assert_eq!(rig.state, other.state);
    assert_eq!(snapshot::state_hash(&rig.state), snapshot::state_hash(&other.state));
}

#[test]
fn looking_only_where_the_tool_may_be_costs_no_bit() {
    let run = |distant_contact: bool| {
        let mut rig = pressed(Precision::Double);
        let mut spec = rig.model.spec().clone();
        spec.settings.skips.distant_contact = distant_contact;
        rig = Rig::new(held(ModelSpec { mesh: block(0.45).mesh, prescribed: vec![], ..spec }));
        for tick in 0..400_u32 {
            if tick % 100 == 50 {
                let awake = near(&rig, DVec3::X * 1e-4 * f64::from(tick), 8e-3);
                rig.state.wake_only(&rig.model, awake);
            }
            let s = f64::from(tick) * 0.02;
            rig.tick(&rig::Drive { tools: vec![at(DVec3::new(0.01 * s.sin(), 0.0, 6e-3 - 3e-3 * s.sin()))], ..rig.still() });
        }
        assert!(rig.state.tools[0].contact_force_n.length() > 0.01);
        rig.state
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn zz_numbers() {
    let spec = held(block(0.45));
    let rig = Rig::new(spec);
    let hybrid = rig.model.hybrid().unwrap();
    let mu = 10e3 / 2.9;
    let full = (4.0 * (3.0 * 9.0 + 2.0) * mu / (1000.0 * H_M * H_M)).sqrt();
    println!("untouched: {} substeps, full {full}, omega {}", rig.model.substeps(), rig.model.max_natural_frequency_rad_per_s());
    let mut counts: Vec<usize> = hybrid.partition().shares().iter().map(|s| s.nodes.len()).collect();
    counts.sort_unstable();
    println!("nodes per share {counts:?}");
    let pairs: Vec<usize> = hybrid.partition().shares().iter().map(|s| s.moments_m2.iter().flatten().filter(|m| m.length() > 1e-15).count()).collect();
    println!("pairs {pairs:?}");
    for share in [1] { let _ = share; }
    let rig = pressed(Precision::Single);
    println!("touched: {} substeps", rig.model.substeps());
    let springs = hybrid.frequency_rad_per_s(&vec![0.0; hybrid.partition().particle_count()]);
    println!("{springs}");
}
