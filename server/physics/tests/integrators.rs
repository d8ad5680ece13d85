//! Every integrator: order in time, momentum, drag, equilibrium, and what does not depend on the scheme.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, Integrator, ModelSpec, PointForce, Substeps, contact::Coupling,
    elements::rest_stiffness::nodal_stiffness_n_per_m, material::Law, snapshot, statics,
};
use rig::{Drive, Rig, at, body, bricks, even, hold, material, mesh_of, nodes_where, solid_mut, sphere};

const ALL: [Integrator; 4] =
    [Integrator::Leapfrog, Integrator::SeedVerlet, Integrator::SeedSemiImplicit, Integrator::BackwardEuler];

fn block(h_m: f64, poisson: f64) -> ModelSpec {
    let side = even(-2.0 * h_m, 2.0 * h_m, 4);
    let mesh = bricks(&side, &side, &even(-2.0 * h_m, 0.0, 2));
    body(mesh, material(Law::StableNeoHookean, 10e3, poisson))
}

fn held_block(integrator: Integrator) -> ModelSpec {
    let mut spec = block(0.01, 0.4);
    let bottom = nodes_where(mesh_of(&spec), |p| p.z < -0.0199);
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec.settings.integrator = integrator;
    spec
}

fn distance(p: &[DVec3], q: &[DVec3]) -> f64 {
    p.iter().zip(q).map(|(p, q)| p.distance_squared(*q)).sum::<f64>().sqrt()
}

/// Positions after 30 ms of large strain under sideways gravity.
fn swung(integrator: Integrator, substeps: u32) -> Vec<DVec3> {
    let mut spec = held_block(integrator);
    spec.settings.substeps = Substeps::Fixed(substeps);
    spec.settings.solver_tolerance = 1e-10;
    spec.gravity_m_per_s2 = DVec3::new(20.0, 0.0, -30.0);
    let mut rig = Rig::new(spec);
    for _ in 0..30 {
        let drive = rig.still();
        assert!(rig.tick(&drive).quarantined.is_none());
    }
    rig.state.mechanical.x
}

#[test]
fn orders_in_time() {
    for (integrator, wanted, coarsest) in [
        (Integrator::Leapfrog, 2.0, 8),
        (Integrator::SeedVerlet, 2.0, 8),
        (Integrator::SeedSemiImplicit, 1.0, 64),
        (Integrator::BackwardEuler, 1.0, 16),
    ] {
        let [a, b, c] = [1, 2, 4].map(|times| swung(integrator, coarsest * times));
        let order = (distance(&a, &b) / distance(&b, &c)).log2();
        println!("{integrator:?}: order {order:.3}");
        assert!((order - wanted).abs() < 0.12, "{integrator:?}: {order}");
    }
}

/// The seeds' Verlet is leapfrog's positions, bit for bit but for rounding.
#[test]
fn seed_verlet_goes_where_leapfrog_goes() {
    let (a, b) = (swung(Integrator::Leapfrog, 16), swung(Integrator::SeedVerlet, 16));
    assert!(distance(&a, &b) < 1e-12, "{:e}", distance(&a, &b));
}

/// Share of momentum (along x) left after one tick of one step of a free body moving as a whole.
fn momentum_left(integrator: Integrator, h_m: f64, substeps: u32) -> f64 {
    let mut spec = block(h_m, 0.45);
    spec.settings.integrator = integrator;
    spec.settings.substeps = Substeps::Fixed(substeps);
    let mut rig = Rig::new(spec);
    rig.state.mechanical.v.fill(DVec3::X);
    let momentum =
        |rig: &Rig| rig.state.mechanical.v.iter().zip(rig.model.body().mass_kg()).map(|(v, m)| v.x * m).sum::<f64>();
    let before = momentum(&rig);
    let drive = rig.still();
    rig.tick(&drive);
    momentum(&rig) / before
}

#[test]
fn only_the_semi_implicit_seed_drags_rigid_motion() {
    for integrator in [Integrator::Leapfrog, Integrator::SeedVerlet, Integrator::BackwardEuler] {
        let left = momentum_left(integrator, 0.005, 8);
        assert!((left - 1.0).abs() < 1e-12, "{integrator:?}: {left}");
    }
    let left = momentum_left(Integrator::SeedSemiImplicit, 0.005, 1);
    println!("E = 10 kPa, nu = 0.45, h = 5 mm, 1 ms: {:.1} % of momentum lost", 100.0 * (1.0 - left));
    assert!((0.70..0.95).contains(&(1.0 - left)), "{left}");
}

