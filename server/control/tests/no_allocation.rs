//! A tick of the control law touches no heap.
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use glam::{DMat3, DVec3};
use palpate_control::{
    ArmSpec, ForceLimiter, ForceLimits, HandPath, Keyframe, LocalModel, PassivityController, PassivitySettings,
    RenderSettings, SimulatedArm, Velocity, Watchdog, WatchdogSettings, extrapolate,
};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

#[test]
fn a_tick_of_everything_allocates_nothing() {
    let key = |time_s, z| Keyframe { time_s, position_m: DVec3::new(0.0, 0.0, z) };
    let path = HandPath::new(vec![key(0.0, 0.01), key(0.05, -0.005)], Some(0.1)).unwrap();
    let mut arm = SimulatedArm::new(ArmSpec::default(), path, 1e-3).unwrap();
    let mut limiter = ForceLimiter::new(ForceLimits { max_force_n: 3.0, max_force_rate_n_per_s: 1000.0 });
    let mut passivity = PassivityController::new(PassivitySettings::default());
    let mut watchdog = Watchdog::new(WatchdogSettings::default());
    let settings = RenderSettings { hold_s: 0.1, forget_s: 0.2, damping_n_s_per_m: 0.1, max_stiffness_n_per_m: 800.0 };
    let model = LocalModel {
        point_m: DVec3::ZERO,
        normal: DVec3::Z,
        force_n: DVec3::ZERO,
        stiffness_n_per_m: DMat3::from_diagonal(DVec3::splat(-500.0)),
        validity_radius_m: 0.02,
        max_force_n: 100.0,
    };
    let mut velocity = Velocity::new(1e-5, 1e-3);
    let mut peak_n: f64 = 0.0;
    assert_no_alloc(|| {
        for tick in 0..1000_u64 {
            let now_ns = tick * 1_000_000;
            if tick < 900 {
                watchdog.sample_arrived(now_ns);
            }
            let verdict = watchdog.check(now_ns);
            let motion = extrapolate(&arm.motion(), verdict.extrapolate_s, 5e-3);
            let wanted = model.render(motion.position_m, motion.velocity_m_per_s, verdict.age_s, &settings);
            let step = passivity.step(wanted.force_n, motion.position_m, motion.velocity_m_per_s, 1e-3);
            let limited = limiter.limit(step.force_n, verdict.ramp, 1e-3);
            passivity.held(limited.force_n);
            arm.step(limited.force_n);
            velocity.push(arm.motion().position_m.z, 1e-3);
            peak_n = peak_n.max(limited.force_n.length());
        }
    });
    assert!(peak_n > 0.3, "the loop rendered nothing: {peak_n} N");
}
