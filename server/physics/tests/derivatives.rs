//! One harness for every law: energy → stress → stiffness by central differences; viscous stress; known values.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use crate::support;
use glam::{DMat3, DVec3};
use palpate_physics::{
    elements::linear_tet::RestTet,
    linalg::tensor::contract,
    material::{Convention, Lame, Law, Material, Viscosity, viscous},
};
use support::Random;

fn material(law: Law, nu: f64) -> Material {
    let lame = Lame::from_young_poisson(1.0, nu).unwrap();
    Material::new(law, lame, Viscosity::default(), Convention::Consistent)
}

fn norm(a: &DMat3) -> f64 {
    contract(a, a).sqrt()
}

/// Turned by any angle; near rest, stretched, crushed and inverted (σ₂ + σ₃ > 0.2, where the corotated law is smooth).
fn gradients(random: &mut Random) -> Vec<DMat3> {
    let ranges = [
        ([0.95; 3], [1.05; 3]),
        ([1.5, 0.8, 0.5], [3.0, 1.2, 0.8]),
        ([0.3, 0.2, 0.1], [0.6, 0.3, 0.2]),
        ([1.0, 0.7, -0.5], [1.5, 1.0, -0.1]),
        ([1.0, 0.8, 0.0], [1.2, 1.0, 1e-3]),
    ];
    ranges.iter().flat_map(|&(low, high)| (0..20).map(|_| random.gradient(low, high)).collect::<Vec<_>>()).collect()
}

/// `Ψ(F + hδ) − Ψ(F − hδ) = 2h P:δ + O(h³)`, and the same for `P` and its differential.
#[test]
fn stress_and_stiffness_are_derivatives_of_the_energy() {
    let mut random = Random(1);
    let h = 1e-5;
    for law in Law::ALL {
        let (mut worst_stress, mut worst_stiffness) = (0.0_f64, 0.0_f64);
        for nu in [-0.2, 0.0, 0.3, 0.45, 0.49] {
            let m = material(law, nu);
            for f in gradients(&mut random) {
                let df = random.matrix();
                let (plus, minus) = (f + df * h, f - df * h);
                let scale = norm(&f).powi(3).max(1.0) * m.lame.p_wave_modulus_pa();
                let measured = (m.energy_density(&plus) - m.energy_density(&minus)) / (2.0 * h);
                let stated = contract(&m.piola(&f), &df);
                assert!((measured - stated).abs() < 1e-8 * scale, "{law:?} ν {nu}: {measured} {stated} at {f}");
                worst_stress = worst_stress.max((measured - stated).abs() / scale);
                let measured = (m.piola(&plus) - m.piola(&minus)) * (0.5 / h);
                let difference = norm(&(measured - m.piola_differential(&f, &df)));
                assert!(difference < 1e-7 * scale, "{law:?} ν {nu}: off by {difference:e} at {f}");
                worst_stiffness = worst_stiffness.max(difference / scale);
            }
        }
        println!("{law:?}: energy to stress {worst_stress:.1e}, stress to stiffness {worst_stiffness:.1e}");
    }
}

