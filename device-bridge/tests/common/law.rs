//! The servo's law by itself, and what a daemon says to it.
use glam::DVec3;
use palpate_bridge::{Config, convert::Command, servo::ServoLaw, settings::Settings};
use palpate_control::{ForceLimits, LocalModel, Motion, TorqueLimits};

pub(crate) const MS: u64 = 1_000_000;

/// `Settings` opens an endpoint, which needs a runtime's context.
pub(crate) fn law(change: impl FnOnce(&mut Config)) -> ServoLaw {
    let mut config = Config::default();
    config.passivity.enabled = false;
    change(&mut config);
    let runtime = tokio::runtime::Builder::new_current_thread().build().unwrap();
    ServoLaw::new(runtime.block_on(async { Settings::new(&config).unwrap() }).servo)
}

pub(crate) fn command(answers_ns: u64, force_n: DVec3, local_model: Option<LocalModel>) -> Command {
    Command {
        answers_ns,
        tick: 0,
        force_n,
        local_model,
        local_torque: None,
        model_age_s: 0.0,
        limits: ForceLimits { max_force_n: 100.0, max_force_rate_n_per_s: 1e6 },
        torque: (DVec3::ZERO, TorqueLimits::NONE),
    }
}

pub(crate) fn still() -> Motion {
    Motion::at(DVec3::ZERO)
}
