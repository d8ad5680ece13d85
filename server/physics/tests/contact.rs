//! Contact against known answers: Hertz's force on a layer, its convergence, and the balance of forces.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{ModelSpec, Region, contact::Coupling, material::Law};
use rig::{Rig, body, bricks, even, graded, hold, material, nodes_where, solid_mut, sphere};
use std::f64::consts::PI;

const YOUNG_PA: f64 = 10e3;
const HALF_WIDTH_M: f64 = 0.06;
const HEIGHT_M: f64 = 0.06;

/// A quarter of a bonded block 120 × 120 × 60 mm under a sphere on its axis, fine near the contact. Its densities give all
/// cells the same stable step: the equilibrium does not know them.
fn quarter_block(h_m: f64, nu: f64, radius_m: f64) -> ModelSpec {
    let side = graded(h_m, 0.006, 1.35, HALF_WIDTH_M);
    let heights: Vec<f64> = graded(h_m, 0.006, 1.35, HEIGHT_M).iter().rev().map(|z| -z).collect();
    let mesh = bricks(&side, &side, &heights);
    let free = |p: DVec3| p.z > heights[0];
    let prescribed = vec![
        hold("bottom", nodes_where(&mesh, |p| !free(p)), [true; 3]),
        hold("x symmetry", nodes_where(&mesh, |p| free(p) && p.x == 0.0), [true, false, false]),
        hold("y symmetry", nodes_where(&mesh, |p| free(p) && p.y == 0.0), [false, true, false]),
    ];
    // Regions by half octaves of the smallest extent of the cell.
    let class = |tet: usize| {
        let corners = mesh.corners_m(tet);
        let (lo, hi) = corners.iter().fold((corners[0], corners[0]), |b, c| (b.0.min(*c), b.1.max(*c)));
        (2.0 * ((hi - lo).min_element() / h_m).log2()).round() as u16
    };
    let tet_region: Vec<u16> = (0..mesh.tets().len()).map(class).collect();
    let classes = tet_region.iter().max().unwrap() + 1;
    let mut spec = body(mesh, material(Law::StableNeoHookean, YOUNG_PA, nu));
    let base = solid_mut(&mut spec).regions[0].clone();
    let of_class = |class: u16| Region { density_kg_per_m3: 1000.0 * 0.5_f64.powi(i32::from(class)), ..base.clone() };
    solid_mut(&mut spec).regions = (0..classes).map(of_class).collect();
    solid_mut(&mut spec).tet_region = tet_region;
    spec.prescribed = prescribed;
    spec.tools = vec![sphere(radius_m, DVec3::Z * radius_m, Coupling::Rigid)];
    spec.settings.mass_damping_per_s = 60.0;
    spec
}

/// Force (N) of a rigid sphere pressed in, at rest.
fn pressed_force_n(h_m: f64, nu: f64, radius_m: f64, depth_m: f64) -> f64 {
    let mut rig = Rig::new(quarter_block(h_m, nu, radius_m));
    let mut forces = [0.0; 2];
    for tick in 1..=140 {
        let s = (f64::from(tick) / 90.0).min(1.0);
        rig.tick_at(DVec3::Z * (radius_m - depth_m * s * s * (3.0 - 2.0 * s)));
        forces = [forces[1], 4.0 * rig.state.mechanical.tools[0].contact_force_n.z];
    }
    assert!((forces[1] / forces[0] - 1.0).abs() < 1e-3, "not at rest: {forces:?}");
    forces[1]
}

/// Force (N) of a rigid sphere on a linear half space (Sneddon 1965): `δ = a artanh(a/R)`,
/// `F = E* (½(a² + R²) ln((R + a)/(R − a)) − aR)`. Hertz's `4/3 E* √R δ^{3/2}` is its limit for a ≪ R.
fn sneddon_n(e_star_pa: f64, radius_m: f64, depth_m: f64) -> f64 {
    let (mut lo, mut hi) = (0.0, radius_m * (1.0 - 1e-12));
    for _ in 0..100 {
        let a: f64 = 0.5 * (lo + hi);
        if a * (a / radius_m).atanh() < depth_m { lo = a } else { hi = a }
    }
    e_star_pa * ((lo * lo + radius_m * radius_m) * (lo / radius_m).atanh() - lo * radius_m)
}

