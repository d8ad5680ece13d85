//! The kernels of a hybrid body's cells, beside their oracle, on 1 000 full cells and on the 1 331 of the same box off the lattice, of which 602 are cut:
//! `cargo bench -p palpate-physics --bench cells`.
#![allow(missing_docs)] // criterion's macros
#![allow(clippy::unwrap_used)] // helpers of a benchmark
#[path = "../tests/support/mod.rs"]
mod support;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    Precision, TetMesh,
    bodies::hybrid::{
        Skin,
        cell::RestCell,
        composite::Composite,
        kernels::{CellRow, CutCells, Room, RowKernel},
        moments::integrate,
        partition::Partition,
        sites::{CORNERS, Sites},
    },
    lanes::InstructionSet,
    material::{Convention, Lame, Law, Material, Viscosity},
};

const SPACING_M: f64 = 2.5e-3;

/// Particles and rest data.
type Cell = ([u32; 8], RestCell);

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
        (partition.corners(c), RestCell::new(SPACING_M, 1.0, &moments))
    };
    let rest = (0..partition.particle_count() as u32).map(|p| partition.particle_m(p)).collect();
    ((0..partition.cells().len()).map(cell).collect(), rest)
}

fn kernels(criterion: &mut Criterion) {
    let mut random = support::Random(1);
    for (name, offset) in [("full", 0.0), ("some cut", 0.5)] {
        let (cells, rest) = cells(offset);
        let u: Vec<DVec3> = rest.iter().map(|_| random.vector() * 2e-4).collect();
        let mut forces = vec![DVec3::ZERO; rest.len()];
        for law in Law::ALL {
            let lame = Lame { lambda_pa: 30e3, mu_pa: 3e3 };
            let material = Material::new(law, lame, Viscosity::default(), Convention::Consistent);
            let mut group = criterion.benchmark_group(format!("cells, {name}, {law:?}"));
            group.throughput(Throughput::Elements(cells.len() as u64));
            group.bench_function("oracle", |b| {
                b.iter(|| {
                    forces.fill(DVec3::ZERO);
                    for (points, cell) in &cells {
                        let y = points.map(|p| rest[p as usize] + u[p as usize]);
                        let found = cell.forces_n(&material, &y, &y).0;
                        points.iter().zip(found).for_each(|(&p, f)| forces[p as usize] += f);
                    }
                });
            });
            for precision in [Precision::Single, Precision::Double] {
                for set in InstructionSet::available() {
                    let room = Room { points: rest.len(), cells: cells.len() };
                    if offset == 0.0 {
                        let row = |r: u32| {
                            let at = |j: u32, k: u32| ((r / 10 + k) * 11 + r % 10 + j) * 11;
                            CellRow {
                                points: [at(0, 0), at(1, 0), at(0, 1), at(1, 1)],
                                cells: 10,
                                material: 0,
                                first: 10 * r,
                                prestrained: false,
                            }
                        };
                        let mut rows: Vec<CellRow> = (0..100).map(row).collect();
                        let kernel = RowKernel::new(SPACING_M, 1.0, &[material], precision, room);
                        let mut kernel = kernel.with_instruction_set(set);
                        kernel.set_displacements(&u);
                        group.bench_function(format!("{precision:?} {set:?}, rows of 10"), |b| {
                            b.iter(|| kernel.forces(&rows, rest.len(), 0.5));
                        });
                        for row in &mut rows {
                            row.prestrained = true;
                        }
                        group.bench_function(format!("{precision:?} {set:?}, rows of 10 with prestrain"), |b| {
                            b.iter(|| kernel.forces(&rows, rest.len(), 0.5));
                        });
                    }
                    let mut kernel = CutCells::with_capacity(SPACING_M, &[material], precision, room);
                    kernel = kernel.with_instruction_set(set);
                    kernel.start(0, cells.len());
                    cells.iter().enumerate().for_each(|(c, (points, rest))| kernel.put(c, *points, rest));
                    kernel.set_displacements(&u);
                    group.bench_function(format!("{precision:?} {set:?}, as cut"), |b| {
                        b.iter(|| kernel.forces(rest.len(), 0.5));
                    });
                }
            }
        }
    }
}

criterion_group!(benches, kernels);
criterion_main!(benches);
