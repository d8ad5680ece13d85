//! Lamé's thick sphere under internal pressure, `a = 50 mm`, `b = 100 mm`, `E = 10 kPa`, `p = 1 kPa · 10⁻³` (small strain):
//! `u(r) = p a³/(E(b³ − a³)) · [(1 − 2ν) r + (1 + ν) b³/(2r²)]`. One octant with three planes of symmetry.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::common;
use common::{equilibrium, extrapolated, held, material, nodes_where, shell_octant, spec, triangles_where};
use glam::DVec3;
use palpate_physics::{LoadSpec, Model, material::Law};

const INNER_M: f64 = 0.05;
const OUTER_M: f64 = 0.1;
const YOUNG_PA: f64 = 10e3;
const PRESSURE_PA: f64 = 1.0;

fn exact_m(poisson: f64, r: f64) -> f64 {
    let (a3, b3) = (INNER_M.powi(3), OUTER_M.powi(3));
    PRESSURE_PA * a3 / (YOUNG_PA * (b3 - a3)) * ((1.0 - 2.0 * poisson) * r + (1.0 + poisson) * b3 / (2.0 * r * r))
}

/// Mean radial displacement (m) of the inner and outer surface, and the number of tets.
fn measured_m(law: Law, poisson: f64, cells: usize) -> ([f64; 2], usize) {
    let mesh = shell_octant(INNER_M, OUTER_M, cells, cells / 2);
    let on = |radius: f64| move |p: DVec3| (p.length() - radius).abs() < 1e-9;
    let planes = [("x", [true, false, false]), ("y", [false, true, false]), ("z", [false, false, true])];
    let prescribed = planes
        .iter()
        .enumerate()
        .map(|(axis, (name, axes))| held(&mesh, name, *axes, |p| p[axis].abs() < 1e-12))
        .collect();
    let cavity = triangles_where(&mesh, on(INNER_M));
    // Pressure pushes inwards, against the outward normal: outwards from the cavity.
    let loads = vec![LoadSpec::Pressure { triangles: cavity, pressure_pa: PRESSURE_PA, follower: false }];
    let model = Model::build(spec(mesh, material(law, YOUNG_PA, poisson), prescribed, loads)).unwrap();
    let found = equilibrium(&model, 1.0, &[]);
    let radial = |radius: f64| {
        let nodes = nodes_where(model.body().tets().unwrap(), on(radius));
        let grown = |&n: &u32| found.x[n as usize].length() - radius;
        nodes.iter().map(grown).sum::<f64>() / nodes.len() as f64
    };
    ([radial(INNER_M), radial(OUTER_M)], model.body().as_tet().unwrap().rest_tets().len())
}

/// What a study of three meshes, each twice as fine, found for u(a).
struct Study {
    /// Relative errors.
    errors: [f64; 3],
    /// Relative error of Richardson's limit.
    limit_error: f64,
}

fn study(law: Law, poisson: f64, meshes: [usize; 3]) -> Study {
    let exact = [exact_m(poisson, INNER_M), exact_m(poisson, OUTER_M)];
    let measured = meshes.map(|cells| measured_m(law, poisson, cells));
    let errors = measured.map(|([inner, _], _)| inner / exact[0] - 1.0);
    for (([inner, outer], tets), error) in measured.iter().zip(errors) {
        println!(
            "Lamé {law:?} ν = {poisson}: {tets} tets: u(a) = {:.4} µm ({:+.3} %), u(b) = {:.4} µm ({:+.3} %)",
            inner * 1e6,
            100.0 * error,
            outer * 1e6,
            100.0 * (outer / exact[1] - 1.0)
        );
    }
    let limit = extrapolated(measured[1].0[0], measured[2].0[0]);
    let limit_error = limit / exact[0] - 1.0;
    println!(
        "Lamé {law:?} ν = {poisson}: Richardson u(a) = {:.4} µm ({:+.3} %), order of the error {:.2}",
        limit * 1e6,
        100.0 * limit_error,
        order(errors)
    );
    Study { errors, limit_error }
}

/// Order of the error between the two finest meshes.
fn order(errors: [f64; 3]) -> f64 {
    (errors[1] / errors[2]).log2()
}

#[test]
fn the_formula_gives_the_published_numbers() {
    for (poisson, inner, outer) in [(0.3, 4.0, 1.5), (0.45, 4.2143, 1.1786), (0.49, 4.2714, 1.0929)] {
        assert!((exact_m(poisson, INNER_M) * 1e6 - inner).abs() < 5e-5);
        assert!((exact_m(poisson, OUTER_M) * 1e6 - outer).abs() < 5e-5);
    }
}

/// Linear tets lock as ν → ½: the error grows and its order sinks below 2. The bounds are what was measured.
#[test]
fn thick_sphere() {
    for (poisson, finest, limit, least_order) in
        [(0.3, 0.0055, 0.0003, 1.94), (0.45, 0.0148, 0.0024, 1.81), (0.49, 0.0547, 0.0248, 1.40)]
    {
        let found = study(Law::StableNeoHookean, poisson, [8, 16, 32]);
        assert!(found.errors[2].abs() < finest, "ν = {poisson}: {:?}", found.errors);
        assert!(found.limit_error.abs() < limit, "ν = {poisson}: {}", found.limit_error);
        assert!(order(found.errors) > least_order, "ν = {poisson}: {}", order(found.errors));
    }
}

/// Small strain sees one linear law.
#[test]
fn thick_sphere_is_the_same_for_every_law() {
    let reference = measured_m(Law::StableNeoHookean, 0.45, 8).0[0];
    for law in Law::ALL {
        let name = law.name();
        let apart = measured_m(law, 0.45, 8).0[0] / reference - 1.0;
        println!("Lamé, {name}: u(a) differs from stable neo-Hookean's by {apart:+.1e}");
        assert!(apart.abs() < 1e-3);
    }
}

#[test]
#[ignore = "long: 165 888 tets; its numbers are in docs/verification.md"]
fn thick_sphere_finer() {
    for poisson in [0.3, 0.45, 0.49] {
        let found = study(Law::StableNeoHookean, poisson, [12, 24, 48]);
        assert!(order(found.errors) > 1.5, "ν = {poisson}: {}", order(found.errors));
    }
}
