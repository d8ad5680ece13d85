//! The law of the servo, tick by tick, without threads or real time.

use crate::bench::{MS, command, law, still};
use glam::{DMat3, DVec3};
use palpate_bridge::{convert::Command, servo::ServoLaw};
use palpate_control::{ArmSpec, Fault, HandPath, Link, LocalModel, Motion, SimulatedArm};
use proptest::prelude::*;

/// Fed every millisecond with 1 N until the ramp is up; the time of the last command.
fn up(law: &mut ServoLaw) -> u64 {
    for tick in 1..=500 {
        law.receive(&command(tick * MS, DVec3::Z, None));
        law.tick(tick * MS, &still());
    }
    assert!((law.tick(500 * MS, &still()).limited.force_n - DVec3::Z).length() < 1e-12);
    500 * MS
}

#[test]
fn no_command_no_force() {
    let mut law = law(|_| {});
    for tick in 0..100 {
        let out = law.tick(tick * MS, &still());
        assert_eq!((out.limited.force_n, out.verdict.link), (DVec3::ZERO, Link::Waiting));
    }
}

#[test]
fn silence_is_held_ramped_and_latched_within_twenty_ticks() {
    let mut law = law(|_| {});
    let last = up(&mut law);
    for age in 1..=25_u64 {
        let out = law.tick(last + age * MS, &still());
        let expected_n = (1.0 - (age as f64 - 5.0).max(0.0) / 12.0).max(0.0);
        assert!((out.limited.force_n.z - expected_n).abs() < 1e-9, "{age} ms: {}", out.limited.force_n.z);
    }
    assert_eq!(law.latched(), 1);
}

/// While a link was not judged yet, or a clutch let go, the watchdog's ramp went up unseen, and the end of that was the whole force in one tick.
#[test]
fn a_force_that_was_withheld_comes_back_by_the_ramp_and_the_rate() {
    let mut law = law(|_| {});
    let mut before_n = 0.0;
    for tick in 1..=1500_u64 {
        law.receive(&command(tick * MS, 3.0 * DVec3::Z, None));
        law.share_force(if tick <= 1000 { 0.0 } else { 1.0 });
        let force_n = law.tick(tick * MS, &still()).limited.force_n.z;
        assert!(tick > 1000 || force_n == 0.0);
        // 3 N over 0.2 s, and the limiter's own rise in the first ticks.
        assert!(force_n - before_n <= 0.03, "tick {tick}: {before_n} N, then {force_n} N");
        before_n = force_n;
    }
    assert!(before_n > 2.99, "{before_n}");
}

/// With every second tick left out the motors were thought to be half as warm as they are.
#[test]
fn ticks_that_are_left_out_warm_the_motors_too() {
    let after = |periods: u64| {
        let mut law = law(|config| {
            config.limits.continuous_force_n = Some(0.8);
            config.limits.thermal_time_s = 1.0;
        });
        let mut force_n = 0.0;
        for tick in (1..=4000_u64).step_by(periods as usize) {
            law.receive(&command(tick * MS, 3.0 * DVec3::Z, None));
            law.passed(periods);
            force_n = law.tick(tick * MS, &still()).limited.force_n.z;
        }
        force_n
    };
    let (all_n, half_n) = (after(1), after(2));
    assert!((half_n - all_n).abs() < 0.02 && all_n < 0.85, "{all_n} N, {half_n} N");
}

/// Commands came every millisecond, and so counted as fresh, however old the poses were that they answered.
#[test]
fn answers_to_old_poses_ramp_and_latch_however_steadily_they_come() {
    for (delay_ms, link, force_n) in [
        (2, Link::Fresh, 1.0),
        (4, Link::Extrapolating, 1.0),
        (8, Link::Ramping(Fault::Stale), 1.0 - 3.0 / 12.0),
        (25, Link::Latched(Fault::Stale), 0.0),
    ] {
        let mut law = law(|config| config.servo.least_success_rate = 0.0);
        let last = up(&mut law);
        let mut out = law.tick(last, &still());
        for tick in 1..=1000_u64 {
            let now = last + tick * MS;
            law.receive(&command(now - delay_ms * MS, DVec3::Z, None));
            out = law.tick(now, &still());
        }
        assert_eq!(out.verdict.link, link, "{delay_ms} ms");
        assert!((out.limited.force_n.z - force_n).abs() < 1e-9, "{delay_ms} ms: {}", out.limited.force_n.z);
    }
}

