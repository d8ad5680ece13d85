//! Capsules on bodies that are fine near tools only: hybrid bodies, whose particles wake there, and surfaces of
//! springs, which are refined there.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::{DQuat, DVec3};
use palpate_physics::{
    BodySpec, Energies, LoadSpec, ModelSpec, PrescribedSpec, Settings, Substeps,
    bodies::{
        hybrid::Waking,
        mass_spring::{
            AnchorLaw, MassSpringSpec, Refinement, Refining, SpringSpec, body::triangles_about, net::hexagonal_patch,
            region::Constants,
        },
    },
    contact::{Coupling, ToolShape, ToolSpec, ToolTarget},
    snapshot,
    world::wake_only,
};
use rig::{Drive, Rig, held_below, hybrid_block, particles_mut, sphere};
use std::f64::consts::FRAC_PI_2;

const RADIUS_M: f64 = 4e-3;
const HALF_M: f64 = 12e-3;
const REACH_M: f64 = 6e-3;

fn lying(start_m: DVec3, coupling: Coupling) -> ToolSpec {
    let shape = ToolShape::capsule(coupling, RADIUS_M, HALF_M, DVec3::X);
    ToolSpec { shape, ..sphere(RADIUS_M, start_m, coupling) }
}

fn on_spring(stiffness_n_per_m: f64, damping_n_s_per_m: f64) -> Coupling {
    Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg: 0.02 }
}

/// 40 × 40 × 20 mm in 24 coarse tets, particles 2.5 mm apart, its lower face held, and a capsule that lies above.
fn block(most_active: usize, waking: Waking) -> ModelSpec {
    let mut spec = held_below(hybrid_block((0.02, 1, 8), 0.45, most_active, waking));
    spec.settings.mass_damping_per_s = 40.0;
    spec.tools = vec![lying(DVec3::Z * (RADIUS_M + 3e-3), Coupling::Rigid)];
    spec
}

fn first(rig: &Rig) -> ToolTarget {
    rig.state.mechanical.tools[0].target
}

fn run_at(rig: &mut Rig, target: ToolTarget) {
    let drive = Drive { tools: vec![target], ..rig.still() };
    rig.tick(&drive);
}

/// Down to a height in 300 ticks, tilted (rad) about y meanwhile, then at rest.
fn press(rig: &mut Rig, place_m: DVec3, tilt_rad: f64, ticks: u32) {
    let from = first(rig);
    for tick in 1..=ticks {
        let part = (f64::from(tick) / 300.0).min(1.0);
        let orientation = DQuat::from_rotation_y(tilt_rad * part) * from.orientation;
        run_at(rig, ToolTarget { position_m: from.position_m.lerp(place_m, part), orientation, ..from });
    }
}

/// How far (m) a particle is at rest from the line where a lying capsule touches.
fn beside_m(rig: &Rig, particle: u32) -> f64 {
    let at_m = rig.model.body().as_hybrid().unwrap().partition().particle_m(particle);
    at_m.distance(DVec3::X * at_m.x.clamp(-HALF_M, HALF_M))
}

fn are_awake(rig: &Rig, wanted: impl Fn(u32) -> bool) -> (usize, usize) {
    let body = rig.model.body().as_hybrid().unwrap();
    let all = (0..body.partition().particle_count() as u32).filter(|&p| body.may_wake(p) && wanted(p));
    all.fold((0, 0), |(awake, count), p| {
        (awake + usize::from(rig.state.body.active_particles().contains(&p)), count + 1)
    })
}

/// Of a block all of whose particles are awake.
fn on_all(spec: &ModelSpec, height_m: f64) -> Rig {
    let mut spec = spec.clone();
    let particles = particles_mut(&mut spec);
    (particles.waking, particles.most_active) = (Waking::ByHand, 4000);
    let mut rig = Rig::new(spec);
    let count = rig.model.body().as_hybrid().unwrap().partition().particle_count() as u32;
    wake_only(&rig.model, &mut rig.state, &mut rig.scratch, 0..count);
    press(&mut rig, DVec3::Z * height_m, 0.0, 1200);
    rig
}

