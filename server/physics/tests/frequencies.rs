//! Natural frequencies of the cantilever 100 × 10 × 10 mm, E = 100 kPa, 1000 kg/m³: by modes of the stiffness, and by letting it
//! swing in time.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::common;
use common::{block, extrapolated, held, material, mean_displacement_m, nodes_where, spec};
use glam::DVec3;
use palpate_physics::{
    Model, Scratch, State, Substeps, TickInput, elements::natural_modes::Mode, material::Law, statics::natural_modes,
    step,
};
use std::f64::consts::TAU;

const YOUNG_PA: f64 = 100e3;
const DENSITY: f64 = 1000.0;
const LENGTH_M: f64 = 0.1;
const THICK_M: f64 = 0.01;

/// Bending frequencies (Hz) of the clamped-free Timoshenko beam. With `y = (w, ψ, M, Q)`:
/// `w' = ψ + Q/kGA`, `ψ' = M/EI`, `M' = −Q − ρIω²ψ`, `Q' = −ρAω²w`; a frequency is where a combination of the two solutions
/// from the clamp, `M₀` and `Q₀` free, leaves the end without moment and shear. With `1/kGA = 0` and `ρI = 0`: Euler-Bernoulli.
fn bending_hz(poisson: f64, timoshenko: bool, guesses: [f64; 3]) -> [f64; 3] {
    let (area, inertia) = (THICK_M * THICK_M, THICK_M.powi(4) / 12.0);
    let k = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson);
    let shear_flexibility = 2.0 * (1.0 + poisson) / (k * YOUNG_PA * area);
    let (flexibility, rotary) = if timoshenko { (shear_flexibility, DENSITY * inertia) } else { (0.0, 0.0) };
    let end = |hz: f64, start: [f64; 4]| {
        let square = (TAU * hz).powi(2);
        let rates = |y: [f64; 4]| {
            let [w, psi, m, q] = y;
            [psi + q * flexibility, m / (YOUNG_PA * inertia), -q - rotary * square * psi, -DENSITY * area * square * w]
        };
        let steps = 1000;
        let h = LENGTH_M / f64::from(steps);
        let along = |y: [f64; 4], k: [f64; 4], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
        (0..steps).fold(start, |y, _| {
            let k1 = rates(y);
            let k2 = rates(along(y, k1, 0.5 * h));
            let k3 = rates(along(y, k2, 0.5 * h));
            let k4 = rates(along(y, k3, h));
            std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
        })
    };
    let determinant = |hz: f64| {
        let (a, b) = (end(hz, [0.0, 0.0, 1.0, 0.0]), end(hz, [0.0, 0.0, 0.0, 1.0]));
        a[2] * b[3] - a[3] * b[2]
    };
    guesses.map(|guess| {
        let (mut low, mut high) = (0.8 * guess, 1.1 * guess);
        let sign = determinant(low).signum();
        assert!(sign != determinant(high).signum());
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if determinant(middle).signum() == sign { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    })
}

const EULER_BERNOULLI_HZ: [f64; 3] = [1.6154, 10.1235, 28.346];

#[test]
fn the_beam_equations_give_the_published_numbers() {
    let found = bending_hz(0.0, false, EULER_BERNOULLI_HZ);
    for (found, expected) in found.iter().zip(EULER_BERNOULLI_HZ) {
        assert!((found / expected - 1.0).abs() < 5e-5, "{found} {expected}");
    }
    println!("Timoshenko, ν = 0: {:?} Hz", bending_hz(0.0, true, EULER_BERNOULLI_HZ));
}

fn cantilever(n: usize) -> Model {
    let mesh = block(DVec3::new(LENGTH_M, THICK_M, THICK_M), [10 * n, n, n]);
    let prescribed = vec![held(&mesh, "clamp", [true; 3], |p| p.x == 0.0)];
    let mut spec = spec(mesh, material(Law::StableNeoHookean, YOUNG_PA, 0.0), prescribed, vec![]);
    spec.settings.substeps = Substeps::Measured;
    Model::build(spec).unwrap()
}

/// Bending modes in the direction of z, and the axial one, among the lowest.
fn sorted(modes: &[Mode]) -> (Vec<f64>, f64) {
    let share = |mode: &Mode, axis: DVec3| {
        let along: f64 = mode.shape_per_sqrt_kg.iter().map(|s| s.dot(axis).powi(2)).sum();
        along / mode.shape_per_sqrt_kg.iter().map(|s| s.length_squared()).sum::<f64>()
    };
    // Bending about both axes comes in pairs of one frequency, turned at random in their plane.
    let across = modes.iter().filter(|m| share(m, DVec3::X) < 0.3 && !twists(m)).map(|m| m.frequency_hz).collect();
    let axial = modes.iter().find(|m| share(m, DVec3::X) > 0.9).map_or(f64::NAN, |m| m.frequency_hz);
    (across, axial)
}

