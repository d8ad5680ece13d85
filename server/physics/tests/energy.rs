//! Energy and momentum: conserved in free flight, accounted for under every kind of work, bounded under impulses.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    Energies, LoadSpec, Model, ModelSpec, PointForce, State, Substeps, TetMesh,
    contact::Coupling,
    material::{Law, Viscosity},
};
use rig::{Drive, Rig, at, body, bricks, even, hold, material, mesh_of, nodes_where, solid_mut, sphere};

fn block() -> TetMesh {
    let side = even(-0.02, 0.02, 4);
    bricks(&side, &side, &even(-0.02, 0.0, 2))
}

fn soft_block() -> ModelSpec {
    body(block(), material(Law::StableNeoHookean, 10e3, 0.4))
}

fn held_below(mut spec: ModelSpec) -> ModelSpec {
    let bottom = nodes_where(mesh_of(&spec), |p| p.z < -0.0199);
    spec.prescribed = vec![hold("bottom", bottom, [true; 3])];
    spec
}

fn momenta(model: &Model, state: &State) -> (DVec3, DVec3) {
    let terms = || state.mechanical.x.iter().zip(&state.mechanical.v).zip(model.body().mass_kg());
    (terms().map(|((_, v), m)| *v * *m).sum(), terms().map(|((x, v), m)| x.cross(*v) * *m).sum())
}

/// A spin, a translation and a stretching motion.
fn throw(state: &mut State) {
    for (x, v) in state.mechanical.x.iter().zip(&mut state.mechanical.v) {
        *v = DVec3::new(0.3, -0.2, 0.5) + DVec3::new(4.0, -7.0, 9.0).cross(*x) + DVec3::new(12.0, -8.0, 5.0) * *x;
    }
}

/// Errors of a free flight of four seconds, relative to what was there at its start.
struct Flight {
    momentum: f64,
    angular_momentum: f64,
    /// Largest deviation of the energy.
    energy: f64,
    /// Mean energy over the last second less that over the first.
    drift: f64,
}

fn fly(substeps: Substeps) -> Flight {
    let mut spec = soft_block();
    spec.settings.substeps = substeps;
    let mut rig = Rig::new(spec);
    throw(&mut rig.state);
    let (p0, l0) = momenta(&rig.model, &rig.state);
    let e0 = Energies::of(&rig.model, &rig.state).held_j();
    let (mut energy, mut first, mut last) = (0.0_f64, 0.0, 0.0);
    let ticks = 4000;
    for tick in 0..ticks {
        let drive = rig.still();
        rig.tick(&drive);
        let e = Energies::of(&rig.model, &rig.state).held_j() / e0 - 1.0;
        energy = energy.max(e.abs());
        if tick < ticks / 4 {
            first += e;
        } else if tick >= ticks - ticks / 4 {
            last += e;
        }
    }
    let (p, l) = momenta(&rig.model, &rig.state);
    Flight {
        momentum: (p - p0).length() / p0.length(),
        angular_momentum: (l - l0).length() / l0.length(),
        energy,
        drift: (last - first) / f64::from(ticks / 4),
    }
}

/// Forces of a body sum to nothing and have no moment, so both momenta are kept to rounding. Leapfrog is symplectic: it
/// conserves a neighbouring energy, so the energy's error is bounded by O((ω dt)²) and does not grow with time.
#[test]
fn free_flight_keeps_momentum_and_holds_its_energy() {
    let measured = Rig::new(soft_block()).model.substeps();
    let flights = [1, 2, 4, 8].map(|finer| fly(Substeps::Fixed(finer * measured)));
    for (flight, finer) in flights.iter().zip([1, 2, 4, 8]) {
        println!(
            "{} substeps: momentum {:.1e}, angular {:.1e}, energy error {:.2e}, drift of the mean {:.1e}",
            finer * measured,
            flight.momentum,
            flight.angular_momentum,
            flight.energy,
            flight.drift
        );
        // Rounding: 4000 ticks change the momentum in its last bits; the angular one is a sum of larger terms.
        assert!(flight.momentum < 1e-14 && flight.angular_momentum < 1e-12);
        assert!(flight.drift.abs() < 0.1 * flight.energy, "{} of {}", flight.drift, flight.energy);
    }
    // Twice what is measured, at the step that ω_max allows.
    assert!(flights[0].energy < 3e-3, "{}", flights[0].energy);
    for pair in flights.windows(2) {
        let order = (pair[0].energy / pair[1].energy).log2();
        assert!(order > 1.9, "{order}");
    }
}

/// What a scenario does to a body, as a function of time (s).
struct Scenario {
    name: &'static str,
    spec: ModelSpec,
    start: fn(&mut State),
    drive: fn(f64, &mut Drive),
    time_s: f64,
}

