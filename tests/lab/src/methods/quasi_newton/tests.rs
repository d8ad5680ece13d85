#![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
use super::*;
use crate::methods::testing::{equilibrium, farthest_m, free, momenta, problem, settle, tumbling};
use crate::methods::tet_body;

fn settings(pace: Option<&Pace>) -> Settings {
    Settings {
        precision: Precision::Double,
        substeps: Substeps::Fixed(1),
        mass_damping_per_s: pace.map_or(0.0, |pace| pace.damping_per_s),
        ..Settings::default()
    }
}

fn body(name: &str, resolution: u32, pace: Option<&Pace>, iterations: usize) -> Body {
    let problem = problem(name);
    let subject = Subject::new(&problem, resolution, problem.material().unwrap(), settings(pace)).unwrap();
    Body::new(subject, iterations).unwrap()
}

/// `|x − y|²_M/(2dt²) + Σ V Ψ + Φ − f·x` (J) at the point last evaluated.
fn objective_j(body: &Body) -> f64 {
    let (model, x) = (&body.subject.model, &body.next.x);
    let dt_s = model.settings().tick_period_s;
    let inertia: f64 =
        model.body().mass_kg().iter().zip(x).zip(&body.inertial).map(|((m, x), y)| m * x.distance_squared(*y)).sum();
    let element = |(tet, nodes): (usize, &[u32; 4])| {
        tet_body(model).rest_tets()[tet].energy_j(tet_body(model).material_of(tet), &nodes.map(|n| x[n as usize]))
    };
    let elastic: f64 = tet_body(model).mesh().tets().iter().enumerate().map(element).sum();
    let contact: f64 = body.tools.iter().map(|tool| tool.contact_energy_j).sum();
    let load: f64 = body.load_n.iter().zip(x).map(|(f, x)| f.dot(*x) * body.factor).sum();
    inertia / (2.0 * dt_s * dt_s) + elastic + contact - load
}

#[test]
fn the_gradient_is_the_slope_of_the_objective() {
    for name in ["block-sphere-large-nu0.45", "block-patch-small-nu0.45"] {
        let mut body = body(name, 4, None, 1);
        for tick in 1..=20 {
            body.tick(f64::from(tick) / 20.0);
        }
        let touched = (0..body.x.len()).max_by(|&a, &b| body.x[a].z.total_cmp(&body.x[b].z)).unwrap();
        let (scale, step) = (body.gradient.iter().map(|g| g.length()).fold(1e-3, f64::max), 1e-7);
        let x = body.x.clone();
        for node in [touched, 30, 40] {
            for axis in 0..3 {
                let mut at = |sign: f64| {
                    body.next.x.copy_from_slice(&x);
                    body.next.x[node][axis] += sign * step;
                    body.evaluate();
                    (objective_j(&body), body.next.gradient[node][axis])
                };
                let ((up, g_up), (down, g_down)) = (at(1.0), at(-1.0));
                let held = tet_body(&body.subject.model).inverse_mass_per_kg()[node][axis] == 0.0;
                let slope = if held { 0.0 } else { (up - down) / (2.0 * step) };
                let gradient = 0.5 * (g_up + g_down);
                assert!((slope - gradient).abs() < 1e-5 * scale, "{name} {node} {axis}: {slope} {gradient}");
            }
        }
    }
}

/// `A p` is how the gradient changes along p at rest.
#[test]
fn the_factorised_matrix_is_the_tangent_at_rest() {
    for name in ["lame-nu0.45", "block-patch-small-nu0.45", "elastica"] {
        let mut body = body(name, 4, None, 1);
        let rest = body.x.clone();
        let free = |w: &DVec3| DVec3::select(w.cmpeq(DVec3::ZERO), DVec3::ZERO, DVec3::ONE);
        let wave = rest.iter().map(|x| DVec3::new((90.0 * x.y).sin(), (50.0 * x.z).cos(), (70.0 * x.x).sin()));
        let p: Vec<DVec3> =
            wave.zip(tet_body(&body.subject.model).inverse_mass_per_kg()).map(|(p, w)| p * free(w)).collect();
        let step = 1e-8;
        let mut gradient = |sign: f64| {
            for ((next, x), p) in body.next.x.iter_mut().zip(&rest).zip(&p) {
                *next = *x + *p * (sign * step);
            }
            body.evaluate();
            body.next.gradient.clone()
        };
        let (up, down) = (gradient(1.0), gradient(-1.0));
        let mut found: Vec<DVec3> = up.iter().zip(&down).map(|(u, d)| (*u - *d) / (2.0 * step)).collect();
        body.system.solve(&mut found);
        assert!(farthest_m(&found, &p) < 1e-6, "{name}: {}", farthest_m(&found, &p));
    }
}

#[test]
fn it_comes_to_rest_in_equilibrium() {
    for (name, resolution) in [("ventricle-sphere-small-nu0.45", 188), ("block-patch-small-nu0.45-stvk", 4)] {
        let pace = Pace::of(&problem(name)).unwrap();
        for iterations in [1, 5] {
            let mut body = body(name, resolution, Some(&pace), iterations);
            settle(&mut body, &pace);
            settle(&mut body, &Pace { ramp_ticks: 1, ..pace });
            let (x, answer) = equilibrium(&body.subject);
            let moved = farthest_m(&x, body.subject.model.rest_positions_m());
            let (off, error) = (farthest_m(&body.x, &x) / moved, body.answer() / answer - 1.0);
            assert!(off < 1e-6 && error.abs() < 1e-6, "{name} {iterations}: {off:.1e} {error:.1e}");
        }
    }
}

/// Five iterations leave nothing of the step's equation, in large motion too.
#[test]
fn a_few_iterations_find_the_step() {
    let left = |iterations: usize| {
        let mut body = body("block-sphere-large-nu0.45", 8, None, iterations);
        let mut worst = 0.0_f64;
        for tick in 1..=60 {
            body.tick(f64::from(tick) / 60.0);
            worst = worst.max(dot(&body.gradient, &body.gradient).sqrt() / body.answer().max(1e-2));
        }
        worst
    };
    let (one, five, ten) = (left(1), left(5), left(10));
    println!(
        "gradient left over the tool's force: {one:.1e} after 1 iteration, {five:.1e} after 5, {ten:.1e} after 10"
    );
    assert!(five < 0.1 * one && ten < 1e-6, "{one:.1e} {five:.1e} {ten:.1e}");
}

/// `1ᵀA = 1ᵀM/dt²`, so no direction moves the centre of mass of a free body, however few iterations are done.
#[test]
fn momentum_is_conserved_in_free_flight() {
    let subject = free(&problem("block-patch-small-nu0.45"), settings(None));
    let mut body = Body::new(subject, 1).unwrap();
    body.v = tumbling(&body.x);
    let [before, _] = momenta(&body.subject.model, &body.x, &body.v);
    for _ in 0..200 {
        body.tick(0.0);
    }
    let [after, _] = momenta(&body.subject.model, &body.x, &body.v);
    assert!((after - before).length() < 1e-9 * before.length(), "{before} {after}");
}
