//! A tick of a hybrid body pressed by a sphere: block of 80 × 80 × 40 mm in 192 coarse tets, E = 10 kPa, ν = 0.45, particles 2.5 mm apart of which so many are
//! awake: `cargo bench -p palpate-physics --bench hybrid`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
#[path = "../tests/rig/mod.rs"]
mod rig;
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    Settings, Surface,
    contact::Coupling,
    hybrid::{ParticleSpec, Skin, Waking, wake_only},
    material::Law,
};
use rig::{Rig, body, bricks, even, hold, material, nodes_where, sphere};

fn pressed(active: usize) -> Rig {
    let axes =
        |cells: usize| bricks(&even(-0.04, 0.04, 2 * cells), &even(-0.04, 0.04, 2 * cells), &even(-0.04, 0.0, cells));
    let (coarse, fine) = (axes(2), axes(16));
    let surface = Surface::of(&fine).unwrap();
    let positions = surface.nodes.iter().map(|&n| fine.positions_m()[n as usize]).collect();
    let mut spec = body(coarse, material(Law::StableNeoHookean, 10e3, 0.45));
    spec.particles = Some(ParticleSpec {
        skin: Skin::new(positions, surface.triangles).unwrap(),
        spacing_m: 2.5e-3,
        lattice_through_m: DVec3::ZERO,
        most_active: active.max(1),
        waking: Waking::ByHand,
    });
    spec.prescribed = vec![hold("bottom", nodes_where(&spec.mesh, |p| p.z < -0.0399), [true; 3])];
    spec.settings = Settings::for_particles();
    spec.tools = vec![sphere(8e-3, DVec3::Z * 9e-3, Coupling::Rigid)];
    let mut rig = Rig::new(spec);
    let partition = rig.model.hybrid().unwrap().partition();
    let mut near: Vec<u32> = (0..partition.particle_count() as u32).collect();
    near.sort_by(|&a, &b| {
        partition.particle_m(a).length_squared().total_cmp(&partition.particle_m(b).length_squared())
    });
    near.truncate(active);
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, near);
    for tick in 0..200 {
        rig.tick_at(DVec3::Z * (8e-3 - 2e-3 * f64::from(tick) / 200.0));
    }
    rig
}

fn ticks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hybrid tick");
    for active in [0, 50, 200, 600, 1400] {
        let mut rig = pressed(active);
        let (substeps, awake) = (rig.model.substeps(), rig.state.active.len());
        println!(
            "{awake} awake, {substeps} substeps, pressed with {:.4} N, {} samples",
            rig.state.tools[0].contact_force_n.z, rig.state.tools[0].contacts
        );
        group.bench_function(format!("{active} active"), |b| b.iter(|| rig.tick_at(DVec3::Z * 6e-3)));
    }
}

criterion_group!(benches, ticks);
criterion_main!(benches);