/// `f_i = −∂U/∂x_i` and `K_ij = ∂f_i/∂x_j` of a tet, in all laws.
#[test]
fn forces_and_stiffness_of_a_tet_are_derivatives_of_its_energy() {
    let mut random = Random(2);
    let rest = RestTet::new(&DMat3::from_cols(
        DVec3::new(1.0, 0.1, 0.0),
        DVec3::new(0.2, 0.9, -0.1),
        DVec3::new(0.1, 0.3, 1.2),
    ));
    let corners = [DVec3::ZERO, DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.2, 0.9, -0.1), DVec3::new(0.1, 0.3, 1.2)];
    let h = 1e-5;
    for law in Law::ALL {
        let m = material(law, 0.4);
        let (mut worst_force, mut worst_stiffness) = (0.0_f64, 0.0_f64);
        for f in gradients(&mut random) {
            let x = corners.map(|c| f * c + DVec3::new(3.0, -1.0, 2.0));
            let scale = norm(&f).powi(3).max(1.0) * m.lame.p_wave_modulus_pa();
            let forces = rest.forces_n(&m, &x, &[DVec3::ZERO; 4]);
            assert!(forces.iter().sum::<DVec3>().length() < 1e-14 * scale);
            for j in 0..4 {
                for axis in DVec3::AXES {
                    let moved = |by: f64| {
                        let mut x = x;
                        x[j] += axis * by;
                        x
                    };
                    let energy = |by: f64| rest.energy_j(&m, &moved(by));
                    let measured = -(energy(h) - energy(-h)) / (2.0 * h);
                    assert!((measured - forces[j].dot(axis)).abs() < 1e-8 * scale, "{law:?}");
                    worst_force = worst_force.max((measured - forces[j].dot(axis)).abs() / scale);
                    let (plus, minus) = (moved(h), moved(-h));
                    let (plus, minus) =
                        (rest.forces_n(&m, &plus, &[DVec3::ZERO; 4]), rest.forces_n(&m, &minus, &[DVec3::ZERO; 4]));
                    for i in 0..4 {
                        let measured = (plus[i] - minus[i]) * (0.5 / h);
                        let stated = rest.stiffness_block(&m, &rest.gradient_of(&x), i, j) * axis;
                        assert!((measured - stated).length() < 1e-7 * scale, "{law:?} {measured} {stated}");
                        worst_stiffness = worst_stiffness.max((measured - stated).length() / scale);
                    }
                }
            }
        }
        println!("{law:?}: energy to force {worst_force:.1e}, force to stiffness {worst_stiffness:.1e}");
    }
}

/// At rest `δP = λ tr(δF) I + µ(δF + δFᵀ)`, and energy and stress vanish.
#[test]
fn small_strain_of_every_law_sees_lambda_and_mu() {
    let mut random = Random(3);
    for law in Law::ALL {
        let m = material(law, 0.37);
        assert_eq!(m.energy_density(&DMat3::IDENTITY), 0.0);
        assert!(norm(&m.piola(&DMat3::IDENTITY)) < 1e-15);
        for _ in 0..20 {
            let df = random.matrix();
            let trace = df.x_axis.x + df.y_axis.y + df.z_axis.z;
            let linear =
                DMat3::from_diagonal(DVec3::splat(m.lame.lambda_pa * trace)) + (df + df.transpose()) * m.lame.mu_pa;
            assert!(norm(&(m.piola_differential(&DMat3::IDENTITY, &df) - linear)) < 1e-13, "{law:?}");
        }
    }
}

/// Energy and stress do not see a rotation: `Ψ(QF) = Ψ(F)`, `P(QF) = Q P(F)`; nor, being isotropic, one of the rest state.
#[test]
fn every_law_is_objective_and_isotropic() {
    let mut random = Random(4);
    for law in Law::ALL {
        let m = material(law, 0.45);
        for f in gradients(&mut random) {
            let (q, r) = (random.rotation(), random.rotation());
            let scale = norm(&f).powi(4).max(1.0) * m.lame.p_wave_modulus_pa();
            assert!((m.energy_density(&(q * f * r)) - m.energy_density(&f)).abs() < 1e-13 * scale, "{law:?}");
            assert!(norm(&(m.piola(&(q * f * r)) - q * m.piola(&f) * r)) < 1e-13 * scale, "{law:?}");
        }
    }
}

/// `P/E = s(s² − 1)/2` at stretch s without lateral strain at ν = 0.
#[test]
fn stvk_uniaxial_stress_is_the_known_one() {
    for (s, expected) in [(0.8, -0.144), (1.2, 0.264), (1.5, 0.9375)] {
        let f = DMat3::from_diagonal(DVec3::new(s, 1.0, 1.0));
        assert!((material(Law::StVenantKirchhoff, 0.0).piola(&f).x_axis.x - expected).abs() < 1e-14);
    }
}

/// 2006 prints half the elastic force of its energy; viscous force as the formulas have it; 2005 is consistent.
#[test]
fn conventions_scale_elasticity_and_nothing_else() {
    let lame = Lame::new(3.0, 2.0).unwrap();
    let viscosity = Viscosity::new(5.0, 7.0).unwrap();
    for (convention, factor) in
        [(Convention::Consistent, 1.0), (Convention::Paper2005, 1.0), (Convention::Paper2006, 0.5)]
    {
        let m = Material::new(Law::StVenantKirchhoff, lame, viscosity, convention);
        assert_eq!((m.lame.lambda_pa, m.lame.mu_pa), (3.0 * factor, 2.0 * factor));
        assert_eq!(m.viscosity, viscosity);
    }
}

