//! The papers' hybrid as a body of the loop: its steps are the papers' own, tools press it, and it is contained, saved and refused as
//! others are.
#![allow(clippy::unwrap_used)]
use crate::octahedra;
use crate::rig;
use glam::DVec3;
use octahedra::{FACE_M, OUTWARDS, body_spec, device_m, layer, parameters};
use palpate_physics::{
    BodySpec, Integrator, LoadSpec, Model, ModelSpec, PointForce, State, Substeps,
    bodies::seed::{AtVertex, SeedContact, SeedModel, SeedParameters, SeedScratch, SeedSpec, SeedState},
    contact::Coupling,
    snapshot::{SnapshotError, restore, save, state_hash},
};
use rig::{Drive, Rig, solid_mut};

fn layered() -> ModelSpec {
    body_spec(0.02, Some(layer()), parameters())
}

fn run(rig: &mut Rig, ticks: std::ops::Range<u32>) {
    for tick in ticks {
        assert_eq!(rig.tick_at(device_m(tick)).quarantined, None);
    }
}

/// The model as the papers' library builds it, from what the body was built from.
fn oracle(spec: &ModelSpec, dt_s: f64) -> SeedModel {
    let BodySpec::Seed(seed) = spec.body.clone() else { panic!("no seed body") };
    SeedModel::build(SeedSpec {
        core: seed.core.mesh,
        held_nodes: spec.prescribed[0].nodes.clone(),
        layer: seed.layer,
        parameters: SeedParameters { dt_s, ..seed.parameters },
    })
    .unwrap()
}

/// Pressed, rubbed over an edge and left: every tick is the library's own step with the forces that contact left, to the bit.
#[test]
fn a_tick_is_the_papers_step_with_what_tools_do_as_external_forces() {
    for layer in [Some(layer()), None] {
        let is_layered = layer.is_some();
        let outer_m = if is_layered { 0.02 } else { 0.03 };
        let spec = body_spec(outer_m, layer, parameters());
        let model = oracle(&spec, spec.settings.tick_period_s);
        let (mut state, mut scratch) = (SeedState::at_rest(&model), SeedScratch::new(&model));
        let mut rig = Rig::new(spec);
        let (mut touched, mut sides) = (0, std::collections::BTreeSet::new());
        for tick in 0..400 {
            let nodes = rig.model.surface().nodes.iter().zip(0..);
            let forces_n: Vec<AtVertex> = nodes
                .map(|(&node, vertex)| AtVertex { vertex, value: rig.state.mechanical.external_n[node as usize] })
                .filter(|force| force.value != DVec3::ZERO)
                .collect();
            let triangle = rig.state.body.as_seed().unwrap().touched;
            touched += u32::from(!forces_n.is_empty());
            sides.extend(triangle);
            assert!(tick >= 150 || triangle.is_none_or(|triangle| triangle == 0 || !is_layered), "{triangle:?}");
            model.step(&mut state, &mut scratch, &SeedContact { triangle, forces_n: &forces_n, displaced_m: &[] });
            rig.tick_at(device_m(tick));
            assert_eq!(rig.state.body.as_seed().unwrap().now, state, "tick {tick}");
            assert!(rig.state.mechanical.x.iter().eq(state.core.x.iter().chain(&state.skin.x)));
            assert!(rig.state.mechanical.v.iter().eq(state.core.v.iter().chain(&state.skin.v)));
        }
        assert!(touched > 100 && sides.len() > 1, "{touched} {sides:?}");
        assert!(!rig.state.mechanical.contact.touches(0) && rig.state.awake_particles() == 0);
    }
}

/// A tick of two steps is two ticks of one; a step that does not fit is shortened, never lengthened.
#[test]
fn a_tick_is_taken_in_equal_steps_that_are_no_longer_than_wanted() {
    let push =
        |rig: &Rig| vec![PointForce { node: rig.model.surface().nodes[2], force_n: DVec3::new(3e-6, -2e-5, 0.0) }];
    let steps = |tick_period_s: f64| {
        let mut spec = layered();
        (spec.tools, spec.settings.tick_period_s) = (Vec::new(), tick_period_s);
        Rig::new(spec)
    };
    let (mut one, mut two) = (steps(7e-3), steps(14e-3));
    assert_eq!((one.model.substeps(), two.model.substeps()), (1, 2));
    for _ in 0..50 {
        for (rig, ticks) in [(&mut one, 2), (&mut two, 1)] {
            let drive = Drive { point_forces: push(rig), ..rig.still() };
            (0..ticks).for_each(|_| assert_eq!(rig.tick(&drive).inputs_rejected, 0));
        }
        assert_eq!(one.state.body, two.state.body);
    }
    assert!(one.state.mechanical.x[one.model.surface().nodes[2] as usize].distance(DVec3::Y * 0.03) > 1e-4);
    let longer = steps(14.1e-3);
    assert_eq!(longer.model.substeps(), 3);
    assert!((longer.model.body().as_seed().unwrap().model().parameters().dt_s - 4.7e-3).abs() < 1e-15);
}