#[test]
fn particles_wake_all_along_a_lying_capsule_and_it_feels_what_it_would_on_all_of_them() {
    let height_m = RADIUS_M - 1.5e-3;
    let spec = |reach_m: f64| block(1200, Waking::ByTools { reach_m });
    let all = on_all(&spec(REACH_M), height_m);
    let expected_n = all.state.mechanical.tools[0].contact_force_n.z;
    let mut off = Vec::new();
    for reach_m in [REACH_M, 9e-3, 12e-3] {
        let mut rig = Rig::new(spec(reach_m));
        press(&mut rig, DVec3::Z * height_m, 0.0, 1200);
        // Balls a reach apart, of a reach: √3/2 of it is covered half way between two, and a ball may lag by a spacing.
        let (awake, count) = are_awake(&rig, |p| beside_m(&rig, p) < 0.6 * reach_m);
        assert!(count > 40 && awake == count, "{reach_m}: {awake} of {count}");
        assert_eq!(are_awake(&rig, |p| beside_m(&rig, p) > 1.5 * reach_m).0, 0, "{reach_m}");
        let tool = &rig.state.mechanical.tools[0];
        let force_n = tool.contact_force_n.z;
        assert!(
            force_n > 0.1 && tool.contact_torque_nm.length() < 0.02 * force_n * HALF_M,
            "{}",
            tool.contact_torque_nm
        );
        off.push((force_n / expected_n - 1.0).abs());
    }
    println!("{off:?}");
    // A sphere of the same radius: 15, 7, 2 %.
    assert!(off[0] < 0.15 && off[1] < 0.7 * off[0] && off[2] < 0.7 * off[1], "{off:?}");
}

#[test]
fn particles_wake_at_the_end_of_a_capsule_that_touches() {
    let mut rig = Rig::new(block(600, Waking::ByTools { reach_m: REACH_M }));
    // Its end at positive x goes down; the other is 16 mm higher.
    press(&mut rig, DVec3::Z * (RADIUS_M + 7e-3), 0.72, 1200);
    let x_m = |p| rig.model.body().as_hybrid().unwrap().partition().particle_m(p).x;
    let near = are_awake(&rig, |p| x_m(p) > 6e-3 && x_m(p) < 11e-3 && beside_m(&rig, p) < 0.5 * REACH_M);
    let far = are_awake(&rig, |p| x_m(p) < -3e-3);
    assert!(near.0 == near.1 && near.1 > 3 && far.0 == 0 && far.1 > 100, "{near:?} {far:?}");
    assert!(
        rig.state.mechanical.tools[0].contact_force_n.z > 0.01,
        "{}",
        rig.state.mechanical.tools[0].contact_force_n
    );
    // A force upwards at positive x turns it back.
    assert!(
        rig.state.mechanical.tools[0].contact_torque_nm.y < -1e-5,
        "{}",
        rig.state.mechanical.tools[0].contact_torque_nm
    );
}

/// A capsule whose ends are its places, and whose middle alone touches.
#[test]
fn particles_wake_beneath_the_middle_of_a_capsule_between_two_places() {
    let mut spec = block(600, Waking::ByTools { reach_m: 2.1 * HALF_M });
    // A corner of the block between the ends: what is at the ends is far below.
    spec.tools[0] = ToolSpec {
        shape: ToolShape::capsule(Coupling::Rigid, RADIUS_M, HALF_M, DVec3::new(1.0, -1.0, 0.0)),
        start_position_m: DVec3::new(0.03, 0.03, RADIUS_M),
        ..spec.tools[0].clone()
    };
    let mut rig = Rig::new(spec);
    let at = first(&rig);
    let mut asleep_in_contact = 0;
    for tick in 0..900_u32 {
        let across_m = 0.03 - 0.012 * f64::from(tick.min(600)) / 600.0;
        run_at(&mut rig, ToolTarget { position_m: DVec3::new(across_m, across_m, 0.0), ..at });
        let touches = rig.state.mechanical.tools[0].contact_force_n.length() > 1e-4;
        asleep_in_contact += u32::from(touches && rig.state.body.active_particles().is_empty());
    }
    assert!(
        rig.state.mechanical.tools[0].contact_force_n.length() > 1e-3 && !rig.state.body.active_particles().is_empty()
    );
    assert_eq!(asleep_in_contact, 0);
}

