//! The servo's law: its limits, times and gains.
use super::{arm, parameter, stiffness::bound, torque, value};
use crate::{BridgeError, Config};
use palpate_control::{
    ForceLimits, PassivitySettings, RenderSettings, StiffnessBound, ThermalLimits, TorqueLimits, WatchdogSettings,
};

/// The servo's law.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ServoSettings {
    /// Period (s).
    pub period_s: f64,
    /// Peak and rate.
    pub limits: ForceLimits,
    /// Of torque.
    pub torque: TorqueLimits,
    /// What the motors bear for ever; `None`: the peak.
    pub thermal: Option<ThermalLimits>,
    /// Ages.
    pub watchdog: WatchdogSettings,
    /// Damping (N s/m) that replaces a fading force.
    pub fading_damping_n_s_per_m: f64,
    /// Local models; `None`: the daemon's force as it comes.
    pub render: Option<RenderSettings>,
    /// The arm renders the contact's plane by itself.
    pub plane: bool,
    /// How stiff a local model may be rendered, or, without, the daemon's coupling be.
    pub stiffness: StiffnessBound,
    /// That was asked for (N/m).
    pub asked_stiffness_n_per_m: Option<f64>,
    /// Share of ticks with an answer in time; with fewer the force is taken away.
    pub least_success_rate: f64,
    /// Energy; `None`: off.
    pub passivity: Option<PassivitySettings>,
    /// Recover from latched faults without being asked.
    pub auto_recover: bool,
}

/// What is said of the arm (its damping, its mass) counts for the world, whose movements are `scale` times the arm's: see [`Workspace`].
pub(super) fn checked(config: &Config, period_s: f64, scale: f64) -> Result<ServoSettings, BridgeError> {
    let limits = &config.limits;
    let (watchdog, passivity) = (&config.watchdog, &config.passivity);
    let fading = watchdog.fading_damping_n_s_per_m;
    if !(fading.is_finite() && fading >= 0.0) {
        return Err(value("watchdog.fading_damping_n_s_per_m", format!("{fading} must be finite and not negative")));
    }
    let passivity_settings = PassivitySettings {
        max_damping_n_s_per_m: passivity.max_damping_n_s_per_m / scale,
        max_stored_j: passivity.max_stored_j * scale,
        arm_mass_kg: passivity.arm_mass_kg / scale,
        strict: passivity.strict,
    }
    .checked()
    .map_err(|error| parameter("passivity", &error))?;
    let thermal = |continuous_force_n| {
        let (max_force_n, time_s) = (limits.max_force_n, limits.thermal_time_s);
        ThermalLimits { continuous_force_n, max_force_n, time_s }.checked()
    };
    let least_success_rate = config.servo.least_success_rate;
    if !(0.0..=1.0).contains(&least_success_rate) {
        return Err(value("servo.least_success_rate", format!("{least_success_rate} is no share: use 0 to 1")));
    }
    let stiffness = bound(config, period_s, scale)?;
    Ok(ServoSettings {
        period_s,
        stiffness,
        asked_stiffness_n_per_m: config.render.max_stiffness_n_per_m,
        plane: arm::renders_planes(&config.device),
        least_success_rate,
        thermal: limits.continuous_force_n.map(thermal).transpose().map_err(|error| parameter("limits", &error))?,
        limits: ForceLimits { max_force_n: limits.max_force_n, max_force_rate_n_per_s: limits.max_force_rate_n_per_s }
            .checked()
            .map_err(|error| parameter("limits", &error))?,
        torque: torque::limits(config)?,
        watchdog: WatchdogSettings {
            fresh_for_s: watchdog.fresh_for_s,
            stale_after_s: watchdog.stale_after_s,
            ramp_to_zero_s: watchdog.ramp_to_zero_s,
            ramp_up_s: watchdog.ramp_up_s,
        }
        .checked()
        .map_err(|error| parameter("watchdog", &error))?,
        fading_damping_n_s_per_m: fading / scale,
        render: render(config, scale, &stiffness)?,
        passivity: passivity.enabled.then_some(passivity_settings),
        auto_recover: config.servo.auto_recover,
    })
}

fn render(config: &Config, scale: f64, stiffness: &StiffnessBound) -> Result<Option<RenderSettings>, BridgeError> {
    let render = &config.render;
    let settings = RenderSettings {
        hold_s: render.hold_s,
        forget_s: render.forget_s,
        damping_n_s_per_m: render.damping_n_s_per_m / scale,
        max_stiffness_n_per_m: stiffness.largest_n_per_m(),
    }
    .checked()
    .map_err(|error| parameter("render", &error))?;
    Ok(render.local_model.then_some(settings))
}
