//! The torque of the servo's law, tick by tick.

use crate::bench::{MS, command, law, still};
use glam::{DMat3, DQuat, DVec3};
use palpate_bridge::convert::Command;
use palpate_control::{LocalTorque, Motion, TorqueLimits};

/// As long as the link is alive, at the stricter of both limits, and down with the force; none on an arm that has no motors for it.
#[test]
fn torque_is_limited_and_ramped_as_force_is() {
    let theirs = TorqueLimits { max_torque_nm: 0.05, max_torque_rate_nm_per_s: 1e3 };
    let fed = |own_nm: f64| {
        let mut law = law(|config| config.limits.max_torque_nm = own_nm);
        for tick in 1..=500 {
            law.receive(&Command { torque: (DVec3::Y, theirs), ..command(tick * MS, DVec3::Z, None) });
            law.tick(tick * MS, &still());
        }
        law
    };
    let mut strong = fed(0.2);
    let mut at = |age: u64| strong.tick((500 + age) * MS, &still());
    assert!((at(0).torque_nm - DVec3::Y * 0.05).length() < 1e-12);
    let ramping = at(12);
    assert!(
        (ramping.torque_nm.y - 0.05 * ramping.verdict.ramp).abs() < 1e-12 && ramping.verdict.ramp < 1.0,
        "{ramping:?}"
    );
    assert_eq!(at(40).torque_nm, DVec3::ZERO);
    assert!((fed(0.01).tick(500 * MS, &still()).torque_nm.y - 0.01).abs() < 1e-12);
    assert_eq!(fed(0.0).tick(500 * MS, &still()).torque_nm, DVec3::ZERO);
}

/// 0.1 N m/rad about y around an orientation.
fn torsion(orientation: DQuat) -> LocalTorque {
    LocalTorque {
        orientation,
        torque_nm: DVec3::ZERO,
        stiffness_nm_per_rad: DMat3::from_diagonal(DVec3::Y * -0.1),
        validity_angle_rad: 0.2,
        max_torque_nm: 1.0,
    }
}

#[test]
fn a_local_torque_follows_the_arm_between_commands() {
    let mut law = law(|config| config.limits.max_torque_nm = 0.2);
    let theirs = TorqueLimits { max_torque_nm: 0.05, max_torque_rate_nm_per_s: 1e3 };
    let start = DQuat::from_rotation_z(0.7);
    let told = |now: u64| Command {
        torque: (DVec3::X, theirs),
        local_torque: Some(torsion(start)),
        ..command(now, DVec3::Z, None)
    };
    let turned = |rad: f64| Motion { orientation: DQuat::from_rotation_y(rad) * start, ..still() };
    for tick in 1..=500 {
        law.receive(&told(tick * MS));
        assert!(law.tick(tick * MS, &turned(0.0)).torque_nm.length() < 1e-12, "the model's, and not the daemon's");
    }
    for age in 1..=5 {
        let rad = 0.02 * age as f64;
        let torque_nm = law.tick((500 + age) * MS, &turned(rad)).torque_nm;
        assert!(torque_nm.distance(DVec3::Y * -0.1 * rad) < 1e-9, "{age} ms: {torque_nm}");
    }
    law.receive(&told(506 * MS));
    assert!(law.tick(506 * MS, &turned(-1.0)).torque_nm.length() < 1e-12, "far outside its angle");
}

/// As for force: a spring of 0.1 N m/rad whose torque comes 8 ms late swings up a handle of 4e-5 kg m² in a hand of 0.02 N m/rad; beside the arm it does not.
#[test]
fn the_local_torque_is_stable_where_the_delayed_torque_is_not() {
    let swing = |local: bool| {
        let mut law = law(|config| {
            config.render.local_model = local;
            config.limits.max_torque_nm = 0.5;
        });
        let (delay, dt_s) = (8, 1e-3);
        let theirs = TorqueLimits { max_torque_nm: 0.5, max_torque_rate_nm_per_s: 1e4 };
        let (inertia_kg_m2, hand_nm_per_rad, damping_nm_s_per_rad) = (4e-5, 0.02, 4e-4);
        let (mut rad, mut rad_per_s) = (0.05_f64, 0.0_f64);
        let mut seen = vec![rad; delay];
        let mut largest = 0.0_f64;
        for tick in 1..=3000_usize {
            let then = seen[tick - 1];
            law.receive(&Command {
                torque: (DVec3::Y * (-0.1 * then), theirs),
                local_torque: Some(LocalTorque {
                    torque_nm: DVec3::Y * (-0.1 * then),
                    ..torsion(DQuat::from_rotation_y(then))
                }),
                ..command(tick as u64 * MS, DVec3::ZERO, None)
            });
            let motion = Motion {
                orientation: DQuat::from_rotation_y(rad),
                angular_velocity_rad_per_s: DVec3::Y * rad_per_s,
                ..still()
            };
            let torque_nm = law.tick(tick as u64 * MS, &motion).torque_nm.y;
            let all_nm = torque_nm - hand_nm_per_rad * rad - damping_nm_s_per_rad * rad_per_s;
            rad_per_s += dt_s * all_nm / inertia_kg_m2;
            rad += dt_s * rad_per_s;
            seen.push(rad);
            if tick > 2000 {
                largest = largest.max(rad.abs());
            }
        }
        largest
    };
    let (local, delayed) = (swing(true), swing(false));
    println!("swing {local} rad, delayed {delayed} rad");
    assert!(local < 1e-4 && delayed > 0.05, "{local} rad, delayed {delayed} rad");
}