/// With room for a part of its balls a lying capsule has what is nearest to it awake, no less between two places than
/// beneath one.
#[test]
fn particles_wake_as_deep_between_two_places_as_beneath_one() {
    let mut rig = Rig::new(block(150, Waking::ByTools { reach_m: 2.0 * HALF_M }));
    press(&mut rig, DVec3::Z * (RADIUS_M - 1.5e-3), 0.0, 1200);
    let awake_m = |wanted: &dyn Fn(f64) -> bool| {
        let body = rig.model.body().as_hybrid().unwrap();
        let among = (0..body.partition().particle_count() as u32)
            .filter(|&p| body.may_wake(p) && wanted(body.partition().particle_m(p).x.abs()));
        let (awake, asleep): (Vec<u32>, Vec<u32>) = among.partition(|p| rig.state.body.active_particles().contains(p));
        let farthest_m = awake.iter().map(|&p| beside_m(&rig, p)).fold(0.0, f64::max);
        [asleep.iter().map(|&p| beside_m(&rig, p)).fold(f64::INFINITY, f64::min), farthest_m]
    };
    // Its places are its ends.
    let [between_m, beneath_m] = [awake_m(&|x_m| x_m < 4e-3), awake_m(&|x_m| (8e-3..12e-3).contains(&x_m))];
    println!("asleep from, awake to (m): {between_m:?} between, {beneath_m:?} beneath");
    // Within a spacing.
    assert!(rig.state.body.active_particles().len() > 120 && between_m[0] > 4e-3);
    for (between, beneath) in between_m.into_iter().zip(beneath_m) {
        assert!((between - beneath).abs() < 2.5e-3, "{between_m:?} {beneath_m:?}");
    }
}

/// An upright capsule, thin beside the skin's triangles, comes down at several places of them: nothing stays asleep
/// beneath what it presses.
#[test]
fn particles_wake_beneath_a_tip_that_touches_far_from_all_vertices() {
    for at_m in [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::new(1.2, 0.7, 0.0)] {
        let mut spec = block(600, Waking::ByTools { reach_m: REACH_M });
        let (radius_m, half_m) = (0.4e-3, 1e-3);
        let height_m = radius_m + half_m;
        spec.tools[0] = ToolSpec {
            shape: ToolShape::capsule(Coupling::Rigid, radius_m, half_m, DVec3::Z),
            ..sphere(radius_m, at_m * 1.25e-3 + DVec3::Z * (height_m + 3e-3), Coupling::Rigid)
        };
        let mut rig = Rig::new(spec);
        let from = first(&rig);
        let (mut pressed, mut asleep) = (0_u32, 0);
        for tick in 0..800_u32 {
            let down_m = 3.2e-3 * (f64::from(tick) / 500.0).min(1.0);
            run_at(&mut rig, ToolTarget { position_m: from.position_m - DVec3::Z * down_m, ..from });
            pressed += u32::from(rig.state.mechanical.tools[0].contacts > 0);
            // What is to wake does so some ticks after a look.
            asleep += u32::from(pressed > 30 && rig.state.body.active_particles().is_empty());
        }
        assert!(pressed > 200 && asleep == 0, "{at_m}: asleep in {asleep} of {pressed} ticks");
    }
}

/// What body and tool exchange, friction and all, keeps both momenta, whatever wakes and falls asleep meanwhile.
#[test]
fn a_free_hybrid_block_and_a_free_capsule_keep_both_momenta() {
    let mut spec = hybrid_block((0.02, 1, 8), 0.45, 600, Waking::ByTools { reach_m: REACH_M });
    spec.tools = vec![lying(DVec3::new(0.012, 0.003, RADIUS_M + 1e-3), on_spring(1e-15, 0.0))];
    spec.tools[0].friction_coefficient = 0.5;
    let mut rig = Rig::new(spec);
    for (x, v) in rig.state.mechanical.x.iter().zip(&mut rig.state.mechanical.v) {
        *v = DVec3::new(0.01, 0.02, 0.05) + DVec3::new(0.3, -0.2, 1.0).cross(*x);
    }
    let ToolShape::Capsule(shape) = rig.model.tools()[0].shape else { panic!("a capsule") };
    let momenta = |rig: &Rig| {
        let tool = &rig.state.mechanical.tools[0];
        let p = tool.velocity_m_per_s * 0.02;
        let l = tool.centre_m.cross(p) + tool.angular_velocity_rad_per_s * shape.turning.inertia_kg_m2;
        let (of_body, about) =
            rig.model.body().as_hybrid().unwrap().momentum(rig.state.body.as_hybrid().unwrap(), &rig.state.mechanical);
        (of_body + p, about + l)
    };
    let (p0, l0) = momenta(&rig);
    let (mut touched, mut sets, mut before) = (0, 0, Vec::new());
    for _ in 0..800 {
        let still = first(&rig);
        run_at(&mut rig, still);
        touched += u32::from(rig.state.mechanical.tools[0].contacts > 0);
        sets += u32::from(rig.state.body.active_particles() != before);
        before = rig.state.body.active_particles().to_vec();
    }
    let (p, l) = momenta(&rig);
    let off = ((p - p0).length() / p0.length(), (l - l0).length() / l0.length());
    println!("{touched} ticks of contact, {sets} sets: p off {:.1e}, L off {:.1e}", off.0, off.1);
    assert!(touched > 5 && sets > 2 && rig.state.mechanical.tools[0].angular_velocity_rad_per_s.length() > 0.3);
    assert!(off.0 < 1e-11 && off.1 < 1e-11, "{off:?}");
}

