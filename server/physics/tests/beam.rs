//! A cantilever, 100 × 10 × 10 mm, E = 100 kPa: Timoshenko's deflection at a small load; and the elastica on a slender one.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::common;
use common::{
    block, equilibrium, extrapolated, held, material, mean_displacement_m, nodes_where, spec, triangles_where,
};
use glam::DVec3;
use palpate_physics::{LoadSpec, Model, material::Law};

const YOUNG_PA: f64 = 100e3;
const LENGTH_M: f64 = 0.1;
const FORCE_N: f64 = 1e-3;
/// The load is this part of 1 mN, so that the answer is the linear one (large deflection takes off 0.2 % at 1 mN, as its square).
const SMALL: f64 = 1e-2;

/// `w = PL³/(3EI) + PL/(kGA)`, with Cowper's `k = 10(1 + ν)/(12 + 11ν)` for a square.
fn timoshenko_m(poisson: f64) -> f64 {
    let (area, inertia) = (1e-4, 0.01_f64.powi(4) / 12.0);
    let shear = YOUNG_PA / (2.0 * (1.0 + poisson));
    let k = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    FORCE_N * LENGTH_M.powi(3) / (3.0 * YOUNG_PA * inertia) + FORCE_N * LENGTH_M / (k * shear * area)
}

/// What holds the root.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Root {
    /// All of its face, all axes: with ν > 0 it cannot contract, which the beam theories leave out.
    Clamped,
    /// Its face along the beam only: it contracts freely. Shear is given as the opposite traction, and points on the axis of the
    /// face hold what is left of rigid motion.
    FreeToContract,
}

/// Mean deflection (m) of the end face against the root's, scaled to 1 mN, with `n` cells through the thickness and `10n` along.
fn deflection_m(poisson: f64, root: Root, n: usize) -> (f64, usize) {
    let mesh = block(DVec3::new(LENGTH_M, 0.01, 0.01), [10 * n, n, n]);
    let traction = |x: f64, sign: f64| LoadSpec::Traction {
        triangles: triangles_where(&mesh, |p| p.x == x),
        traction_pa: DVec3::Z * sign * FORCE_N / 1e-4,
    };
    let middle = |v: f64| (v - 0.005).abs() < 1e-9;
    let (prescribed, loads) = match root {
        Root::Clamped => (vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)], vec![traction(LENGTH_M, 1.0)]),
        Root::FreeToContract => (
            vec![
                held(&mesh, "root", [true, false, false], |p| p.x == 0.0),
                held(&mesh, "centre", [false, false, true], |p| p.x == 0.0 && middle(p.y) && middle(p.z)),
                held(&mesh, "plane", [false, true, false], |p| p.x == 0.0 && middle(p.y)),
            ],
            vec![traction(LENGTH_M, 1.0), traction(0.0, -1.0)],
        ),
    };
    let law = material(Law::StVenantKirchhoff, YOUNG_PA, poisson);
    let model = Model::build(spec(mesh, law, prescribed, loads)).unwrap();
    let found = equilibrium(&model, SMALL, &[]);
    let mean =
        |x: f64| mean_displacement_m(&model, &found.x, &nodes_where(model.body().tets().unwrap(), |p| p.x == x)).z;
    ((mean(LENGTH_M) - mean(0.0)) / SMALL, model.body().as_tet().unwrap().rest_tets().len())
}

/// Prints the study; relative errors of the finer mesh and of Richardson's limit.
fn cantilever(poisson: f64, root: Root, cells: [usize; 2]) -> [f64; 2] {
    let exact = timoshenko_m(poisson);
    let found = cells.map(|n| deflection_m(poisson, root, n));
    let errors = found.map(|(deflection, _)| deflection / exact - 1.0);
    for ((n, (deflection, tets)), error) in cells.iter().zip(found).zip(errors) {
        println!(
            "cantilever ν = {poisson}, {root:?}: {n} cells high, {tets} tets: w = {:.4} mm ({:+.2} %)",
            deflection * 1e3,
            100.0 * error
        );
    }
    let limit = extrapolated(found[0].0, found[1].0);
    let error = limit / exact - 1.0;
    println!(
        "cantilever ν = {poisson}, {root:?}: Richardson w = {:.4} mm ({:+.3} %), order of the error {:.2}",
        limit * 1e3,
        100.0 * error,
        (errors[0] / errors[1]).log2()
    );
    [errors[1], error]
}

#[test]
fn timoshenko_gives_the_published_numbers() {
    assert!((timoshenko_m(0.0) * 1e3 - 4.0240).abs() < 5e-5);
    assert!((timoshenko_m(0.3) * 1e3 - 4.0306).abs() < 5e-5);
}

/// Linear tets are stiff in bending: 4 % at 8 cells through the thickness. The bounds are what was measured.
#[test]
fn small_load() {
    let [finer, limit] = cantilever(0.0, Root::Clamped, [4, 8]);
    assert!(finer.abs() < 0.0439 && limit.abs() < 0.0067, "{finer} {limit}");
    let [finer, limit] = cantilever(0.3, Root::FreeToContract, [4, 8]);
    assert!(finer.abs() < 0.0403 && limit.abs() < 0.0063, "{finer} {limit}");
}

#[test]
#[ignore = "long: 245 760 tets; its numbers are in docs/verification.md"]
fn small_load_finer() {
    let [finer, limit] = cantilever(0.0, Root::Clamped, [8, 16]);
    assert!(finer.abs() < 0.0114 && limit.abs() < 0.0005, "{finer} {limit}");
    let [finer, limit] = cantilever(0.3, Root::FreeToContract, [8, 16]);
    assert!(finer.abs() < 0.0114 && limit.abs() < 0.0007, "{finer} {limit}");
}

