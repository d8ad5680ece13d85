//! A flat sheet of some 10 000 triangles on springs, all awake: forces of the coarse springs, and steps with two rings
//! refined: `cargo bench -p palpate-physics --bench springs`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
use criterion::{Criterion, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    bodies::mass_spring::{
        AnchorLaw, AwakeNodes, HalfSpring, Net, Region, SpringModel, SpringMotion, SpringRows, SpringScratch,
        SpringSpec, Wanted, net::hexagonal_patch, region::Constants,
    },
    lanes::InstructionSet,
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

/// A step: levels and nodes as wanted, forces, kick and drift.
fn steps(criterion: &mut Criterion) {
    let surface = hexagonal_patch(41, 0.002).unwrap();
    let coarse = Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 6.0 };
    let spec = SpringSpec {
        coarse,
        fine: Constants { mesh_n_per_m: 42.0, anchor_n_per_m: 4.2 },
        anchor_law: AnchorLaw::Linear,
        mass_kg: vec![1e-3; surface.positions_m().len()],
        held: vec![],
        most_awake: surface.positions_m().len() + 500,
        most_refined: 200,
        surface,
    };
    let model = SpringModel::build(spec).unwrap();
    let awake: Vec<u32> = (0..model.vertices()).collect();
    let refined: Vec<u32> = Region::rings(model.surface(), &[0], 2).triangles().iter().copied().collect();
    let motion = || SpringMotion::at_rest(&model, awake.iter().copied());
    let (mut motion, mut scratch) = (motion(), SpringScratch::new(&model));
    let mut x: Vec<DVec3> = awake.iter().map(|&id| model.rest_m()[id as usize]).collect();
    let mut v = vec![DVec3::ZERO; x.len()];
    let mut forces = Vec::new();
    let mut group = criterion.benchmark_group("spring step");
    println!("largest frequency at most {:.0} rad/s", model.frequency_rad_per_s());
    let mut step = |wanted: &[u32], level_step: f64| {
        let wanted = Wanted { refined: wanted, step: level_step, fine: model.spec().fine, awake: &awake };
        scratch.advance(&model, &mut motion, AwakeNodes { x_m: &mut x, v_m_per_s: &mut v }, &wanted);
        forces.clear();
        forces.resize(x.len(), DVec3::ZERO);
        scratch.add_forces_n(&model, &motion, &x, &mut forces);
        for (((x, v), force), mass) in x.iter_mut().zip(&mut v).zip(&forces).zip(scratch.mass_kg()) {
            *v += *force * (1e-3 / mass);
            *x += *v * 1e-3;
        }
    };
    group.bench_function("coarse", |b| b.iter(|| step(&[], 1.0)));
    step(&refined, 1.0);
    group.bench_function("two rings refined", |b| b.iter(|| step(&refined, 1.0)));
    // Levels go to and fro, and never to 0.
    let mut up = false;
    group.bench_function("levels changing", |b| {
        b.iter(|| {
            up = !up;
            step(if up { &refined } else { &[] }, 0.3);
        });
    });
}

criterion_group!(benches, forces, steps);
criterion_main!(benches);