fn rubbing(tick: u32, first: ToolTarget) -> ToolTarget {
    let wave = |frequency: f64| (frequency * f64::from(tick) * 1e-3).sin();
    ToolTarget {
        position_m: first.position_m + DVec3::new(0.006 * wave(7.0), 0.004 * wave(5.0), -4e-3 - 2e-3 * wave(11.0)),
        orientation: DQuat::from_rotation_z(0.8 * wave(4.0))
            * DQuat::from_rotation_y(0.3 * wave(6.0))
            * first.orientation,
        ..first
    }
}

/// Contact goes on with what it knew of the skin where particles wake beneath a capsule that rubs and turns; a restored
/// run goes on as it was.
#[test]
fn the_broad_phase_changes_no_bit_and_a_restored_run_goes_on_as_it_was() {
    let start = |distant_contact: bool| {
        let mut spec = block(600, Waking::ByTools { reach_m: REACH_M });
        spec.tools = vec![lying(DVec3::Z * (RADIUS_M + 2e-3), on_spring(400.0, 3.0))];
        spec.tools[0].friction_coefficient = 0.4;
        spec.settings.skips.distant_contact = distant_contact;
        Rig::new(spec)
    };
    let (mut quick, mut slow) = (start(true), start(false));
    let at = first(&quick);
    let (mut saved, mut sets, mut before) = (None, 0, Vec::new());
    for tick in 0..900 {
        run_at(&mut quick, rubbing(tick, at));
        run_at(&mut slow, rubbing(tick, at));
        assert_eq!(quick.state.mechanical.x, slow.state.mechanical.x, "tick {tick}");
        assert_eq!(quick.state.mechanical.tools, slow.state.mechanical.tools, "tick {tick}");
        sets += u32::from(quick.state.body.active_particles() != before);
        before = quick.state.body.active_particles().to_vec();
        if tick == 500 {
            assert!(quick.state.mechanical.tools[0].contacts > 0, "saved in contact");
            saved = Some(snapshot::save(&quick.model, &quick.state));
        }
    }
    let mut again = start(true);
    again.state = snapshot::restore(&again.model, &saved.unwrap()).unwrap();
    for tick in 501..900 {
        run_at(&mut again, rubbing(tick, at));
    }
    assert_eq!(snapshot::state_hash(&again.state), snapshot::state_hash(&quick.state));
    assert!(sets > 10, "{sets}");
}

const EDGE_M: f64 = 4e-3;

/// A flat sheet of springs whose boundary is held, and a capsule of 3 mm that lies above its middle.
fn sheet(rings: i32, refinement: Option<Refinement>, along: DVec3) -> ModelSpec {
    let surface = hexagonal_patch(rings, EDGE_M).unwrap();
    let vertices = surface.positions_m().len();
    let boundary: Vec<u32> = (0..vertices as u32).filter(|&vertex| surface.is_boundary(vertex)).collect();
    let radius_m = 3e-3;
    let shape = ToolShape::capsule(Coupling::Rigid, radius_m, HALF_M, along);
    ModelSpec {
        body: BodySpec::MassSpring(MassSpringSpec {
            springs: SpringSpec {
                coarse: Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 12.0 },
                fine: Constants { mesh_n_per_m: 36.0, anchor_n_per_m: 6.2 },
                anchor_law: AnchorLaw::Linear,
                mass_kg: vec![2e-4; vertices],
                held: Vec::new(),
                most_awake: vertices,
                // What scenes have by default.
                most_refined: 6 * triangles_about(2, 2.0 * HALF_M, EDGE_M),
                surface,
            },
            refinement,
            table: None,
        }),
        prescribed: vec![PrescribedSpec { name: "boundary".into(), nodes: boundary, axes: [true; 3], is_fixed: false }],
        loads: Vec::<LoadSpec>::new(),
        gravity_m_per_s2: DVec3::ZERO,
        tools: vec![ToolSpec { shape, ..sphere(radius_m, DVec3::Z * 0.01, Coupling::Rigid) }],
        settings: Settings { mass_damping_per_s: 60.0, ..Settings::default() },
    }
}

