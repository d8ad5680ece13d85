//! The reference against answers that are known without it.
#![allow(clippy::unwrap_used)] // a test that cannot build its subject has failed
use glam::DVec3;
use palpate_lab::{
    bodies::material,
    reference::{
        bodies::{Body, block, sphere_octant, ventricle},
        dynamics::{Clock, Dynamics},
        grid::{HexGrid, Side, graded},
        newton::{Action, Equilibrium, solve, solve_through},
        solid::{Solid, surface_points},
        sphere::Sphere,
    },
};
use palpate_physics::material::Law;

fn solve_quietly(solid: &Solid, body: &Body, action: &Action) -> Equilibrium {
    solve(solid, body, action, &mut |_| {}).unwrap()
}

/// Dead pressure (Pa) on the touched side.
fn pressure(solid: &Solid, body: &Body, pressure_pa: f64) -> Action {
    let mut forces = vec![DVec3::ZERO; solid.grid.positions_m.len()];
    for face in solid.grid.faces(body.touched) {
        for point in surface_points(&solid.grid, &face, 1) {
            for (&node, weight) in face.iter().zip(point.weights) {
                forces[node as usize] -= point.normal * (pressure_pa * point.area_m2 * weight);
            }
        }
    }
    Action::Forces(forces)
}

#[test]
fn forces_are_the_energys_slope_and_stiffness_the_forces() {
    let skew = |p: DVec3| p + DVec3::new(0.1 * p.y * p.z, 0.2 * p.x, 0.1 * p.x * p.x);
    let grid = HexGrid::new([graded(0.0, 1.0, 1, 1.0), graded(0.0, 0.8, 1, 1.0), graded(0.0, 1.1, 1, 1.0)], skew);
    let solid = Solid::new(grid, material(Law::StableNeoHookean, 1.0, 0.4).unwrap()).unwrap();
    let wavy = |p: &DVec3| *p + DVec3::new((3.0 * p.y).sin(), (2.0 * p.x * p.z).cos(), p.y * p.x) * 0.1;
    let x: Vec<DVec3> = solid.grid.positions_m.iter().map(wavy).collect();
    let (forces, stiffness) = (solid.forces_n(&x), solid.stiffness(&x));
    let scale = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
    let step = 1e-6;
    for (local, axis) in [(0, 0), (13, 1), (26, 2), (5, 0)] {
        let node = solid.grid.elements[0][local] as usize;
        let moved = |sign: f64| {
            let mut x = x.clone();
            x[node][axis] += sign * step;
            x
        };
        let slope = (solid.energy_j(&moved(1.0)) - solid.energy_j(&moved(-1.0))) / (2.0 * step);
        assert!((slope + forces[node][axis]).abs() < 1e-8 * scale, "{slope} {}", forces[node]);
        let (up, down) = (solid.forces_n(&moved(1.0)), solid.forces_n(&moved(-1.0)));
        for other in 0..27 {
            let n = solid.grid.elements[0][other] as usize;
            for r in 0..3 {
                let difference = (down[n][r] - up[n][r]) / (2.0 * step);
                let entry = stiffness[0][(3 * other + r) * 81 + 3 * local + axis];
                assert!((difference - entry).abs() < 1e-7 * scale, "{difference} {entry}");
            }
        }
    }
}