/// Of every ten answers so many come 8 ms late, in a row.
#[test]
fn a_force_that_comes_and_goes_with_every_other_answer_is_taken_away() {
    for (late, link) in [(0, Link::Fresh), (2, Link::Latched(Fault::Unreliable))] {
        let mut law = law(|_| {});
        let last = up(&mut law);
        let mut latched_at = None;
        for tick in 1..=3000_u64 {
            let now = last + tick * MS;
            // Nothing comes for 5 ms and so many, then all of them.
            if late == 0 || tick % 10 >= 6 + late {
                law.receive(&command(now, DVec3::Z, None));
            }
            let out = law.tick(now, &still());
            if matches!(out.verdict.link, Link::Latched(_)) {
                latched_at.get_or_insert((tick, out.verdict.link));
                assert_eq!(out.limited.force_n, DVec3::ZERO);
            }
        }
        match link {
            Link::Fresh => assert_eq!(latched_at, None),
            // As soon as there are enough ticks to tell, and the ramp.
            _ => assert!(latched_at.is_some_and(|(tick, found)| found == link && tick < 1100), "{latched_at:?}"),
        }
    }
}

#[test]
fn late_answers_from_the_start_give_no_force_and_no_fault_and_do_not_count_as_recovery() {
    let mut law = law(|config| config.servo.auto_recover = true);
    let mut run = |ticks: std::ops::Range<u64>, delay_ms: u64| {
        let mut out = None;
        for tick in ticks {
            law.receive(&command((tick - delay_ms) * MS, DVec3::Z, None));
            out = Some(law.tick(tick * MS, &still()));
        }
        out.unwrap()
    };
    let out = run(100..1000, 25);
    assert_eq!((out.verdict.link, out.limited.force_n), (Link::Waiting, DVec3::ZERO));
    assert!(run(1000..1500, 1).limited.force_n.z > 0.99);
    let out = run(1500..3000, 25);
    assert_eq!((out.verdict.link, out.limited.force_n), (Link::Latched(Fault::Stale), DVec3::ZERO));
    assert!(run(3000..3800, 1).limited.force_n.z > 0.99, "recovered by answers in time");
}

#[test]
fn a_fading_force_is_replaced_by_damping() {
    let mut law = law(|config| config.watchdog.fading_damping_n_s_per_m = 2.0);
    let last = up(&mut law);
    let moving = Motion { velocity_m_per_s: DVec3::new(0.1, 0.0, 0.0), ..still() };
    let ramp = 1.0 - 7.0 / 12.0;
    let out = law.tick(last + 12 * MS, &moving);
    assert!((out.verdict.ramp - ramp).abs() < 1e-9);
    // ramp · (F − (1 − ramp) B v)
    let expected_n = ramp * (DVec3::Z - (1.0 - ramp) * 2.0 * moving.velocity_m_per_s);
    assert!((out.limited.force_n - expected_n).length() < 1e-9, "{}", out.limited.force_n);
}

#[test]
fn an_arm_that_reads_nan_gets_no_force_again() {
    let mut law = law(|_| {});
    let last = up(&mut law);
    let bad = Motion::at(DVec3::new(f64::NAN, 0.0, 0.0));
    law.tick(last, &bad);
    for tick in 1..=20 {
        law.receive(&command(last + tick * MS, DVec3::Z, None));
        assert!(law.tick(last + tick * MS, &bad).limited.force_n.is_finite());
    }
    let out = law.tick(last + 20 * MS, &still());
    assert_eq!((out.limited.force_n, out.verdict.link), (DVec3::ZERO, Link::Latched(Fault::NonFinite)));
}

