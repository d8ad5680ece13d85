//! The plane that the servo's law gives an arm which renders it by itself, tick by tick, without threads or real time.
use glam::{DMat3, DVec3};
use palpate_bridge::{
    Config,
    config::{DeviceConfig, HapticMasterConfig, HapticMasterContact},
    convert::Command,
    servo::{ServoLaw, ServoTick},
    settings::Settings,
};
use palpate_control::{
    ArmSpec, Fault, ForceLimits, HandPath, Keyframe, Link, LocalModel, Motion, SimulatedArm, TorqueLimits,
};
use proptest::prelude::*;

const MS: u64 = 1_000_000;

fn law(contact: HapticMasterContact, change: impl FnOnce(&mut Config)) -> ServoLaw {
    let mut config = Config {
        device: DeviceConfig::Hapticmaster(HapticMasterConfig { contact, ..HapticMasterConfig::default() }),
        ..Config::default()
    };
    config.passivity.enabled = false;
    config.watchdog.ramp_up_s = 0.0;
    config.limits.max_force_rate_n_per_s = 1e6;
    change(&mut config);
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    ServoLaw::new(runtime.block_on(async { Settings::new(&config).unwrap() }).servo)
}

fn by_plane(change: impl FnOnce(&mut Config)) -> ServoLaw {
    law(HapticMasterContact::Plane, change)
}

fn command(answers_ns: u64, local_model: Option<LocalModel>) -> Command {
    Command {
        answers_ns,
        tick: 0,
        force_n: DVec3::Z,
        local_model,
        local_torque: None,
        model_age_s: 0.0,
        limits: ForceLimits { max_force_n: 100.0, max_force_rate_n_per_s: 1e6 },
        torque: (DVec3::ZERO, TorqueLimits::NONE),
    }
}

/// 600 N/m, surface at z = 0.
fn wall() -> LocalModel {
    LocalModel {
        point_m: DVec3::ZERO,
        normal: DVec3::Z,
        force_n: DVec3::new(0.2, 0.0, 0.0),
        stiffness_n_per_m: DMat3::from_diagonal(DVec3::new(0.0, 0.0, -600.0)),
        validity_radius_m: 0.01,
        max_force_n: 100.0,
    }
}

fn pressed() -> Motion {
    Motion::at(DVec3::new(0.0, 0.0, -2e-3))
}

/// Ten ticks with this model and motion, all at once but fresh.
fn settled(law: &mut ServoLaw, model: Option<LocalModel>, motion: &Motion) -> ServoTick {
    law.receive(&command(MS, model));
    (0..10).map(|_| law.tick(MS, motion)).last().unwrap()
}

#[test]
fn the_plane_is_as_stiff_as_without_delay_and_the_bridges_own_force_is_not() {
    for (contact, expected_n) in [(HapticMasterContact::Bias, 0.4 / 30.5e-3 * 2e-3), (HapticMasterContact::Plane, 1.2)]
    {
        let mut law = law(contact, |_| ());
        (0..20_000).for_each(|_| law.pose_is(30e-3));
        let tick = settled(&mut law, Some(wall()), &pressed());
        assert!((tick.limited.force_n - DVec3::new(0.2, 0.0, expected_n)).length() < 1e-6, "{}", tick.limited.force_n);
        let stiffness = tick.plane.map(|plane| (plane.stiffness_n_per_m, plane.point_m.z.abs() < 1e-15));
        assert_eq!(stiffness, (contact == HapticMasterContact::Plane).then_some((600.0, true)));
    }
    // What is not passive at the servo's own period is not rendered by the arm either.
    let mut law = by_plane(|_| ());
    let stiff = LocalModel { stiffness_n_per_m: DMat3::from_diagonal(DVec3::Z * -5000.0), ..wall() };
    assert!((settled(&mut law, Some(stiff), &pressed()).plane.unwrap().stiffness_n_per_m - 800.0).abs() < 1e-9);
}

#[test]
fn a_share_of_the_force_is_a_share_of_the_plane_and_none_is_none() {
    let mut law = by_plane(|_| ());
    for share in [1.0, 0.5, 0.0] {
        law.share_force(share);
        let tick = settled(&mut law, Some(wall()), &pressed());
        assert!((tick.limited.force_n.z - 1.2 * share).abs() < 1e-9);
        let plane = tick.plane.map(|plane| (plane.stiffness_n_per_m, plane.max_force_n));
        assert_eq!(plane, (share > 0.0).then_some((600.0 * share, 3.3 * share)));
    }
}

#[test]
fn without_a_valid_contact_there_is_no_plane() {
    let mut law = by_plane(|_| ());
    assert!(settled(&mut law, Some(wall()), &pressed()).plane.is_some());
    assert!(settled(&mut law, None, &pressed()).plane.is_none(), "no contact");
    let outside = Motion::at(DVec3::new(0.0, 0.0, -0.011));
    let tick = settled(&mut law, Some(wall()), &outside);
    assert!(tick.plane.is_none() && tick.limited.force_n.z > 0.5, "outside its radius the force is all bias");
    let old = Command { model_age_s: 0.2, ..command(MS, Some(wall())) };
    law.receive(&old);
    assert!(law.tick(MS, &pressed()).plane.is_none(), "too old");
    assert!(settled(&mut law, Some(wall()), &pressed()).plane.is_some());
    let bad = Motion::at(DVec3::new(f64::NAN, 0.0, 0.0));
    assert!(law.tick(MS, &bad).plane.is_none(), "a place that is none");
    for tick in 2..40 {
        law.receive(&command(tick * MS, Some(wall())));
        law.tick(tick * MS, &pressed());
    }
    let out = law.tick(40 * MS, &pressed());
    assert_eq!((out.plane, out.verdict.link), (None, Link::Latched(Fault::NonFinite)));
}

