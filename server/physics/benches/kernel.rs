//! The force kernel per law and precision, beside its oracle, on a block of 1 296 tets: `cargo bench -p palpate-physics`.
#![allow(missing_docs)] // criterion's macros
#[path = "../tests/support/mod.rs"]
mod support;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use palpate_physics::{
    Precision,
    elements::{integration_points::IntegrationPoints, linear_tet::RestTet},
    kernels::ForceKernel,
    lanes::InstructionSet,
    material::{Convention, Lame, Law, Material, Viscosity},
};

fn kernels(criterion: &mut Criterion) {
    let mut random = support::Random(1);
    let mesh = support::block([6, 6, 6], 5e-3, 0.1, &mut random);
    let rest: Vec<RestTet> = (0..mesh.tets().len()).map(|t| RestTet::new(&mesh.edge_matrix_m(t))).collect();
    let x: Vec<DVec3> = mesh.positions_m().iter().map(|p| *p + random.vector() * 5e-4).collect();
    let v: Vec<DVec3> = x.iter().map(|_| random.vector()).collect();
    let (tet_material, mut forces) = (vec![0; rest.len()], vec![DVec3::ZERO; x.len()]);
    for law in Law::ALL {
        for viscosity in [Viscosity::default(), Viscosity { phi_pa_s: 1.0, psi_pa_s: 1.0 }] {
            let lame = Lame { lambda_pa: 30e3, mu_pa: 3e3 };
            let materials = [Material::new(law, lame, viscosity, Convention::Consistent)];
            let name = format!("{law:?}{}", if viscosity.is_zero() { "" } else { " viscous" });
            let mut group = criterion.benchmark_group(name);
            group.throughput(Throughput::Elements(rest.len() as u64));
            let linear = IntegrationPoints::of_linear_tets(&mesh, &rest, &tet_material, &materials);
            let smoothed = IntegrationPoints::of_smoothed_tets(&mesh, &rest, &tet_material, &materials);
            group.bench_function("oracle", |b| b.iter(|| linear.forces_n(&x, &v, &mut forces)));
            group.bench_function("oracle, smoothed", |b| b.iter(|| smoothed.forces_n(&x, &v, &mut forces)));
            for precision in [Precision::Single, Precision::Double] {
                for set in InstructionSet::available() {
                    for (kind, kernel) in [
                        ("", ForceKernel::build(&mesh, &linear, precision)),
                        (", smoothed", ForceKernel::build(&mesh, &smoothed, precision)),
                    ] {
                        let kernel = kernel.with_instruction_set(set);
                        let mut scratch = kernel.scratch();
                        group.bench_function(format!("{precision:?} {set:?}{kind}"), |b| {
                            b.iter(|| kernel.forces_n(mesh.positions_m(), &x, &v, &mut forces, &mut scratch));
                        });
                    }
                }
            }
        }
    }
}

criterion_group!(benches, kernels);
criterion_main!(benches);