#[test]
fn an_old_model_in_a_fresh_command_fades() {
    let mut law = law(|_| {});
    let last = up(&mut law);
    let model = LocalModel {
        point_m: DVec3::ZERO,
        normal: DVec3::Z,
        force_n: DVec3::Z,
        stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(-100.0)),
        validity_radius_m: 0.01,
        max_force_n: 100.0,
    };
    // hold 20 ms, forget 100 ms: half at 60 ms.
    for (age_s, expected_n) in [(0.0, 1.0), (0.06, 0.5), (0.2, 0.0)] {
        let fresh = Command { model_age_s: age_s, ..command(last, DVec3::Z, Some(model)) };
        law.receive(&fresh);
        law.tick(last, &still());
        let out = (0..10).map(|_| law.tick(last, &still())).last().unwrap();
        assert!((out.limited.force_n.z - expected_n).abs() < 1e-9, "{age_s} s: {}", out.limited.force_n.z);
    }
}

#[test]
fn automatic_recovery_needs_half_a_second_without_a_gap() {
    let mut law = law(|config| config.servo.auto_recover = true);
    let last = up(&mut law);
    law.tick(last + 100 * MS, &still());
    let mut tick = 100;
    let mut feed = |law: &mut ServoLaw, ticks: u64, gap: u64| {
        for _ in 0..ticks {
            tick += 1;
            law.receive(&command(last + tick * MS, DVec3::Z, None));
            law.tick(last + tick * MS, &still());
        }
        tick += gap;
        law.tick(last + tick * MS, &still()).verdict.link
    };
    assert_eq!(feed(&mut law, 400, 10), Link::Latched(Fault::Stale));
    assert_eq!(feed(&mut law, 490, 0), Link::Latched(Fault::Stale), "the gap starts the half second again");
    assert_eq!(feed(&mut law, 30, 0), Link::Fresh);
}

#[test]
fn without_automatic_recovery_no_steadiness_brings_the_force_back() {
    let mut law = law(|_| {});
    let last = up(&mut law);
    for tick in 100..3000_u64 {
        law.receive(&command(last + tick * MS, DVec3::Z, None));
        let out = law.tick(last + (tick + 50) * MS, &still());
        assert_eq!(out.limited.force_n, DVec3::ZERO);
    }
    for tick in 3050..6000_u64 {
        law.receive(&command(last + tick * MS, DVec3::Z, None));
        let out = law.tick(last + tick * MS, &still());
        assert_eq!((out.limited.force_n, out.verdict.link), (DVec3::ZERO, Link::Latched(Fault::Stale)));
    }
}

/// A fault of the daemon while its commands go on: the force once came back in the very tick after the fault was latched, because
/// the commands had been steady for long.
#[test]
fn automatic_recovery_counts_from_the_fault() {
    let mut law = law(|config| config.servo.auto_recover = true);
    let last = up(&mut law);
    law.trip(last, Fault::Peer);
    let mut recovered_after_ms = None;
    for tick in 1..=700_u64 {
        law.receive(&command(last + tick * MS, DVec3::Z, None));
        let link = law.tick(last + tick * MS, &still()).verdict.link;
        if link == Link::Fresh && recovered_after_ms.is_none() {
            recovered_after_ms = Some(tick);
        }
    }
    // 12 ms of ramp, then half a second, then the next command.
    assert!((512..=515).contains(&recovered_after_ms.unwrap()), "{recovered_after_ms:?}");
}

/// Answers come all the time, and so nothing else takes this force away; a servo that stands still within a tick finds nothing late.
#[test]
fn a_force_that_was_taken_away_meanwhile_is_none_at_once_and_comes_back_slowly() {
    let mut law = law(|config| config.servo.auto_recover = true);
    let last = up(&mut law);
    law.latch(Fault::Stalled);
    let mut before_n = 0.0;
    for tick in 1..=1000_u64 {
        law.receive(&command(last + tick * MS, DVec3::Z, None));
        let out = law.tick(last + tick * MS, &still());
        let force_n = out.limited.force_n.z;
        if tick < 500 {
            assert_eq!((force_n, out.verdict.link), (0.0, Link::Latched(Fault::Stalled)), "{tick} ms");
        }
        assert!(force_n - before_n <= 1.0 / 200.0 + 1e-12, "{tick} ms: {before_n} N, {force_n} N");
        before_n = force_n;
    }
    assert!(before_n > 0.999, "{before_n} N");
}

