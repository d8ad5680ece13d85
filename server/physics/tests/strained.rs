//! The look for strained elements by what a run has ready, against the one that makes everything anew: `palpated simulate`
//! looks every ten ticks, and took 1.17 times as long for it on a hybrid body.
#![allow(clippy::unwrap_used)]
use crate::rig;
use glam::DVec3;
use palpate_physics::{
    bodies::hybrid::Waking,
    contact::Coupling,
    material::Law,
    world::{min_volume_ratio, strained, strained_in},
};
use rig::{Rig, held_below, hybrid_block, solid_mut, sphere};

/// A hybrid block with a rigid sphere 1 mm above its middle.
fn pressed(law: Law) -> Rig {
    let waking = Waking::ByTools { reach_m: 0.006 };
    let mut spec = held_below(hybrid_block((0.02, 1, 8), 0.3, 120, waking));
    spec.settings.mass_damping_per_s = 20.0;
    spec.tools = vec![sphere(0.006, DVec3::Z * 0.007, Coupling::Rigid)];
    for region in &mut solid_mut(&mut spec).regions {
        region.material.law = law;
    }
    Rig::new(spec)
}

#[test]
fn what_a_run_has_ready_tells_the_same_while_particles_wake_and_sleep() {
    let mut rig = pressed(Law::StVenantKirchhoff);
    let (mut most_awake, mut sets, mut last) = (0, 0, Vec::new());
    for tick in 0..600_u32 {
        // Down by 8 mm, aside, and up again.
        let part = |from: u32, to: u32| (f64::from(tick.clamp(from, to) - from) / f64::from(to - from)).min(1.0);
        let position_m = DVec3::new(0.008 * part(200, 350), 0.0, 0.007 - 0.008 * part(0, 150) + 0.02 * part(400, 500));
        rig.tick_at(position_m);
        assert!(rig.state.quarantine.is_none(), "tick {tick}");
        let oracle = strained(&rig.model, &rig.state).unwrap();
        let found = strained_in(&rig.model, &rig.state, &mut rig.scratch).unwrap();
        assert!((found.volume.ratio - oracle.volume.ratio).abs() < 1e-9, "tick {tick}: {found:?} {oracle:?}");
        assert_eq!(found.pressed.is_some(), oracle.pressed.is_some(), "tick {tick}");
        if let (Some(found), Some(oracle)) = (found.pressed, oracle.pressed) {
            assert!((found.stretch - oracle.stretch).abs() < 1e-6, "tick {tick}: {found:?} {oracle:?}");
        }
        assert_eq!(min_volume_ratio(&rig.model, &rig.state), Some(oracle.volume));
        let active = rig.state.body.active_particles();
        most_awake = most_awake.max(active.len());
        if active != last {
            sets += 1;
            last = active.to_vec();
        }
    }
    println!("at most {most_awake} awake, {sets} sets");
    assert!(most_awake > 50 && sets > 5, "{most_awake} {sets}");
}

/// Looking changes nothing: the next ticks have the same bits.
#[test]
fn a_look_leaves_a_run_as_it_is() {
    let run = |looks: bool| {
        let mut rig = pressed(Law::StableNeoHookean);
        for tick in 0..250_u32 {
            rig.tick_at(DVec3::Z * (0.007 - 0.00003 * f64::from(tick)));
            if looks {
                strained_in(&rig.model, &rig.state, &mut rig.scratch);
            }
        }
        rig.state
    };
    let (with, without) = (run(true), run(false));
    assert!(with == without && with.awake_particles() > 20);
}

/// After a state was put in the place of the one that the buffers are of, they are not used.
#[test]
fn buffers_of_another_state_are_left_aside() {
    let mut rig = pressed(Law::StableNeoHookean);
    let at_rest = rig.state.clone();
    for tick in 0..200_u32 {
        rig.tick_at(DVec3::Z * (0.007 - 0.00004 * f64::from(tick)));
    }
    assert!(rig.state.awake_particles() > 20);
    let found = strained_in(&rig.model, &at_rest, &mut rig.scratch).unwrap();
    assert!((found.volume.ratio - 1.0).abs() < 1e-12, "{found:?}");
}