/// Tip deflection over length of the elastica, by shooting: `θ'' = −α cos θ`, `θ(0) = 0`, `θ'(1) = 0`, `w = ∫ sin θ`, with
/// `α = PL²/EI` and arc length from the clamp over L. `stretch` and `shear` are `EI/(EA L²)` and `EI/(kGA L²)` of Reissner's
/// beam, zero for the elastica: `x' = (1 + ε) cos θ − γ sin θ`, `w' = (1 + ε) sin θ + γ cos θ`, `ε = α·stretch·sin θ`,
/// `γ = α·shear·cos θ`, and the moment's slope is `θ'' = −α x'`.
fn beam_deflection(alpha: f64, stretch: f64, shear: f64) -> f64 {
    let rates = |theta: f64, curvature: f64| {
        let (epsilon, gamma) = (alpha * stretch * theta.sin(), alpha * shear * theta.cos());
        let along = (1.0 + epsilon) * theta.cos() - gamma * theta.sin();
        let across = (1.0 + epsilon) * theta.sin() + gamma * theta.cos();
        [curvature, -alpha * along, across]
    };
    let shoot = |start: f64| {
        let steps = 2000;
        let h = 1.0 / f64::from(steps);
        let mut y = [0.0, start, 0.0];
        for _ in 0..steps {
            let at = |k: &[f64; 3], h: f64| rates(y[0] + h * k[0], y[1] + h * k[1]);
            let k1 = rates(y[0], y[1]);
            let k2 = at(&k1, 0.5 * h);
            let k3 = at(&k2, 0.5 * h);
            let k4 = at(&k3, h);
            y = std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
        y
    };
    let (mut low, mut high) = (0.0, alpha);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if shoot(middle)[1] > 0.0 { high = middle } else { low = middle }
    }
    shoot(0.5 * (low + high))[2]
}

const ELASTICA: [(f64, f64); 4] = [(1.0, 0.301721), (2.0, 0.493457), (5.0, 0.713792), (10.0, 0.810609)];

#[test]
fn shooting_gives_the_published_elastica() {
    for (alpha, expected) in ELASTICA {
        assert!((beam_deflection(alpha, 0.0, 0.0) - expected).abs() < 5e-7, "{alpha}");
    }
}

/// Slenderness of the beam: its length over its thickness.
const SLENDER: f64 = 50.0;

/// Tip deflection over length at each load, on a beam `n` cells high, `50n` long and one wide (ν = 0: no stress across).
fn slender(n: usize) -> Vec<f64> {
    let thick = LENGTH_M / SLENDER;
    let mesh = block(DVec3::new(LENGTH_M, thick, thick), [50 * n, 1, n]);
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let end = triangles_where(&mesh, |p| p.x == LENGTH_M);
    // At factor α: P = α EI/L², over the end face.
    let unit = YOUNG_PA * thick.powi(4) / 12.0 / LENGTH_M.powi(2) / thick.powi(2);
    let loads = vec![LoadSpec::Traction { triangles: end, traction_pa: DVec3::Z * unit }];
    let law = material(Law::FixedCorotated, YOUNG_PA, 0.0);
    let model = Model::build(spec(mesh, law, prescribed, loads)).unwrap();
    let end = nodes_where(model.body().tets().unwrap(), |p| p.x == LENGTH_M);
    let deflection = |&(alpha, _): &(f64, f64)| {
        let found = equilibrium(&model, alpha, &[]);
        println!(
            "elastica {n} cells high, α = {alpha}: {} Newton iterations, {} factorisations, {} load steps",
            found.iterations, found.factorisations, found.load_steps
        );
        assert!(found.stable && found.inverted_tets == 0);
        mean_displacement_m(&model, &found.x, &end).z / LENGTH_M
    };
    ELASTICA.iter().map(deflection).collect()
}

/// Relative errors of Richardson's limit against the beam with stretch and shear, at each load.
fn elastica_errors(cells: [usize; 2]) -> Vec<f64> {
    let found = cells.map(slender);
    let (stretch, shear) = (1.0 / (12.0 * SLENDER.powi(2)), 2.0 * 1.2 / (12.0 * SLENDER.powi(2)));
    let error = |(load, (alpha, expected)): (usize, (f64, f64))| {
        let (coarse, fine) = (found[0][load], found[1][load]);
        let limit = extrapolated(coarse, fine);
        let reissner = beam_deflection(alpha, stretch, shear);
        println!(
            "elastica α = {alpha}: w/L = {coarse:.6}, {fine:.6} ({:+.2} %), Richardson {limit:.6}; elastica {expected} ({:+.3} %), with \
             stretch and shear {reissner:.6} ({:+.3} %)",
            100.0 * (fine / reissner - 1.0),
            100.0 * (limit / expected - 1.0),
            100.0 * (limit / reissner - 1.0)
        );
        limit / reissner - 1.0
    };
    ELASTICA.into_iter().enumerate().map(error).collect()
}

/// On so coarse a mesh small loads are far from the limit; the bounds are what was measured.
#[test]
fn elastica() {
    let errors = elastica_errors([2, 4]);
    for (error, bound) in errors.iter().zip([0.0474, 0.0250, 0.0039, 0.0012]) {
        assert!(error.abs() < bound, "{errors:?}");
    }
}

#[test]
#[ignore = "long: 19 200 tets, four loads; its numbers are in docs/verification.md"]
fn elastica_finer() {
    let errors = elastica_errors([4, 8]);
    for (error, bound) in errors.iter().zip([0.0043, 0.0019, 0.0002, 0.0001]) {
        assert!(error.abs() < bound, "{errors:?}");
    }
}