/// The ball pressed in by `depth_m` over 100 ticks and held there.
fn press_and_hold(rig: &mut Rig, depth_m: f64, ticks: u32, mut look: impl FnMut(&Rig)) {
    for tick in 0..ticks {
        let in_m = depth_m * f64::from(tick.min(100)) / 100.0;
        assert_eq!(rig.tick_at(OUTWARDS * (FACE_M + 0.01 - in_m)).quarantined, None);
        look(rig);
    }
}

/// Newton's third law at the tool, and in the mean over time between tool and holder: of the core alone, as the layer's border hangs on the
/// world.
#[test]
fn a_pressed_body_pushes_back_as_hard_as_its_holder_holds() {
    let mut rig = Rig::new(body_spec(0.03, None, parameters()));
    let (mut on_tool, mut by_holder, mut ticks) = (DVec3::ZERO, DVec3::ZERO, 0);
    press_and_hold(&mut rig, 2e-3, 8000, |rig| {
        let on_body: DVec3 = rig.state.mechanical.external_n.iter().sum();
        let contact_n = rig.state.mechanical.tools[0].contact_force_n;
        assert!((on_body + contact_n).length() <= 1e-12 * contact_n.length());
        ticks += 1;
        if ticks > 2000 {
            on_tool += contact_n;
            by_holder += rig.scratch.reactions_n().iter().sum::<DVec3>();
        }
    });
    assert!(on_tool.dot(OUTWARDS) / 6000.0 > 1e-5, "{on_tool}");
    let left = (on_tool - by_holder).length() / on_tool.length();
    println!("{left} of the force is left between tool and holder");
    assert!(left < 1e-2, "{on_tool} on the tool, {by_holder} by the holder");
    assert!(rig.state.mechanical.ledger.external_work_j > 0.0);
}

/// Particles are awake while their triangle is touched, and resist more the deeper they are pressed.
#[test]
fn particles_wake_under_the_tool_and_resist() {
    let mean_force_n = |depth_m: f64| {
        let mut rig = Rig::new(layered());
        let (mut sum_n, mut touched) = (0.0, false);
        press_and_hold(&mut rig, depth_m, 400, |rig| {
            assert_eq!(rig.state.awake_particles() > 0, touched);
            assert!(rig.state.awake_particles() <= rig.model.body().most_awake_particles());
            touched = rig.state.mechanical.contact.touches(0);
            sum_n += rig.state.mechanical.tools[0].contact_force_n.dot(OUTWARDS);
        });
        sum_n / 400.0
    };
    let forces_n = [1.5e-3, 3e-3].map(mean_force_n);
    println!("{forces_n:?} N in the mean");
    assert!(forces_n[0] > 0.0 && forces_n[1] > 2.0 * forces_n[0]);
}

#[test]
fn loads_and_prescribed_nodes_act_as_far_as_it_has_them() {
    let mut spec = layered();
    spec.tools.clear();
    spec.loads = vec![LoadSpec::Pressure { triangles: vec![0], pressure_pa: 0.05, follower: false }];
    let mut rig = Rig::new(spec);
    let drive = |moved_m: DVec3| Drive { load_factors: vec![1.0], prescribed: vec![moved_m], ..Drive::default() };
    assert_eq!(rig.tick(&drive(DVec3::ZERO)).inputs_rejected, 0);
    // What holds it does not move.
    assert_eq!(rig.tick(&drive(DVec3::X * 1e-3)).inputs_rejected, 1);
    for _ in 0..20 {
        rig.tick(&drive(DVec3::ZERO));
    }
    let corner = rig.model.surface().triangle_nodes(0)[0] as usize;
    assert!((rig.state.mechanical.x[corner] - rig.model.rest_positions_m()[corner]).dot(OUTWARDS) < -1e-5);
    assert_eq!(rig.state.mechanical.x[1], rig.model.rest_positions_m()[1]);
}