/// Torsion moves the middle of a section nowhere.
fn twists(mode: &Mode) -> bool {
    let sum: DVec3 = mode.shape_per_sqrt_kg.iter().copied().sum();
    let squares: f64 = mode.shape_per_sqrt_kg.iter().map(|s| s.length_squared()).sum();
    sum.length_squared() < 1e-3 * squares * mode.shape_per_sqrt_kg.len() as f64
}

#[test]
fn modes_of_a_cantilever() {
    let exact = bending_hz(0.0, true, EULER_BERNOULLI_HZ);
    let found = [4, 8].map(|n| sorted(&natural_modes(&cantilever(n), 9).unwrap()));
    for (pair, (exact, bound)) in exact.iter().zip([0.0010, 0.0013, 0.0018]).enumerate() {
        let [coarse, fine] = [0, 1].map(|k: usize| found[k].0[2 * pair]);
        let limit = extrapolated(coarse, fine);
        let error = limit / exact - 1.0;
        println!(
            "bending mode {}: {coarse:.4}, {fine:.4} Hz ({:+.2} %), Richardson {limit:.4}; Timoshenko {exact:.4} Hz ({:+.3} %)",
            pair + 1,
            100.0 * (fine / exact - 1.0),
            100.0 * error
        );
        assert!(error.abs() < bound, "{error}");
    }
    let exact = (YOUNG_PA / DENSITY).sqrt() / (4.0 * LENGTH_M);
    for (_, axial) in found {
        println!("axial mode: {axial:.5} Hz; {exact} Hz ({:+.3} %)", 100.0 * (axial / exact - 1.0));
        assert!((axial / exact - 1.0).abs() < 1e-4);
    }
}

/// Frequency (Hz) of a swing started from rest in a mode's shape, tip `tip_m` out: from the times its tip's mean displacement
/// along `axis` crosses zero, over `periods`.
fn swing_hz(model: &Model, mode: &Mode, axis: DVec3, tip_m: f64, periods: f64) -> f64 {
    let end = nodes_where(model.body().tets().unwrap(), |p| p.x == LENGTH_M);
    let tip = end.iter().map(|&n| mode.shape_per_sqrt_kg[n as usize].dot(axis)).sum::<f64>() / end.len() as f64;
    let mut state = State::at_rest(model);
    for (x, shape) in state.mechanical.x.iter_mut().zip(&mode.shape_per_sqrt_kg) {
        *x += *shape * (tip_m / tip);
    }
    state.mechanical.force_is_current = false;
    let mut scratch = Scratch::new(model);
    let input =
        TickInput { tools: &[], load_factors: &[], prescribed_displacements_m: &[DVec3::ZERO], point_forces: &[] };
    let period_s = model.settings().tick_period_s;
    let ticks = (periods / mode.frequency_hz / period_s).ceil() as usize;
    let (mut before, mut crossings) = (tip_m, Vec::new());
    for tick in 1..=ticks {
        assert_eq!(step(model, &mut state, &mut scratch, &input).quarantined, None);
        let now = mean_displacement_m(model, &state.mechanical.x, &end).dot(axis);
        if before * now < 0.0 {
            crossings.push((tick as f64 - now / (now - before)) * period_s);
        }
        before = now;
    }
    0.5 * (crossings.len() - 1) as f64 / (crossings[crossings.len() - 1] - crossings[0])
}

#[test]
fn the_beam_swings_at_the_frequency_of_its_modes() {
    let model = cantilever(4);
    let modes = natural_modes(&model, 9).unwrap();
    let (bending_hz, axial_hz) = sorted(&modes);
    let of = |hz: f64| modes.iter().find(|m| m.frequency_hz == hz).unwrap();
    let bending = of(bending_hz[0]);
    let tip = nodes_where(model.body().tets().unwrap(), |p| p.x == LENGTH_M);
    let direction: DVec3 = tip.iter().map(|&n| bending.shape_per_sqrt_kg[n as usize]).sum::<DVec3>().normalize();
    for (name, mode, axis, periods) in [("bending", bending, direction, 3.1), ("axial", of(axial_hz), DVec3::X, 20.1)] {
        let found = swing_hz(&model, mode, axis, 1e-5, periods);
        // Leapfrog raises a frequency by (ω dt)²/24.
        let dt = model.settings().tick_period_s / f64::from(model.substeps());
        let raised = 1.0 + (TAU * mode.frequency_hz * dt).powi(2) / 24.0;
        let error = found / (mode.frequency_hz * raised) - 1.0;
        println!(
            "{name} by leapfrog: {found:.6} Hz; mode {:.6} Hz ({error:+.1e} after leapfrog's shift)",
            mode.frequency_hz
        );
        assert!(error.abs() < 1e-6, "{name} {error}");
    }
}