/// Both of a sphere that presses and of its shaft, which keeps deep presses from ending around the sphere.
#[test]
fn the_spheres_forces_are_its_energys_slope_and_its_stiffness_theirs() {
    let body = block(2.0, 1.0, 0.5, 2);
    let sphere = Sphere::new(&body.grid, body.grid.faces(body.touched), body.normal, 0.6, 7.0);
    let wavy = |p: &DVec3| *p + DVec3::new((3.0 * p.y).sin(), (2.0 * p.x * p.z).cos(), p.y * p.x) * 0.1;
    let x: Vec<DVec3> = body.grid.positions_m.iter().map(wavy).collect();
    let groups: Vec<Vec<u32>> = sphere.groups().collect();
    for (below_m, is_on_shaft) in [(-0.3, false), (0.45, true)] {
        let centre_m = body.touch_m - body.normal * below_m + DVec3::new(0.2, 0.1, 0.0);
        assert_eq!(sphere.on_shaft_n(&x, centre_m) > 1e-3, is_on_shaft);
        let forces_n = |x: &[DVec3]| {
            let mut forces_n = vec![DVec3::ZERO; x.len()];
            sphere.add_forces_n(x, centre_m, &mut forces_n);
            forces_n
        };
        let (forces, stiffness, step) = (forces_n(&x), sphere.stiffness(&x, centre_m), 1e-6);
        let scale = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
        assert!(forces[groups[0][4] as usize].length() > 1e-3);
        for (local, axis) in [(0, 0), (2, 1), (8, 2), (4, 0)] {
            let node = groups[0][local] as usize;
            let moved = |sign: f64| {
                let mut x = x.clone();
                x[node][axis] += sign * step;
                x
            };
            let (up, down) = (moved(1.0), moved(-1.0));
            let slope = (sphere.energy_j(&up, centre_m) - sphere.energy_j(&down, centre_m)) / (2.0 * step);
            assert!((slope + forces[node][axis]).abs() < 1e-7 * scale, "{slope} {}", forces[node]);
            let (up, down) = (forces_n(&up), forces_n(&down));
            for other in 0..9 {
                let n = groups[0][other] as usize;
                for r in 0..3 {
                    let entries = groups.iter().zip(&stiffness).filter_map(|(group, block)| {
                        let row = group.iter().position(|&member| member as usize == n)?;
                        let column = group.iter().position(|&member| member as usize == node)?;
                        Some(block[(3 * row + r) * 27 + 3 * column + axis])
                    });
                    let entry: f64 = entries.sum();
                    let difference = (down[n][r] - up[n][r]) / (2.0 * step);
                    assert!((difference - entry).abs() < 1e-5 * scale, "{difference} {entry}");
                }
            }
        }
    }
}

/// On the way to a deep press the reference has the forces that presses of less depth have.
#[test]
fn a_deep_press_comes_through_shallower_ones() {
    let (young, nu, radius, depth) = (10e3, 0.45, 0.01, 0.008);
    let body = block(0.08, 0.04, 0.009, 2);
    let solid = Solid::new(body.grid.clone(), material(Law::StableNeoHookean, young, nu).unwrap()).unwrap();
    let sphere = Sphere::new(&solid.grid, solid.grid.faces(body.touched), body.normal, radius, 1e8);
    let action = |depth_m: f64| Action::Sphere { sphere: sphere.clone(), depth_m };
    let mut forces_n = Vec::new();
    let visit = &mut |_, found: Equilibrium| forces_n.push(found.sphere_n);
    solve_through(&solid, &body, &action(depth), &[0.3, 1.0], &mut |_| {}, visit).unwrap();
    for (part, force_n) in [0.3, 1.0].into_iter().zip(forces_n) {
        let alone_n = solve_quietly(&solid, &body, &action(part * depth)).sphere_n;
        assert!((force_n / alone_n - 1.0).abs() < 1e-6, "{part}: {force_n} {alone_n}");
    }
}

#[test]
fn homogeneous_strain_is_in_equilibrium_on_curved_and_collapsed_grids() {
    let body = ventricle(((0.01, 0.02), (0.007, 0.017), 0.005), 0.0, 0.001, 2);
    let solid = Solid::new(body.grid.clone(), material(Law::StVenantKirchhoff, 1e4, 0.45).unwrap()).unwrap();
    let strain = |p: &DVec3| *p + DVec3::new(0.1 * p.x + 0.05 * p.z, -0.08 * p.y, 0.1 * p.y + 0.02 * p.z);
    let x: Vec<DVec3> = solid.grid.positions_m.iter().map(strain).collect();
    let forces = solid.forces_n(&x);
    let largest = forces.iter().map(|f| f.length()).fold(0.0, f64::max);
    let mut on_side = vec![false; x.len()];
    for parameter in 0..3 {
        for upper in [false, true] {
            let side = Side { parameter, upper };
            // The pole, a side of the lattice, is inside the body.
            if (parameter, upper) != (1, false) {
                for node in solid.grid.faces(side).into_iter().flatten() {
                    on_side[node as usize] = true;
                }
            }
        }
    }
    assert!(on_side.iter().any(|on| !on));
    for (force, _) in forces.iter().zip(&on_side).filter(|(_, on)| !**on) {
        assert!(force.length() < 1e-12 * largest, "{force} of {largest}");
    }
}