/// Middles (m) of the edges that are refined.
fn refined_m(rig: &Rig) -> Vec<DVec3> {
    let body = rig.model.body().as_mass_spring().unwrap();
    let surface = body.model().surface();
    let ids = rig.state.body.as_mass_spring().unwrap().motion.ids.iter();
    let middle = |id: &u32| {
        let [a, b] = surface.edges()[id.checked_sub(body.model().vertices())? as usize].nodes;
        Some((surface.positions_m()[a as usize] + surface.positions_m()[b as usize]) * 0.5)
    };
    ids.filter_map(middle).collect()
}

#[test]
fn a_surface_of_springs_is_refined_all_along_a_lying_capsule_and_coarse_again_when_it_has_left() {
    let by_tools = Refinement { rings: 2, follows_dent: false, blend_s: 0.1, by: Refining::ByTools };
    for angle_rad in [0.0, 0.4, FRAC_PI_2] {
        let along = DQuat::from_rotation_z(angle_rad) * DVec3::X;
        let mut rig = Rig::new(sheet(10, Some(by_tools), along));
        press(&mut rig, DVec3::Z * 1.5e-3, 0.0, 600);
        let middles = refined_m(&rig);
        let apart_m = |p: DVec3| p.distance(along * p.dot(along).clamp(-HALF_M, HALF_M));
        // Every edge beneath it is refined, and none beyond its two rings.
        let surface = rig.model.body().as_mass_spring().unwrap().model().surface();
        let beneath = surface
            .edges()
            .iter()
            .map(|edge| edge.nodes.map(|n| surface.positions_m()[n as usize]).iter().sum::<DVec3>() * 0.5);
        let beneath: Vec<DVec3> = beneath.filter(|p| apart_m(*p) < EDGE_M).collect();
        assert!(beneath.len() > 20 && beneath.iter().all(|p| middles.contains(p)), "{angle_rad}");
        assert!(middles.iter().all(|p| apart_m(*p) < 3.5 * EDGE_M), "{angle_rad}");
        assert!(rig.state.mechanical.tools[0].contact_force_n.z > 0.02);
        press(&mut rig, DVec3::Z * 0.03, 0.0, 700);
        assert!(refined_m(&rig).is_empty(), "{angle_rad}");
    }
}

/// Pressing, dragging and turning across many regions, and leaving: the error of the books is leapfrog's, of second
/// order in the step.
#[test]
fn the_ledger_closes_while_a_capsule_is_dragged_and_turned() {
    let by_tools = Refinement { rings: 2, follows_dent: false, blend_s: 0.1, by: Refining::ByTools };
    let off = |substeps: u32| {
        let mut spec = sheet(10, Some(by_tools), DVec3::X);
        spec.settings.substeps = Substeps::Fixed(substeps);
        let mut rig = Rig::new(spec);
        press(&mut rig, DVec3::Z * 1.5e-3, 0.0, 300);
        let (pressed_j, at) = (Energies::of(&rig.model, &rig.state).held_j(), first(&rig));
        for tick in 0..1500 {
            let wave = |frequency: f64| (f64::from(tick) * 1e-3 * frequency).sin();
            let orientation = DQuat::from_rotation_z(0.9 * wave(4.0)) * at.orientation;
            let position_m = at.position_m + DVec3::new(5e-3 * wave(6.0), 3e-3 * wave(5.0), 0.0);
            run_at(&mut rig, ToolTarget { position_m, orientation, ..at });
        }
        press(&mut rig, DVec3::Z * 0.03, 0.0, 700);
        let given_j = rig.state.body.as_mass_spring().unwrap().given_j;
        // Levels on their way drive no tool on.
        assert!(given_j < 0.0 && given_j > -0.1 * pressed_j, "{given_j} {pressed_j}");
        Energies::of(&rig.model, &rig.state).balance_j().abs() / pressed_j
    };
    let [long, half] = [16, 32].map(off);
    println!("{long:.2e}, {half:.2e} of what is held while pressed");
    assert!(half < 2e-3 && half < 0.4 * long, "{long} {half}");
}
