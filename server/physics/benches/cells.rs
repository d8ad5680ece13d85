//! The kernel of a hybrid body's cells, beside its oracle, on 1 000 full cells and on the 1 331 of the same box off the lattice, of which 602 are cut:
//! `cargo bench -p palpate-physics --bench cells`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
#[path = "../tests/support/mod.rs"]
mod support;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    Precision, TetMesh,
    hybrid::{
        Skin,
        cell::RestCell,
        composite::Composite,
        moments::integrate,
        partition::Partition,
        sites::{CORNERS, Sites},
    },
    material::{Convention, Lame, Law, Material, Viscosity},
    simd::{CellKernel, CellWindow, InstructionSet, KernelCell},
};

const SPACING_M: f64 = 2.5e-3;

/// Particles, rest data, and whether it is full.
type Cell = ([u32; 8], RestCell, bool);

/// A box of ten cells each way, whose corner is `offset` cells from a site.
fn cells(offset: f64) -> (Vec<Cell>, Vec<DVec3>) {
    let p = CORNERS.map(|c| c * (10.0 * SPACING_M)).to_vec();
    let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let skin = Skin::new(p, triangles).unwrap();
    let sites = Sites::covering(skin.bounds_m(), SPACING_M, DVec3::splat(offset * SPACING_M));
    let moments = integrate(&skin, &sites, &mut |_| {});
    let far = 40.0 * SPACING_M;
    let around = [-DVec3::ONE, DVec3::X * 3.0, DVec3::Y * 3.0, DVec3::Z * 3.0].map(|c| c * far).to_vec();
    let coarse = TetMesh::new(around, vec![[0, 1, 2, 3]]).unwrap();
    let partition = Partition::new(sites, Composite::new(&coarse), &moments);
    let cell = |c: usize| {
        let moments = partition.moments(c);
        (partition.corners(c), RestCell::new(SPACING_M, 1.0, &moments), moments.0 > SPACING_M.powi(3) * (1.0 - 1e-12))
    };
    let rest = (0..partition.particle_count() as u32).map(|p| partition.particle_m(p)).collect();
    ((0..partition.cells().len()).map(cell).collect(), rest)
}

fn kernels(criterion: &mut Criterion) {
    let mut random = support::Random(1);
    for (name, offset) in [("full", 0.0), ("some cut", 0.5)] {
        let (cells, rest) = cells(offset);
        let u: Vec<DVec3> = rest.iter().map(|_| random.vector() * 2e-4).collect();
        let v: Vec<DVec3> = rest.iter().map(|_| random.vector()).collect();
        let mut forces = vec![DVec3::ZERO; rest.len()];
        for law in [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated] {
            let lame = Lame { lambda_pa: 30e3, mu_pa: 3e3 };
            let material = Material::new(law, lame, Viscosity::default(), Convention::Consistent);
            let mut group = criterion.benchmark_group(format!("cells, {name}, {law:?}"));
            group.throughput(Throughput::Elements(cells.len() as u64));
            group.bench_function("oracle", |b| {
                b.iter(|| {
                    forces.fill(DVec3::ZERO);
                    for (points, cell, _) in &cells {
                        let y = points.map(|p| rest[p as usize] + u[p as usize]);
                        let found = cell.forces_n(&material, &y, &y).0;
                        points.iter().zip(found).for_each(|(&p, f)| forces[p as usize] += f);
                    }
                });
            });
            let listed: Vec<KernelCell<'_>> = cells
                .iter()
                .map(|(points, rest, is_full)| KernelCell { points: *points, rest, is_full: *is_full, material: 0 })
                .collect();
            for precision in [Precision::Single, Precision::Double] {
                for set in InstructionSet::available() {
                    if offset == 0.0 {
                        let all: Vec<([usize; 3], u16)> =
                            (0..1000).map(|c| ([c % 10, c / 10 % 10, c / 100], 0)).collect();
                        let window = CellWindow::build([10; 3], SPACING_M, 1.0, &all, &[material], precision);
                        let window = window.with_instruction_set(set);
                        let mut scratch = window.scratch();
                        for (p, (u, v)) in u.iter().zip(&v).enumerate() {
                            scratch.set(window.particle([p % 11, p / 11 % 11, p / 121]), *u, *v);
                        }
                        group.bench_function(format!("{precision:?} {set:?}, window"), |b| {
                            b.iter(|| window.add_forces(&mut scratch));
                        });
                    }
                    let kernel = CellKernel::build(&listed, rest.len(), &[material], precision);
                    let kernel = kernel.with_instruction_set(set);
                    let mut scratch = kernel.scratch();
                    group.bench_function(format!("{precision:?} {set:?}"), |b| {
                        b.iter(|| kernel.forces_n(&u, &v, &mut forces, &mut scratch));
                    });
                }
            }
        }
    }
}

criterion_group!(benches, kernels);
criterion_main!(benches);