#[test]
fn the_ventricles_volume_is_met() {
    // ∫ π r² dz of an ellipsoid of revolution from the pole to the cut.
    let below =
        |(a, c): (f64, f64), z: f64| std::f64::consts::PI * a * a * (z + 2.0 * c / 3.0 - z.powi(3) / (3.0 * c * c));
    let exact = 0.5 * (below((0.01, 0.02), 0.005) - below((0.007, 0.017), 0.005));
    let error = |n| {
        let body = ventricle(((0.01, 0.02), (0.007, 0.017), 0.005), 0.0, 0.002, n);
        Solid::new(body.grid, material(Law::StableNeoHookean, 1e4, 0.3).unwrap()).unwrap().volume_m3() / exact - 1.0
    };
    // Of third order at least: curved sides are met by parabolas.
    let (coarse, fine) = (error(2), error(4));
    println!("{coarse:.1e} {fine:.1e}");
    assert!(fine.abs() < 1e-3 && (coarse / fine).log2() > 3.0, "{coarse:e} {fine:e}");
}

/// Lamé's thick sphere, u(a) in µm for a pressure of 1 Pa at E = 10 kPa.
#[test]
fn lame_also_near_incompressibility() {
    for (nu, exact) in [(0.3_f64, 4.0), (0.45, 4.214_285_714), (0.49, 4.271_428_571)] {
        let error = |n| {
            let body = sphere_octant(0.05, 0.1, n);
            let solid = Solid::new(body.grid.clone(), material(Law::StableNeoHookean, 1e4, nu).unwrap()).unwrap();
            let found = solve_quietly(&solid, &body, &pressure(&solid, &body, 1.0));
            let [(node, _), ..] = solid.grid.on_side(body.touched, [0.0, 0.0]);
            (found.x[node as usize].x - 0.05) * 1e6 / exact - 1.0
        };
        let (coarse, fine) = (error(3), error(6));
        println!("nu {nu}: {:+.3} {:+.4} %, order {:.2}", 100.0 * coarse, 100.0 * fine, (coarse / fine).log2());
        assert!(fine.abs() < 1e-3 && (coarse / fine).log2() > 3.0, "ν = {nu}: {coarse:e} {fine:e}");
    }
}

/// Hertz at small depth, with Dimitriadis' series for a layer bonded below (here 5 % on the half space).
#[test]
fn hertz_at_small_depth() {
    let (young, nu, radius, depth, height) = (1e4, 0.45_f64, 40e-3_f64, 0.1e-3_f64, 40e-3_f64);
    let body = block(160e-3, height, (radius * depth).sqrt(), 5);
    let solid = Solid::new(body.grid.clone(), material(Law::StableNeoHookean, young, nu).unwrap()).unwrap();
    let contact = (radius * depth).sqrt();
    let modulus = young / (1.0 - nu * nu);
    let sphere = Sphere::new(&solid.grid, solid.grid.faces(body.touched), body.normal, radius, 4e3 * modulus / contact);
    let found = solve_quietly(&solid, &body, &Action::Sphere { sphere, depth_m: depth });
    let chi = contact / height;
    let pi = std::f64::consts::PI;
    let alpha = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
    let beta = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
    let series = 1.0 - 2.0 * alpha / pi * chi + 4.0 * alpha * alpha / (pi * pi) * chi * chi
        - 8.0 / pi.powi(3) * (alpha.powi(3) + 4.0 * pi * pi / 15.0 * beta) * chi.powi(3);
    let exact = 4.0 / 3.0 * modulus * radius.sqrt() * depth.powf(1.5) * series;
    println!("{:.5e} N against {exact:.5e}, {:+.2} %", found.sphere_n, 100.0 * (found.sphere_n / exact - 1.0));
    assert!((found.sphere_n / exact - 1.0).abs() < 0.01, "{} {exact}", found.sphere_n);
}