/// An arm in a hand on a delayed daemon: the wall's force comes 8 ms late, which alone is unstable; the local model is not.
#[test]
fn the_local_model_is_stable_where_the_delayed_force_is_not() {
    let swing = |local: bool| {
        let mut law = law(|config| config.render.local_model = local);
        let spec = ArmSpec { hand_stiffness_n_per_m: 50.0, hand_damping_n_s_per_m: 0.5, ..ArmSpec::default() };
        let path = HandPath::resting_at(DVec3::new(0.0, 0.0, -0.002));
        let mut arm = SimulatedArm::new(spec, path, 1e-3).unwrap();
        let (delay, stiffness) = (8, 400.0);
        let mut seen_m = vec![arm.motion().position_m; delay];
        let mut range = (f64::INFINITY, f64::NEG_INFINITY);
        for tick in 1..=4000_usize {
            let then_m = seen_m[tick - 1];
            let wall_n = DVec3::Z * (-stiffness * then_m.z).max(0.0);
            let model = LocalModel {
                point_m: then_m,
                normal: DVec3::Z,
                force_n: wall_n,
                stiffness_n_per_m: DMat3::from_diagonal(DVec3::new(0.0, 0.0, -stiffness)),
                validity_radius_m: 0.02,
                max_force_n: 100.0,
            };
            law.receive(&command(tick as u64 * MS, wall_n, Some(model)));
            let out = law.tick(tick as u64 * MS, &arm.motion());
            seen_m.push(arm.step(out.limited.force_n).position_m);
            if tick > 3000 {
                range = (range.0.min(arm.motion().position_m.z), range.1.max(arm.motion().position_m.z));
            }
        }
        range.1 - range.0
    };
    let (delayed_m, local_m) = (swing(false), swing(true));
    assert!(delayed_m > 1e-3, "the delayed wall must rattle: {delayed_m} m");
    assert!(local_m < 1e-5, "the local model must settle: {local_m} m");
}

