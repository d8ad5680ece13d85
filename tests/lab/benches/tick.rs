//! µs per 1 ms tick of ventricles and shells, free: `cargo bench -p palpate-lab`.
#![allow(missing_docs)] // criterion's macros
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use miette::Result;
use palpate_lab::{bodies, press::Press};
use palpate_physics::material::Law;

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
            let updates = u64::from(model.substeps()) * model.body().tets().map_or(0, |mesh| mesh.tets().len()) as u64;
            group.throughput(Throughput::Elements(updates));
            let name = format!("{name}, {} substeps", model.substeps());
            group.bench_with_input(
                BenchmarkId::new(name, model.body().tets().map_or(0, |mesh| mesh.tets().len())),
                &model,
                |bencher, model| {
                    let mut ringing = Press::new(model, 0.0, 1);
                    bencher.iter(|| ringing.tick());
                },
            );
        }
    }
    group.finish();
    Ok(())
}

criterion_group!(benches, ticks);
criterion_main!(benches);