/// A bar 100 mm long that only stretches (E = 100 kPa, ν = 0, held at one end), pulled to its first shape and let go.
fn bar() -> (Solid, Body) {
    let grid = HexGrid::new([graded(0.0, 0.1, 6, 1.0), graded(0.0, 0.01, 1, 1.0), graded(0.0, 0.01, 1, 1.0)], |p| p);
    let root = Side { parameter: 0, upper: false };
    let sides = [1, 2].map(|parameter| Side { parameter, upper: false });
    let body = Body {
        grid: grid.clone(),
        held: vec![(root, [true; 3]), (sides[0], [false, true, false]), (sides[1], [false, false, true])],
        touched: Side { parameter: 0, upper: true },
        multiplicity: 1.0,
        touch_m: DVec3::X * 0.1,
        normal: DVec3::X,
    };
    (Solid::new(grid, material(Law::FixedCorotated, 100e3, 0.0).unwrap()).unwrap(), body)
}

/// Displacement (m) of the bar's end after some steps; and the largest change of energy on the way, relative.
fn swing(solid: &Solid, body: &Body, dt_s: f64, steps: usize) -> (Vec<f64>, f64) {
    let mut dynamics = Dynamics::new(solid, body, 1000.0).unwrap();
    for x in &mut dynamics.x {
        x.x += 1e-6 * (std::f64::consts::PI * x.x / 0.2).sin();
    }
    let end = (0..dynamics.x.len()).find(|&n| dynamics.x[n].x > 0.1).unwrap();
    let (start, none) = (dynamics.energy_j(), vec![DVec3::ZERO; dynamics.x.len()]);
    let clock = Clock { dt_s, damping_per_s: 0.0 };
    let (mut moved, mut worst) = (vec![], 0.0_f64);
    for _ in 0..steps {
        dynamics.step(&none, &clock);
        moved.push(dynamics.x[end].x - 0.1);
        worst = worst.max((dynamics.energy_j() / start - 1.0).abs());
    }
    (moved, worst)
}

#[test]
fn a_bar_swings_at_its_frequency_keeps_its_energy_and_time_is_of_second_order() {
    let (solid, body) = bar();
    let stable_s = Dynamics::new(&solid, &body, 1000.0).unwrap().stable_step_s();
    // f = √(E/ρ)/4L = 25 Hz: after 40 ms all is as it was, after 10 and 30 ms the end passes its rest.
    let steps = (0.04 / stable_s).ceil() as usize;
    let (moved, energy) = swing(&solid, &body, 0.04 / steps as f64, steps);
    let crossing = |from: usize| {
        let i = (from..steps - 1).find(|&i| moved[i] * moved[i + 1] <= 0.0).unwrap();
        i as f64 + 1.0 + moved[i] / (moved[i] - moved[i + 1])
    };
    let first = crossing(0);
    let second = crossing(first as usize + 1);
    let hz = steps as f64 / 0.04 / (2.0 * (second - first));
    println!("{hz:.4} Hz, energy within {energy:.1e}, {steps} steps");
    assert!((hz / 25.0 - 1.0).abs() < 1e-3 && energy < 1e-2, "{hz} Hz, {energy}");
    let end = |factor: usize| *swing(&solid, &body, 0.011 / (steps * factor) as f64, steps * factor).0.last().unwrap();
    let [a, b, c] = [1, 2, 4].map(end);
    let order = ((a - b) / (b - c)).log2();
    println!("order in time {order:.3}");
    assert!((order - 2.0).abs() < 0.05, "{order}");
}