/// Every limit at once, over 10⁵ ticks of poses, models and forces without sense, gaps, jumps and NaN: peak, rate, ramp and warmth hold at each.
#[test]
fn a_hundred_thousand_random_poses_keep_the_force_within_every_limit() {
    const LIMITS: (f64, f64, f64, f64) = (3.3, 500.0, 0.88, 2.0);
    let (peak_n, rate_n_per_s, continuous_n, thermal_s) = LIMITS;
    for (passivity, strict) in [(false, false), (true, false), (true, true)] {
        let mut law = law(|config| {
            (config.limits.max_force_n, config.limits.max_force_rate_n_per_s) = (peak_n, rate_n_per_s);
            (config.limits.continuous_force_n, config.limits.thermal_time_s) = (Some(continuous_n), thermal_s);
            (config.servo.auto_recover, config.passivity.enabled, config.passivity.strict) = (true, passivity, strict);
            config.watchdog.ramp_up_s = 0.05;
        });
        let mut random = proptest::test_runner::TestRng::deterministic_rng(proptest::test_runner::RngAlgorithm::ChaCha);
        let mut unit = || f64::from(random.next_u32()) / f64::from(u32::MAX);
        // Now and then beyond all bounds, or no number at all; in calm seconds neither, so that faults are left again.
        let mut number = |scale: f64, calm: bool| {
            let x = scale * (2.0 * unit() - 1.0);
            match unit() {
                kind if calm || kind > 2e-3 => x,
                kind if kind > 1e-3 => x * 1e200,
                kind if kind > 5e-4 => f64::NAN,
                _ => f64::INFINITY,
            }
        };
        let (mut before_n, mut before_ramp, mut warmth_n2) = (DVec3::ZERO, 0.0, 0.0_f64);
        let (mut now_ns, mut largest_n, mut pressed, mut faults, mut share) = (MS, 0.0_f64, 0_u32, 0, 1.0_f64);
        for tick in 0..100_000_u64 {
            let calm = tick / 1000 % 2 == 0;
            now_ns += MS;
            let mut vector = |scale| DVec3::new(number(scale, calm), number(scale, calm), number(scale, calm));
            let motion = Motion { velocity_m_per_s: vector(1.0), ..Motion::at(vector(0.05)) };
            // Seconds of steady pressing warm the motors.
            let leaning_n = if tick / 3000 % 2 == 0 { DVec3::Z * 20.0 } else { DVec3::ZERO };
            let (force_n, point_m) = (vector(10.0) + leaning_n, vector(0.05));
            // The border lets only finite commands through.
            let is_lost = !calm && tick % 97 < 30;
            if !is_lost && force_n.is_finite() && point_m.is_finite() {
                let model = LocalModel {
                    point_m,
                    normal: DVec3::Z,
                    force_n,
                    stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(-2000.0)),
                    validity_radius_m: 0.05,
                    max_force_n: 100.0,
                };
                law.receive(&command(now_ns, force_n, (tick % 3 > 0).then_some(model)));
            }
            // A clutch is pressed for 200 ms now and then, and takes 20 ms either way.
            let clutched = tick % 2500 > 2200 && tick % 2500 < 2400;
            share = (share + if clutched { -0.05 } else { 0.05_f64 }).clamp(0.0, 1.0);
            law.share_force(share);
            let tick = law.tick(now_ns, &motion);
            let ramp = tick.verdict.ramp * share;
            let out_n = tick.limited.force_n;
            assert!(out_n.is_finite() && out_n.length() <= ramp * peak_n * (1.0 + 1e-12), "{tick:?}");
            let ramped_n = (ramp - before_ramp).abs() * peak_n;
            // What is no number takes the force away at once, and so may strict passivity; nothing gives any at once.
            let is_taken = tick.is_capped || tick.limited.non_finite;
            let step_n = if is_taken { out_n.length() - before_n.length() } else { (out_n - before_n).length() };
            // Beside the rate: the ramp, and what passes as the motors warm.
            let cooling_n = 2.0 * (peak_n - continuous_n) * (peak_n / continuous_n).powi(2) / thermal_s * 1e-3;
            assert!(step_n <= rate_n_per_s * 1e-3 + ramped_n + cooling_n + 1e-9, "{step_n} N: {tick:?}");
            warmth_n2 += (out_n.length_squared() - warmth_n2) * (1.0 - (-1e-3 / thermal_s).exp());
            assert!(warmth_n2 <= continuous_n.powi(2) * (1.0 + 1e-9), "{warmth_n2} N²");
            (before_n, before_ramp) = (out_n, ramp);
            largest_n = largest_n.max(out_n.length());
            pressed += u32::from(out_n.length() > 0.3);
            faults = law.latched();
        }
        // It can fail: there were forces at the limits, and faults that were left again.
        assert!(
            largest_n > 0.9 * continuous_n && pressed > 10_000 && faults > 20,
            "{largest_n} N, {pressed}, {faults}"
        );
    }
}

proptest! {
    /// Whatever the daemon sends and however the arm moves: finite, within the peak, zero once stale.
    #[test]
    fn any_input_gives_a_safe_force(
        ticks in prop::collection::vec(
            (0..30_u64, any::<[f64; 3]>(), any::<[f64; 3]>(), any::<[f64; 3]>(), any::<bool>()), 1..100),
    ) {
        let mut law = law(|config| config.passivity.enabled = true);
        let (mut now, mut last) = (0, None);
        for (gap, force, position, velocity, arrives) in ticks {
            now += gap * MS;
            if arrives {
                law.receive(&command(now, DVec3::from(force), None));
                last = Some(now);
            }
            let motion = Motion { velocity_m_per_s: DVec3::from(velocity), ..Motion::at(DVec3::from(position)) };
            let out = law.tick(now, &motion);
            prop_assert!(out.limited.force_n.is_finite());
            prop_assert!(out.limited.force_n.length() <= 3.3 * (1.0 + 1e-12));
            if last.is_none_or(|at| now - at >= 20 * MS) {
                prop_assert_eq!(out.limited.force_n, DVec3::ZERO);
            }
        }
    }
}
