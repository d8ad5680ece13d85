//! A tick of a hybrid body pressed by a sphere: block of 80 × 80 × 40 mm in 192 coarse tets, E = 10 kPa, ν = 0.45, particles 2.5 mm apart of which so many are
//! awake: `cargo bench -p palpate-physics --bench hybrid`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
#[path = "../tests/rig/mod.rs"]
mod rig;
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{Settings, bodies::hybrid::Waking, contact::Coupling};
use rig::{Rig, held_below, hybrid_block, sphere, wake_nearest};

fn pressed(active: usize) -> Rig {
    let mut spec = held_below(hybrid_block((0.04, 2, 16), 0.45, active.max(1), Waking::ByHand));
    spec.settings = Settings::for_particles();
    spec.tools = vec![sphere(8e-3, DVec3::Z * 9e-3, Coupling::Rigid)];
    let mut rig = Rig::new(spec);
    wake_nearest(&mut rig, active);
    for tick in 0..200 {
        rig.tick_at(DVec3::Z * (8e-3 - 2e-3 * f64::from(tick) / 200.0));
    }
    rig
}

fn ticks(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("hybrid tick");
    for active in [0, 50, 200, 600, 1400] {
        let mut rig = pressed(active);
        let (substeps, awake) = (rig.model.substeps(), rig.state.body.active_particles().len());
        println!(
            "{awake} awake, {substeps} substeps, pressed with {:.4} N, {} samples",
            rig.state.mechanical.tools[0].contact_force_n.z, rig.state.mechanical.tools[0].contacts
        );
        group.bench_function(format!("{active} active"), |b| b.iter(|| rig.tick_at(DVec3::Z * 6e-3)));
    }
}

criterion_group!(benches, ticks);
criterion_main!(benches);