/// `|K + U + G − W + D|` at the end, over the largest energy that moved, with a given number of substeps per tick.
fn imbalance(scenario: &Scenario, substeps: u32) -> f64 {
    let mut spec = scenario.spec.clone();
    spec.settings.substeps = Substeps::Fixed(substeps);
    let mut rig = Rig::new(spec);
    (scenario.start)(&mut rig.state);
    let start = Energies::of(&rig.model, &rig.state);
    let mut moved = start.kinetic_j;
    let mut worst = 0.0_f64;
    for tick in 1..=(scenario.time_s / 1e-3).round() as u32 {
        let mut drive = rig.still();
        (scenario.drive)(f64::from(tick) * 1e-3, &mut drive);
        rig.tick(&drive);
        let now = Energies::of(&rig.model, &rig.state);
        moved = moved.max(now.external_work_j.abs()).max(now.kinetic_j).max(now.elastic_j).max(now.dissipated_j);
        worst = worst.max((now.balance_j() - start.balance_j()).abs());
    }
    assert!(moved > 1e-9, "{}: nothing moved ({moved} J)", scenario.name);
    worst / moved
}

fn ramp(t_s: f64) -> f64 {
    let s = (t_s / 0.02).min(1.0);
    s * s * (3.0 - 2.0 * s)
}

fn scenarios() -> Vec<Scenario> {
    let still: fn(&mut State) = |_| {};
    let idle: fn(f64, &mut Drive) = |_, _| {};
    let first_load: fn(f64, &mut Drive) = |t, drive| drive.load_factors[0] = ramp(t);
    let top = |spec: &ModelSpec| {
        let surface = palpate_physics::Surface::of(mesh_of(spec)).unwrap();
        let up = |t: &u32| {
            surface.triangle_nodes(*t as usize).iter().all(|n| mesh_of(spec).positions_m()[*n as usize].z > -1e-9)
        };
        (0..surface.triangles.len() as u32).filter(up).collect::<Vec<u32>>()
    };
    let loaded = |load: LoadSpec| ModelSpec { loads: vec![load], ..held_below(soft_block()) };
    let triangles = top(&soft_block());
    let corner = nodes_where(mesh_of(&soft_block()), |p| p.z > -1e-9 && p.x > 0.0199);
    let pressure = |follower| LoadSpec::Pressure { triangles: triangles.clone(), pressure_pa: -400.0, follower };
    let mut viscous = soft_block();
    solid_mut(&mut viscous).regions[0].material.viscosity = Viscosity { phi_pa_s: 1.0, psi_pa_s: 2.0 };
    let mut damped = soft_block();
    damped.settings.mass_damping_per_s = 30.0;
    let mut heavy = held_below(soft_block());
    heavy.gravity_m_per_s2 = DVec3::new(3.0, 0.0, -9.81);
    let mut touched = held_below(soft_block());
    touched.tools = vec![sphere(0.01, DVec3::new(0.002, 0.001, 0.0101), Coupling::Rigid)];
    let mut rubbed = touched.clone();
    rubbed.tools[0].friction_coefficient = 0.3;
    let press: fn(f64, &mut Drive) =
        |t, drive| drive.tools = vec![at(DVec3::new(0.002 + 0.002 * ramp(t), 0.001, 0.0101 - 0.003 * ramp(t)))];
    vec![
        Scenario { name: "free flight", spec: soft_block(), start: throw, drive: idle, time_s: 0.05 },
        Scenario {
            name: "nodal forces",
            spec: loaded(LoadSpec::NodalForces(corner.iter().map(|&n| (n, DVec3::new(0.02, 0.01, 0.01))).collect())),
            start: still,
            drive: first_load,
            time_s: 0.05,
        },
        Scenario {
            name: "dead traction",
            spec: loaded(LoadSpec::Traction {
                triangles: triangles.clone(),
                traction_pa: DVec3::new(300.0, 0.0, 100.0),
            }),
            start: still,
            drive: first_load,
            time_s: 0.05,
        },
        Scenario {
            name: "dead pressure",
            spec: loaded(pressure(false)),
            start: still,
            drive: first_load,
            time_s: 0.05,
        },
        Scenario {
            name: "follower pressure",
            spec: loaded(pressure(true)),
            start: still,
            drive: first_load,
            time_s: 0.05,
        },
        Scenario { name: "gravity", spec: heavy, start: still, drive: idle, time_s: 0.05 },
        Scenario {
            name: "prescribed motion",
            spec: held_below(soft_block()),
            start: still,
            drive: |t, drive| drive.prescribed = vec![DVec3::new(0.004, 0.0, 0.002) * ramp(t)],
            time_s: 0.05,
        },
        Scenario { name: "viscous stress", spec: viscous, start: throw, drive: idle, time_s: 0.05 },
        Scenario { name: "mass damping", spec: damped, start: throw, drive: idle, time_s: 0.05 },
        Scenario { name: "contact", spec: touched, start: still, drive: press, time_s: 0.05 },
        Scenario { name: "contact with friction", spec: rubbed, start: still, drive: press, time_s: 0.05 },
    ]
}