#[test]
fn the_plane_ramps_down_with_a_daemon_that_is_silent() {
    let mut law = by_plane(|config| config.watchdog.fading_damping_n_s_per_m = 0.0);
    settled(&mut law, Some(wall()), &pressed());
    for age in 1..=25_u64 {
        let tick = law.tick((1 + age) * MS, &pressed());
        // The model fades from 20 ms on; the ramp is at its end then.
        let ramp = (1.0 - (age as f64 - 5.0).max(0.0) / 12.0).max(0.0);
        let stiffness = tick.plane.map_or(0.0, |plane| plane.stiffness_n_per_m);
        assert!((stiffness - 600.0 * ramp).abs() < 1e-6, "{age} ms: {stiffness}");
        assert_eq!(tick.plane.is_none(), ramp == 0.0);
    }
}

/// A hand presses 6 mm into a wall that its arm renders, and comes back; poses are 15 ms old and come every 15 ms.
#[test]
fn the_observer_takes_late_poses_for_no_energy_of_a_plane() {
    let mut law = by_plane(|config| {
        config.passivity.enabled = true;
        config.passivity.strict = true;
        config.limits.max_force_n = 10.0;
    });
    let keys = [(0.0, 2e-3), (0.1, 2e-3), (0.4, -6e-3), (0.7, -6e-3), (1.0, 2e-3)];
    let keys = keys.map(|(time_s, z)| Keyframe { time_s, position_m: DVec3::Z * z }).to_vec();
    let spec =
        ArmSpec { mass_kg: 2.0, damping_n_s_per_m: 8.0, hand_stiffness_n_per_m: 2000.0, hand_damping_n_s_per_m: 60.0 };
    let mut arm = SimulatedArm::new(spec, HandPath::new(keys, None).unwrap(), 1e-3).unwrap();
    let (mut seen, mut newest, mut given) = (arm.motion(), arm.motion(), None);
    let mut least_share = 1.0_f64;
    for tick in 1..1100 {
        law.receive(&command(tick * MS, Some(wall())));
        if tick % 15 == 0 {
            (seen, newest) = (newest, arm.motion());
        }
        let out = law.tick(tick * MS, &seen);
        if seen.position_m.z < -1e-3 {
            least_share = least_share.min(out.plane.map_or(0.0, |plane| plane.stiffness_n_per_m / 600.0));
        }
        given = out.plane.or(given.filter(|_| out.plane.is_some()));
        let n = given.map_or(0.0, |plane| plane.normal_force_n(arm.motion().position_m, DVec3::ZERO));
        arm.step(DVec3::Z * n);
    }
    assert!(least_share > 0.99, "{least_share}");
}

/// In strict passivity a force that nobody worked for is none, from a plane as from the bridge.
#[test]
fn a_plane_that_appears_around_a_resting_arm_does_not_push() {
    let mut law = by_plane(|config| (config.passivity.enabled, config.passivity.strict) = (true, true));
    for tick in 1..500 {
        law.receive(&command(tick * MS, Some(LocalModel { force_n: DVec3::ZERO, ..wall() })));
        let out = law.tick(tick * MS, &pressed());
        assert_eq!((out.plane, out.limited.force_n), (None, DVec3::ZERO));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
    /// Whatever moves: where the arm is the plane pushes no harder than the servo, and nowhere harder than the limit.
    #[test]
    fn the_plane_is_within_the_force_and_the_limit(
        steps in prop::collection::vec(((-8e-3..8e-3_f64, -8e-3..8e-3_f64), (-0.3..0.3_f64, 0.0..1.0_f64), -3000.0..0.0_f64), 1..60),
        continuous: bool,
    ) {
        let mut law = by_plane(|config| {
            config.passivity.enabled = true;
            config.render.damping_n_s_per_m = 0.1;
            config.limits.continuous_force_n = continuous.then_some(0.5);
            config.limits.thermal_time_s = 0.01;
            config.limits.max_force_rate_n_per_s = 300.0;
        });
        for (tick, ((x, z), (v, share), k)) in (1..).zip(steps) {
            let model = LocalModel { stiffness_n_per_m: DMat3::from_diagonal(DVec3::new(k * 0.3, 0.0, k)), ..wall() };
            law.share_force(share);
            law.receive(&command(tick * MS, Some(model)));
            let motion = Motion { velocity_m_per_s: DVec3::new(v, 0.0, -v), ..Motion::at(DVec3::new(x, 0.0, z)) };
            let out = law.tick(tick * MS, &motion);
            if let Some(plane) = out.plane {
                let pushed_n = plane.normal_force_n(motion.position_m, motion.velocity_m_per_s);
                prop_assert!(pushed_n <= out.limited.force_n.z.max(0.0) + 1e-9, "{} of {}", pushed_n, out.limited.force_n);
                prop_assert!(plane.max_force_n <= 3.3 * share + 1e-12 && plane.stiffness_n_per_m <= 800.0);
            }
        }
    }
}
