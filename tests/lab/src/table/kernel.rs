//! ns per tet of the oracle and of the kernel on every instruction set, with the error against the oracle.
use crate::{bodies, timing::interleaved};
use glam::DVec3;
use miette::Result;
use palpate_physics::{
    Precision,
    elements::{integration_points::IntegrationPoints, linear_tet::RestTet},
    kernels::ForceKernel,
    lanes::InstructionSet,
    material::Law,
};

/// About what a haptic body has: the whole of it stays in the L2 cache.
const TETS: u32 = 10_000;
const ROUNDS: usize = 200;

pub(super) fn print() -> Result<()> {
    let shape = bodies::ventricle(3.6, TETS)?;
    let mesh = &shape.mesh;
    let rest: Vec<RestTet> = (0..mesh.tets().len()).map(|t| RestTet::new(&mesh.edge_matrix_m(t))).collect();
    let x: Vec<DVec3> = mesh.positions_m().iter().map(|p| *p + DVec3::new(p.y, 0.5 * p.z, p.x) * 0.1).collect();
    let v = vec![DVec3::ZERO; x.len()];
    println!("Force kernel, gather and scatter included: {} tets, {} nodes, one core", rest.len(), x.len());
    println!("error: largest against the oracle over the largest nodal force\n");
    println!("| law | kernel | ns/tet median | p99 | times faster | error |\n|---|---|---|---|---|---|");
    for law in Law::ALL {
        let (materials, tet_material) = ([bodies::material(law, 10e3, 0.45)?], vec![0; rest.len()]);
        let oracle = IntegrationPoints::of_linear_tets(mesh, &rest, &tet_material, &materials);
        let mut expected = vec![DVec3::ZERO; x.len()];
        oracle.forces_n(&x, &v, &mut expected);
        let mut kernels = Vec::new();
        for (name, precision) in [("f32", Precision::Single), ("f64", Precision::Double)] {
            for set in InstructionSet::available() {
                let kernel = ForceKernel::build(mesh, &oracle, precision);
                kernels.push((format!("{name} {set:?}"), kernel.with_instruction_set(set)));
            }
        }
        let mut errors = vec![0.0];
        let mut oracle_forces = expected.clone();
        let mut contenders: Vec<Box<dyn FnMut() + '_>> = vec![Box::new(|| {
            oracle.forces_n(&x, &v, &mut oracle_forces);
        })];
        for (_, kernel) in &kernels {
            let (mut forces, mut scratch) = (expected.clone(), kernel.scratch());
            kernel.forces_n(mesh.positions_m(), &x, &v, &mut forces, &mut scratch);
            let worst = forces.iter().zip(&expected).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
            errors.push(worst / expected.iter().map(|f| f.length()).fold(0.0, f64::max));
            let (x, v) = (&x, &v);
            contenders.push(Box::new(move || {
                kernel.forces_n(mesh.positions_m(), x, v, &mut forces, &mut scratch);
            }));
        }
        let rounds = if law == Law::FixedCorotated { ROUNDS / 5 } else { ROUNDS };
        let summaries = interleaved(&mut contenders, rounds);
        let names = std::iter::once("scalar f64 oracle").chain(kernels.iter().map(|(name, _)| name.as_str()));
        for ((name, summary), error) in names.zip(&summaries).zip(&errors) {
            let per_tet = |seconds: f64| seconds * 1e9 / rest.len() as f64;
            println!(
                "| {law:?} | {name} | {:.2} | {:.2} | {:.1} | {error:.1e} |",
                per_tet(summary.median_s),
                per_tet(summary.p99_s),
                summaries[0].median_s / summary.median_s
            );
        }
    }
    Ok(())
}