/// Second order everywhere, but for viscous stress at large strain: its force sees the velocity half a substep late, and
/// the ledger's correction of that assumes a damping matrix that does not turn (see `health::ViscousPower`).
#[test]
fn the_ledger_balances_to_second_order_in_dt() {
    for scenario in scenarios() {
        let errors = [20, 40, 80].map(|substeps| imbalance(&scenario, substeps));
        let orders = [(errors[0] / errors[1]).log2(), (errors[1] / errors[2]).log2()];
        let [e0, e1, e2] = errors;
        println!("{:24} {e0:.2e} {e1:.2e} {e2:.2e}  order {:.2} {:.2}", scenario.name, orders[0], orders[1]);
        let order = if scenario.name == "viscous stress" { 1.3 } else { 1.9 };
        assert!(orders.iter().all(|o| *o > order), "{}: {orders:?}", scenario.name);
        assert!(e0 < 4e-5, "{}: {e0:e}", scenario.name);
    }
}

/// 1000 random impulses on random nodes, in bursts and pauses. The ledger's work is exact, so the energy held can exceed it
/// only by the leapfrog's bounded error: the largest excess falls with dt².
#[test]
fn impulses_never_leave_more_energy_than_work() {
    let excess = |substeps: u32| {
        let mut spec = soft_block();
        spec.settings.substeps = Substeps::Fixed(substeps);
        let mut rig = Rig::new(spec);
        let mut random = 1_u64;
        let mut next = || {
            random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (random >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut done, mut tick, mut worst, mut work) = (0, 0, 0.0_f64, 0.0_f64);
        while done < 1000 {
            let mut drive = rig.still();
            // Every fifth tick rests.
            if tick % 5 != 0 {
                let node = (next() * rig.state.mechanical.x.len() as f64) as u32;
                let force_n = DVec3::new(next() - 0.5, next() - 0.5, next() - 0.5) * 0.4;
                drive.point_forces.push(PointForce { node, force_n });
                done += 1;
            }
            rig.tick(&drive);
            tick += 1;
            let energies = Energies::of(&rig.model, &rig.state);
            work = work.max(energies.external_work_j);
            worst = worst.max(energies.held_j() - energies.external_work_j);
        }
        assert!(rig.state.quarantine.is_none() && work > 1e-4);
        worst / work
    };
    let [coarse, fine] = [10, 40].map(excess);
    println!("largest excess of held energy over work: {coarse:.2e} at 10 substeps, {fine:.2e} at 40");
    // held ≤ work (1 + 1e-6) + C dt², C from the coarse run.
    assert!(fine <= 1e-6 + 1.2 * coarse / 16.0, "{coarse:e} {fine:e}");
    assert!(fine < 1e-4);
}

#[test]
fn leapfrog_converges_with_order_two_on_large_strain() {
    let at = |substeps: u32| {
        let mut spec = held_below(soft_block());
        spec.settings.substeps = Substeps::Fixed(substeps);
        spec.gravity_m_per_s2 = DVec3::new(20.0, 0.0, -30.0);
        let mut rig = Rig::new(spec);
        for _ in 0..30 {
            let drive = rig.still();
            rig.tick(&drive);
        }
        rig.state.mechanical.x
    };
    let [a, b, c] = [8, 16, 32].map(at);
    let distance = |p: &[DVec3], q: &[DVec3]| p.iter().zip(q).map(|(p, q)| p.distance_squared(*q)).sum::<f64>().sqrt();
    let order = (distance(&a, &b) / distance(&b, &c)).log2();
    let rest = block();
    println!("order {order:.3}, displacement {:.1e} m", distance(&c, rest.positions_m()));
    assert!((order - 2.0).abs() < 0.1, "{order}");
}

#[test]
fn friction_takes_energy_and_never_gives_it() {
    let mut spec = soft_block();
    spec.tools = vec![sphere(0.008, DVec3::new(0.001, 0.002, 0.0083), Coupling::Rigid)];
    spec.tools[0].friction_coefficient = 0.6;
    let mut rig = Rig::new(spec);
    rig.state.mechanical.v.fill(DVec3::new(0.3, 0.1, 0.4));
    let start = Energies::of(&rig.model, &rig.state).held_j();
    let (mut heat, mut touched) = (0.0, 0);
    for _ in 0..300 {
        let drive = rig.still();
        rig.tick(&drive);
        let tool = &rig.state.mechanical.tools[0];
        assert!(tool.friction_heat_j >= heat);
        heat = tool.friction_heat_j;
        touched += u32::from(tool.contacts > 0);
        let held = Energies::of(&rig.model, &rig.state).held_j() + tool.contact_energy_j;
        assert!(held <= start * (1.0 + 2e-3), "{held} {start}");
    }
    let lost = start - Energies::of(&rig.model, &rig.state).held_j();
    println!("touched {touched} ticks; lost {lost:.3e} J of {start:.3e} J, heat {heat:.3e} J");
    assert!(touched > 5 && rig.state.mechanical.tools[0].contacts == 0);
    assert!(heat > 0.01 * start && (lost / heat - 1.0).abs() < 0.05, "lost {lost:e}, heat {heat:e}");
}