/// λ_max(D⁻¹K), by power iteration on `D⁻¹K`, which is similar to a symmetric matrix.
fn block_jacobi_spectral_radius(spec: ModelSpec) -> f64 {
    let model = palpate_physics::Model::build(spec).unwrap();
    let tets = model.body().as_tet().unwrap();
    let points = tets.points();
    let inverse: Vec<_> = nodal_stiffness_n_per_m(points, tets.mass_kg().len()).iter().map(|d| d.inverse()).collect();
    let mut a: Vec<DVec3> = (0..inverse.len())
        .map(|i| DVec3::new((i as f64).sin(), (2.3 * i as f64).cos(), (0.7 * i as f64).sin()))
        .collect();
    let mut lambda = 0.0;
    for _ in 0..2000 {
        let mut ka = vec![DVec3::ZERO; a.len()];
        for point in points.iter() {
            let dp = point.material.piola_differential(&glam::DMat3::IDENTITY, &point.gradient_of(&a));
            point.add_forces_n(&-dp, &mut ka);
        }
        let next: Vec<DVec3> = inverse.iter().zip(&ka).map(|(inverse, ka)| *inverse * *ka).collect();
        let length = |b: &[DVec3]| b.iter().map(|b| b.length_squared()).sum::<f64>().sqrt();
        lambda = length(&next) / length(&a);
        a = next.iter().map(|b| *b / length(&next)).collect();
    }
    lambda
}

/// Beyond 2 the nodewise Jacobian does not make every step stable.
#[test]
fn the_nodal_jacobian_is_less_than_stability_needs() {
    for poisson in [0.0, 0.3, 0.45] {
        let lambda = block_jacobi_spectral_radius(block(0.005, poisson));
        println!("nu = {poisson}: lambda_max(D^-1 K) = {lambda:.3}");
        assert!((2.0..3.5).contains(&lambda), "{lambda}");
    }
}

#[test]
fn rest_is_rest_and_equilibrium_does_not_depend_on_the_scheme() {
    let reference = {
        let model = Rig::new(heavy(Integrator::Leapfrog)).model;
        let settings = statics::StaticSettings { relative_residual: 1e-12, ..statics::StaticSettings::default() };
        statics::solve_static(
            &model,
            &statics::Goal { prescribed_displacements_m: &[DVec3::ZERO], ..statics::Goal::default() },
            &settings,
            &mut |_| std::ops::ControlFlow::Continue(()),
        )
        .unwrap()
        .x
    };
    for integrator in ALL {
        let mut still = Rig::new(held_block(integrator));
        let rest = still.state.mechanical.x.clone();
        for _ in 0..20 {
            let drive = still.still();
            still.tick(&drive);
        }
        assert!(distance(&still.state.mechanical.x, &rest) < 1e-15, "{integrator:?}");
        let mut rig = Rig::new(heavy(integrator));
        for _ in 0..600 {
            let drive = rig.still();
            rig.tick(&drive);
        }
        let error = distance(&rig.state.mechanical.x, &reference);
        println!("{integrator:?}: {error:.1e} m from the static solution");
        assert!(error < 1e-9 && distance(&reference, &rest) > 1e-3, "{integrator:?}: {error:e}");
    }
}

fn heavy(integrator: Integrator) -> ModelSpec {
    let mut spec = held_block(integrator);
    spec.gravity_m_per_s2 = DVec3::new(5.0, 0.0, -9.81);
    spec.settings.mass_damping_per_s = 80.0;
    spec
}

fn pressed(integrator: Integrator) -> Rig {
    let mut spec = held_block(integrator);
    let coupling = Coupling::Spring { stiffness_n_per_m: 200.0, damping_n_s_per_m: 2.0, mass_kg: 0.02 };
    spec.tools = vec![sphere(0.008, DVec3::new(0.0, 0.0, 0.0085), coupling)];
    spec.tools[0].friction_coefficient = 0.3;
    let mut rig = Rig::new(spec);
    for _ in 0..60 {
        rig.tick_at(DVec3::Z * 0.005);
    }
    assert!(rig.state.mechanical.tools[0].contacts > 0, "{integrator:?}");
    rig
}

