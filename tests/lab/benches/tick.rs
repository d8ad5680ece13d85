//! µs per 1 ms tick of ventricles and shells, free: `cargo bench -p palpate-lab`.
#![allow(missing_docs)] // criterion's macros
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use miette::Result;
use palpate_lab::bodies;
use palpate_physics::{Model, Scratch, State, TickInput, material::Law, step};

fn ticks(criterion: &mut Criterion) {
    bench(criterion).unwrap_or_else(|error| panic!("{error:?}"));
}

fn bench(criterion: &mut Criterion) -> Result<()> {
    let mut group = criterion.benchmark_group("tick");
    group.sample_size(20);
    for tets in [188, 1_352, 10_000, 50_000] {
        for (name, shape) in
            [("ellipsoid shell", bodies::ellipsoid(tets)?), ("ventricle 90 mm", bodies::ventricle(3.6, tets)?)]
        {
            let model = bodies::model(&shape, bodies::material(Law::StableNeoHookean, 10e3, 0.45)?, None)?;
            let updates = u64::from(model.substeps()) * model.mesh().tets().len() as u64;
            group.throughput(Throughput::Elements(updates));
            let name = format!("{name}, {} substeps", model.substeps());
            group.bench_with_input(BenchmarkId::new(name, model.mesh().tets().len()), &model, |bencher, model| {
                let (mut state, mut scratch) = ringing(model);
                let prescribed = vec![DVec3::ZERO; model.spec().prescribed.len()];
                let input = TickInput {
                    tools: &[],
                    load_factors: &[],
                    prescribed_displacements_m: &prescribed,
                    point_forces: &[],
                };
                bencher.iter(|| step(model, &mut state, &mut scratch, &input));
            });
        }
    }
    group.finish();
    Ok(())
}

fn ringing(model: &Model) -> (State, Scratch) {
    let mut state = State::at_rest(model);
    for (v, x) in state.v.iter_mut().zip(model.rest_positions_m()) {
        *v = DVec3::new(x.y, x.x, 0.0);
    }
    (state, Scratch::new(model))
}

criterion_group!(benches, ticks);
criterion_main!(benches);