#[test]
fn a_restored_run_continues_with_the_same_bits() {
    let mut first = Rig::new(layered());
    run(&mut first, 0..220);
    assert!(first.state.awake_particles() > 0);
    let bytes = save(&first.model, &first.state);
    run(&mut first, 220..330);
    let mut second = Rig::new(layered());
    second.state = restore(&second.model, &bytes).unwrap();
    run(&mut second, 220..330);
    assert_eq!(state_hash(&first.state), state_hash(&second.state));
    assert_eq!(first.state, second.state);
    // Another paper's factors make another body.
    let other = Rig::new(body_spec(0.02, Some(layer()), SeedParameters { smoothing_ratio: 1.3, ..parameters() }));
    assert_eq!(restore(&other.model, &bytes), Err(SnapshotError::OtherBody));
    // Particles are part of the hash, and nodes that are not where the model has them are refused.
    let mut moved = first.state.clone();
    moved.body.as_seed_mut().unwrap().now.particles.x[0].x += 1e-9;
    assert_ne!(state_hash(&moved), state_hash(&first.state));
    let mut torn = first.state.clone();
    torn.mechanical.x[0].x += 1e-9;
    assert_eq!(restore(&first.model, &save(&first.model, &torn)), Err(SnapshotError::OtherBody));
}

/// A ball pressed through all of the layer bursts it: the last good state stays, at rest and marked, can be saved, and goes back to its start.
#[test]
fn what_bursts_is_contained() {
    let mut rig = Rig::new(layered());
    let (mut quarantined, mut awake) = (None, 0);
    for tick in 0..2000 {
        let before = rig.state.clone();
        awake += u32::from(before.awake_particles() > 0);
        let in_m = 6e-3 * f64::from(tick.min(100)) / 100.0;
        quarantined = rig.tick_at(OUTWARDS * (FACE_M + 0.01 - in_m)).quarantined;
        if quarantined.is_some() {
            assert_eq!(
                (&rig.state.mechanical.x, rig.state.mechanical.tick),
                (&before.mechanical.x, before.mechanical.tick + 1)
            );
            break;
        }
    }
    assert!(awake > 100);
    assert!(quarantined.is_some() && quarantined == rig.state.quarantine);
    let seed = &rig.state.body.as_seed().unwrap().now;
    assert!([&seed.core, &seed.skin, &seed.particles].iter().all(|part| part.v.iter().all(|v| *v == DVec3::ZERO)));
    assert_eq!(restore(&rig.model, &save(&rig.model, &rig.state)).unwrap(), rig.state);
    let held = rig.state.clone();
    rig.tick_at(device_m(0));
    assert_eq!(rig.state, held);
    rig.state.reset(&rig.model);
    assert_eq!(rig.state, State::at_rest(&rig.model));
}

type Change<'a> = &'a dyn Fn(&mut ModelSpec);

#[test]
fn what_it_cannot_have_is_refused_by_name() {
    let message = |change: &dyn Fn(&mut ModelSpec)| {
        let mut spec = layered();
        change(&mut spec);
        Model::build(spec).unwrap_err().to_string()
    };
    let parameters_of = |spec: &mut ModelSpec, change: &dyn Fn(&mut SeedParameters)| {
        let BodySpec::Seed(seed) = &mut spec.body else { panic!("no seed body") };
        change(&mut seed.parameters);
    };
    let refused: [(Change<'_>, &str); 11] = [
        (&|spec| spec.gravity_m_per_s2 = DVec3::NEG_Z, "cannot have gravity"),
        (&|spec| solid_mut(spec).regions[0].density_kg_per_m3 = 900.0, "one St. Venant-Kirchhoff material"),
        (&|spec| spec.prescribed[0].axes[1] = false, "hold all three"),
        (&|spec| spec.prescribed[0].nodes[0] = 99, "99"),
        (&|spec| spec.settings.integrator = Integrator::SeedVerlet, "it has its own two"),
        (&|spec| spec.settings.substeps = Substeps::Fixed(3), "give its step dt_s"),
        (&|spec| spec.settings.mass_damping_per_s = 1.0, "mass damping"),
        (&|spec| spec.settings.sleep_tolerance_m = 1e-6, "sleep of the whole body"),
        (&|spec| parameters_of(spec, &|parameters| parameters.dt_s = 1e-9), "100000 steps or fewer"),
        (&|spec| parameters_of(spec, &|parameters| parameters.smoothing_ratio = 9.0), "smoothing_ratio = 9"),
        (
            &|spec| {
                spec.tools[0].coupling =
                    Coupling::Spring { stiffness_n_per_m: 5000.0, damping_n_s_per_m: 1.0, mass_kg: 0.05 };
            },
            "shorten its step",
        ),
    ];
    for (change, wanted) in refused {
        let message = message(change);
        assert!(message.contains(wanted), "{message}");
    }
}