/// `P_v : Ḟ = S_v : Ė ≥ 0`; zero for any rigid motion, however fast; and the tet's power is that of its corner forces.
#[test]
fn viscous_stress_dissipates_and_is_objective() {
    let mut random = Random(6);
    let viscosity = Viscosity::new(0.4, 0.9).unwrap();
    let rest = RestTet::new(&DMat3::from_cols(DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.1, 0.2, 0.8)));
    let m = Material { viscosity, ..material(Law::StableNeoHookean, 0.3) };
    let elastic = material(Law::StableNeoHookean, 0.3);
    for f in gradients(&mut random) {
        let f_dot = random.matrix() * 10.0;
        let power = contract(&viscous::piola(viscosity, &f, &f_dot), &f_dot);
        let e_dot = viscous::strain_rate(&f, &f_dot);
        let expected = contract(&viscous::second_piola(viscosity, &e_dot), &e_dot);
        assert!(power >= -1e-12 && (power - expected).abs() < 1e-11 * expected.max(1.0), "{power} {expected}");

        let omega = random.vector() * 1e3;
        let spin = DMat3::from_cols(omega.cross(f.x_axis), omega.cross(f.y_axis), omega.cross(f.z_axis));
        let scale = norm(&f).powi(3).max(1.0) * omega.length();
        assert!(norm(&viscous::piola(viscosity, &f, &spin)) < 1e-13 * scale);

        let corners = [DVec3::ZERO, DVec3::X, DVec3::new(0.3, 1.0, 0.0), DVec3::new(0.1, 0.2, 0.8)];
        let (x, v) = (corners.map(|c| f * c), corners.map(|_| random.vector()));
        let (with, without) = (rest.forces_n(&m, &x, &v), rest.forces_n(&elastic, &x, &v));
        let of_forces: f64 = (0..4).map(|i| -(with[i] - without[i]).dot(v[i])).sum();
        let stated = rest.viscous_power_w(&m, &x, &v);
        assert!((of_forces - stated).abs() < 1e-11 * stated.max(1.0), "{of_forces} {stated}");
    }
}

/// `Material::stiffening` bounds the P-wave modulus of every state whose principal stretches stay below `s`, and is reached.
#[test]
fn stiffening_bounds_the_modulus_along_every_direction() {
    for law in Law::ALL {
        for nu in [0.0, 0.3, 0.45, 0.49] {
            let lame = Lame::from_young_poisson(10e3, nu).unwrap();
            let material = Material::new(law, lame, Viscosity::default(), Convention::Consistent);
            for s in [1.0, 1.2, 1.5, 2.0] {
                let bound = material.stiffening(s) * lame.p_wave_modulus_pa();
                let mut worst = 0.0_f64;
                // Principal stretches on a grid up to s; directions on another.
                let grid = [0.6, 1.0, 0.5 * (1.0 + s), s];
                for (a, b, c) in triples(&grid) {
                    let f = DMat3::from_diagonal(DVec3::new(a, b, c));
                    for (n, m) in directions().iter().flat_map(|n| directions().into_iter().map(move |m| (*n, m))) {
                        let df = DMat3::from_cols(n * m.x, n * m.y, n * m.z);
                        worst = worst.max(n.dot(material.piola_differential(&f, &df) * m));
                    }
                }
                assert!(worst <= bound * (1.0 + 1e-9), "{law:?} nu {nu} s {s}: {worst} over {bound}");
                assert!(worst >= 0.95 * bound, "{law:?} nu {nu} s {s}: {worst} far below {bound}");
            }
        }
    }
}

fn triples(grid: &[f64]) -> Vec<(f64, f64, f64)> {
    let pairs = |a: f64| grid.iter().flat_map(move |&b| grid.iter().map(move |&c| (a, b, c)));
    grid.iter().flat_map(|&a| pairs(a)).collect()
}

fn directions() -> Vec<DVec3> {
    let axis = [-1.0, 0.0, 1.0];
    triples(&axis)
        .into_iter()
        .map(|(x, y, z)| DVec3::new(x, y, z))
        .filter(|d| *d != DVec3::ZERO)
        .map(DVec3::normalize)
        .collect()
}