#[test]
fn a_restored_run_continues_with_the_same_bits() {
    for integrator in ALL {
        let mut first = pressed(integrator);
        let bytes = snapshot::save(&first.model, &first.state);
        let mut second = Rig::new(first.spec.clone());
        second.state = snapshot::restore(&second.model, &bytes).unwrap();
        for tick in 0..40 {
            let device = DVec3::new(1e-4 * f64::from(tick), 0.0, 0.005);
            first.tick_at(device);
            second.tick_at(device);
        }
        assert_eq!(first.state, second.state, "{integrator:?}");
    }
}

#[test]
fn an_enormous_force_is_quarantined() {
    for integrator in ALL {
        let mut rig = pressed(integrator);
        let good = rig.state.clone();
        let mut drive: Drive = rig.still();
        drive.point_forces.push(PointForce { node: 60, force_n: DVec3::Z * 1e300 });
        assert!(rig.tick(&drive).quarantined.is_some(), "{integrator:?}");
        assert_eq!(rig.state.mechanical.x, good.mechanical.x);
        rig.state.reset(&rig.model);
        drive = Drive { tools: vec![at(DVec3::Z * 0.0085)], ..rig.still() };
        assert!(rig.tick(&drive).quarantined.is_none());
    }
}

/// What the ledger says while the block swings: second order for leapfrog, first for the seeds.
#[test]
fn the_ledger_balances_to_the_scheme_s_order() {
    for (integrator, wanted) in [
        (Integrator::Leapfrog, 1.9),
        (Integrator::SeedVerlet, 0.9),
        (Integrator::SeedSemiImplicit, 0.9),
        (Integrator::BackwardEuler, 1.9),
    ] {
        let imbalance = |substeps: u32| {
            let mut spec = held_block(integrator);
            spec.settings.substeps = Substeps::Fixed(substeps);
            spec.gravity_m_per_s2 = DVec3::new(20.0, 0.0, -30.0);
            let mut rig = Rig::new(spec);
            let mut worst = 0.0_f64;
            for _ in 0..30 {
                let drive = rig.still();
                rig.tick(&drive);
                worst = worst.max(Energies::of(&rig.model, &rig.state).balance_j().abs());
            }
            worst
        };
        let [a, b] = [32, 64].map(imbalance);
        println!("{integrator:?}: {a:.2e} {b:.2e} J, order {:.2}", (a / b).log2());
        assert!((a / b).log2() > wanted, "{integrator:?}: {a:e} {b:e}");
    }
}

/// A free block thrown into vibration: what backward Euler does to momentum is what its solver leaves.
#[test]
fn backward_euler_keeps_momentum_to_its_solver_s_tolerance() {
    for law in [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated] {
        let mut spec = block(0.01, 0.4);
        solid_mut(&mut spec).regions[0].material = material(law, 10e3, 0.4);
        spec.settings.integrator = Integrator::BackwardEuler;
        spec.settings.solver_tolerance = 1e-9;
        let mut rig = Rig::new(spec);
        for (v, x) in rig.state.mechanical.v.iter_mut().zip(&rig.state.mechanical.x) {
            *v = DVec3::X + DVec3::new((90.0 * x.y).sin(), (70.0 * x.z).cos(), (80.0 * x.x).sin()) * 0.2;
        }
        let momentum = |rig: &Rig| {
            rig.state.mechanical.v.iter().zip(rig.model.body().mass_kg()).map(|(v, m)| *v * *m).sum::<DVec3>()
        };
        let before = momentum(&rig);
        for _ in 0..50 {
            let drive = rig.still();
            rig.tick(&drive);
        }
        let change = (momentum(&rig) - before).length() / before.length();
        println!("{law:?}: momentum changed by {change:.1e} in 50 steps");
        assert!(change < 1e-8, "{change:e}");
    }
}

