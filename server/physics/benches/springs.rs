//! Forces of mesh springs: a flat sheet of some 10 000 triangles, all awake: `cargo bench -p palpate-physics --bench springs`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    simd::{HalfSpring, InstructionSet, SpringRows},
    spring::{Net, net::hexagonal_patch},
};

fn forces(criterion: &mut Criterion) {
    let surface = hexagonal_patch(41, 0.002).unwrap();
    let net = Net::uniform(&surface, 60.0, 6.0);
    let lift = |p: &DVec3| *p + DVec3::Z * 2e-3 * (-(p.length() / 0.01).powi(2)).exp();
    let x: Vec<DVec3> = net.rest_m.iter().map(lift).collect();
    let mut rows = SpringRows::with_room(x.len(), 8);
    for node in 0..x.len() as u32 {
        let half = |&edge: &u32| HalfSpring {
            neighbour: surface.other_end(edge, node),
            rest_length_m: surface.length_m(edge),
            stiffness_n_per_m: 60.0,
        };
        rows.push(surface.edges_at(node).iter().map(half));
    }
    let mut group = criterion.benchmark_group("spring forces");
    println!("{} triangles, {} nodes, {} springs", surface.triangles().len(), x.len(), net.springs.len());
    let mut forces = vec![DVec3::ZERO; x.len()];
    for set in InstructionSet::available() {
        let rows = rows.clone().with_instruction_set(set);
        group.bench_function(format!("{set:?}"), |b| b.iter(|| rows.add_forces_n(&x, &mut forces)));
    }
    group.bench_function("plain", |b| b.iter(|| net.forces_n(&x)));
}

criterion_group!(benches, forces);
criterion_main!(benches);