/// Factor of a bonded layer of thickness H (Dimitriadis et al. 2002), `χ = √(Rδ)/H`.
fn bonded_layer_factor(nu: f64, radius_m: f64, depth_m: f64) -> f64 {
    let chi = (radius_m * depth_m).sqrt() / HEIGHT_M;
    let a0 = -(1.2876 - 1.4678 * nu + 1.3442 * nu * nu) / (1.0 - nu);
    let b0 = (0.6387 - 1.0277 * nu + 1.5164 * nu * nu) / (1.0 - nu);
    let q = a0 / PI;
    1.0 - 2.0 * q * chi + 4.0 * q * q * chi.powi(2)
        - 8.0 * (q.powi(3) + 4.0 * PI * b0 / 15.0 / PI.powi(2)) * chi.powi(3)
        + 16.0 * (q.powi(4) + 3.0 * b0 * a0 / 5.0 / PI.powi(2)) * chi.powi(4)
}

fn errors(nu: f64, radius_m: f64, depth_m: f64, sizes_m: &[f64]) -> Vec<f64> {
    let e_star = YOUNG_PA / (1.0 - nu * nu);
    let hertz = 4.0 / 3.0 * e_star * radius_m.sqrt() * depth_m.powf(1.5);
    let reference = sneddon_n(e_star, radius_m, depth_m) * bonded_layer_factor(nu, radius_m, depth_m);
    println!(
        "nu {nu}, R {radius_m}, depth {depth_m}: Hertz {:.3} mN, Sneddon on a layer {:.3} mN",
        1e3 * hertz,
        1e3 * reference
    );
    sizes_m
        .iter()
        .map(|&h| {
            let force = pressed_force_n(h, nu, radius_m, depth_m);
            println!(
                "  h {h}: {:.3} mN, {:+.2} % of the layer, {:+.2} % of Hertz",
                1e3 * force,
                100.0 * (force / reference - 1.0),
                100.0 * (force / hertz - 1.0)
            );
            force / reference - 1.0
        })
        .collect()
}

/// Linear tets lock, which stiffens, and the foundation gives way: both errors fall with h.
#[test]
fn hertz_force_converges_at_nu_045() {
    let e = errors(0.45, 0.01, 0.002, &[2e-3, 1.4e-3, 1e-3]);
    // Measured: +5.9, +2.2, −0.4 %.
    assert!(e[0] < 0.07 && e[1].abs() < 0.03 && e[2].abs() < 0.01, "{e:?}");
}

#[test]
fn hertz_force_converges_at_nu_03() {
    let e = errors(0.3, 0.01, 0.002, &[2e-3, 1.4e-3]);
    // Measured: +3.1, +1.3 %.
    assert!(e[0] < 0.04 && e[1].abs() < 0.02, "{e:?}");
}

/// δ/R = 0.002: no large strain, no difference between sphere and paraboloid.
#[test]
fn hertz_force_at_small_strain() {
    let e = errors(0.3, 0.1, 0.0002, &[2e-3, 1.4e-3]);
    // Measured: +3.3, +1.2 %.
    assert!(e[0] < 0.04 && e[1].abs() < 0.02, "{e:?}");
}

#[test]
fn tool_and_body_exchange_equal_momentum() {
    // A free block meets a rigid sphere: the momentum it gains is the impulse of the reported force.
    let side = even(-0.02, 0.02, 4);
    let mesh = bricks(&side, &side, &even(-0.02, 0.0, 2));
    let mut spec = body(mesh, material(Law::StableNeoHookean, YOUNG_PA, 0.45));
    spec.tools = vec![sphere(0.008, DVec3::new(0.003, 0.002, 0.0081), Coupling::Rigid)];
    spec.tools[0].friction_coefficient = 0.5;
    let mut rig = Rig::new(spec);
    rig.state.mechanical.v.fill(DVec3::new(0.1, 0.0, 0.3));
    let momentum =
        |rig: &Rig| rig.state.mechanical.v.iter().zip(rig.model.body().mass_kg()).map(|(v, m)| *v * *m).sum::<DVec3>();
    let before = momentum(&rig);
    let (mut impulse, mut last, mut touched) = (DVec3::ZERO, DVec3::ZERO, false);
    let centre = rig.state.mechanical.tools[0].centre_m;
    for _ in 0..200 {
        rig.tick_at(centre);
        last = rig.state.mechanical.tools[0].contact_force_n;
        impulse += last * 1e-3;
        touched |= rig.state.mechanical.tools[0].contacts > 0;
    }
    assert!(touched && last == DVec3::ZERO, "it must touch and leave");
    let gained = momentum(&rig) - before;
    assert!((gained + impulse).length() < 1e-12 * before.length(), "{gained} {impulse}");
}