/// Steps of 1, 10 and 100 times leapfrog's limit: the energy of a body that nothing drives only falls.
#[test]
fn backward_euler_is_bounded_at_a_hundred_times_the_explicit_limit() {
    for law in [Law::StVenantKirchhoff, Law::StableNeoHookean, Law::FixedCorotated] {
        for times in [1.0, 10.0, 100.0] {
            let mut spec = held_block(Integrator::BackwardEuler);
            solid_mut(&mut spec).regions[0].material = material(law, 10e3, 0.4);
            let omega = Rig::new(spec.clone()).model.body().max_natural_frequency_rad_per_s();
            spec.settings.tick_period_s = times * 2.0 / omega;
            let mut rig = Rig::new(spec);
            for (v, x) in rig.state.mechanical.v.iter_mut().zip(rig.model.rest_positions_m()) {
                let alternating = if ((x.x + x.y) * 100.0).round() as i64 % 2 == 0 { 1.0 } else { -1.0 };
                if x.z > -0.0199 {
                    *v = DVec3::new(alternating, -alternating, 0.5) * 0.2;
                }
            }
            let mut before = Energies::of(&rig.model, &rig.state);
            let start = before.held_j();
            for tick in 0..200 {
                let drive = rig.still();
                assert!(rig.tick(&drive).quarantined.is_none(), "{law:?} {times}");
                let now = Energies::of(&rig.model, &rig.state);
                let grown = (now.held_j() - before.held_j()) / start;
                assert!(grown < 1e-9, "{law:?} {times} x, tick {tick}: energy grew by {grown:e}");
                before = now;
            }
            assert!(before.held_j() < start, "{law:?} {times}");
        }
    }
}

/// A block pressed by a rigid sphere that rests: the implicit step and leapfrog come to the same force and shape.
#[test]
fn backward_euler_presses_as_leapfrog_does() {
    let settle = |integrator: Integrator| {
        let mut spec = held_block(integrator);
        spec.settings.mass_damping_per_s = 100.0;
        spec.tools = vec![sphere(0.008, DVec3::new(0.0, 0.0, 0.0085), Coupling::Rigid)];
        let mut rig = Rig::new(spec);
        for tick in 0..800 {
            let z = 0.0085 - 0.003 * (f64::from(tick) / 100.0).min(1.0);
            assert!(rig.tick_at(DVec3::Z * z).quarantined.is_none());
        }
        (rig.state.mechanical.tools[0].device_force_n, rig.state.mechanical.x)
    };
    let (explicit, implicit) = (settle(Integrator::Leapfrog), settle(Integrator::BackwardEuler));
    println!("{} N, {} N, {:.1e} m apart", explicit.0, implicit.0, distance(&explicit.1, &implicit.1));
    assert!(explicit.0.z > 0.02);
    assert!((explicit.0 - implicit.0).length() < 1e-6 * explicit.0.z);
    assert!(distance(&explicit.1, &implicit.1) < 1e-7);
}

/// Stiff, viscous and pressed fast at one step a tick: what leapfrog needs hundreds of substeps for stays finite and pushes back.
#[test]
fn backward_euler_bears_stiff_viscous_contact_at_one_step_a_tick() {
    let mut spec = held_block(Integrator::BackwardEuler);
    solid_mut(&mut spec).regions[0].material = material(Law::StableNeoHookean, 1e6, 0.45);
    solid_mut(&mut spec).regions[0].material.viscosity =
        palpate_physics::material::Viscosity { phi_pa_s: 2000.0, psi_pa_s: 2000.0 };
    spec.tools = vec![sphere(0.008, DVec3::new(0.0, 0.0, 0.0085), Coupling::Rigid)];
    spec.tools[0].friction_coefficient = 0.5;
    let explicit = {
        let mut explicit = spec.clone();
        explicit.settings.integrator = Integrator::Leapfrog;
        Rig::new(explicit).model.substeps()
    };
    let mut rig = Rig::new(spec);
    assert_eq!(rig.model.substeps(), 1);
    let mut largest = 0.0_f64;
    for tick in 0..500 {
        let t = f64::from(tick) * 1e-3;
        let device = DVec3::new(0.004 * (60.0 * t).sin(), 0.0, 0.0085 - 0.002 * (30.0 * t).sin());
        assert!(rig.tick_at(device).quarantined.is_none());
        largest = largest.max(rig.state.mechanical.tools[0].device_force_n.length());
        let moved = rig
            .state
            .mechanical
            .x
            .iter()
            .zip(rig.model.rest_positions_m())
            .map(|(x, r)| x.distance(*r))
            .fold(0.0, f64::max);
        assert!(moved < 0.004, "tick {tick}: {moved}");
    }
    println!("leapfrog would take {explicit} substeps; largest force {largest:.2} N");
    assert!(explicit > 100 && largest > 1.0 && largest < 100.0, "{explicit} {largest}");
}
