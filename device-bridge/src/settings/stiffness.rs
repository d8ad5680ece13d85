//! How stiff a contact may be on this arm: what its damping allows at the servo's rate, what is asked for, and what it is made for.
use super::{Settings, parameter, value};
use crate::{BridgeError, Config};
use palpate_control::{StiffnessBound, coupling::SampledWall};

/// The stiffest contact that the servo's own sampling allows on this arm, or that is asked for.
pub(super) fn bound(config: &Config, period_s: f64, scale: f64) -> Result<StiffnessBound, BridgeError> {
    let render = &config.render;
    let wall = SampledWall {
        arm_damping_n_s_per_m: render.arm_damping_n_s_per_m / scale,
        wall_damping_n_s_per_m: render.damping_n_s_per_m / scale,
        sample_time_s: period_s,
        delay_s: 0.0,
    };
    let passive_n_per_m = wall.passive_stiffness_limit_n_per_m().map_err(|error| parameter("render", &error))?;
    if passive_n_per_m <= 0.0 {
        let reason = "must be smaller than arm_damping_n_s_per_m, or no stiffness is passive".to_owned();
        return Err(value("render.damping_n_s_per_m", reason));
    }
    let asked_n_per_m = render.max_stiffness_n_per_m.unwrap_or(passive_n_per_m);
    if !(asked_n_per_m > 0.0 && asked_n_per_m <= passive_n_per_m) {
        let (b, rate_hz) = (render.arm_damping_n_s_per_m, config.servo.rate_hz);
        let reason = format!(
            "{asked_n_per_m} N/m is not between 0 and the {passive_n_per_m:.0} N/m that are passive on an arm of {b} N s/m at {rate_hz} Hz \
             (2 (b - B)/T): leave it out, or give the arm's damping in render.arm_damping_n_s_per_m if it has more"
        );
        return Err(value("render.max_stiffness_n_per_m", reason));
    }
    StiffnessBound::new(wall, asked_n_per_m).map_err(|error| parameter("render", &error))
}

impl Settings {
    /// For an arm that is made for walls of `stiffest_n_per_m` (of the world) at most, which it says when it is open.
    ///
    /// # Errors
    /// [`BridgeError::Value`] when stiffer ones are asked for.
    pub fn demand_bearable(&self, stiffest_n_per_m: Option<f64>) -> Result<(), BridgeError> {
        let too_stiff = stiffest_n_per_m.zip(self.servo.asked_stiffness_n_per_m).filter(|(most, asked)| asked > most);
        let Some((stiffest_n_per_m, asked_n_per_m)) = too_stiff else { return Ok(()) };
        let reason = format!(
            "{asked_n_per_m} N/m is more than the {stiffest_n_per_m:.0} N/m of the stiffest wall that this arm is made for: leave it out"
        );
        Err(value("render.max_stiffness_n_per_m", reason))
    }

    /// For the same arm, no stiffer than it is made for.
    #[must_use]
    pub fn bearable(mut self, stiffest_n_per_m: Option<f64>) -> Self {
        let Some(stiffest_n_per_m) = stiffest_n_per_m else { return self };
        let servo = &mut self.servo;
        let passive_n_per_m = servo.stiffness.without_delay_n_per_m();
        if passive_n_per_m > stiffest_n_per_m {
            tracing::info!(
                "contacts are rendered no stiffer than {stiffest_n_per_m:.0} N/m, what this arm is made for (its damping and rate would allow {passive_n_per_m:.0})"
            );
        }
        servo.stiffness = servo.stiffness.within(stiffest_n_per_m);
        if let Some(render) = &mut servo.render {
            render.max_stiffness_n_per_m = servo.stiffness.largest_n_per_m();
        }
        self.uplink.across_network = self.uplink.across_network.map(|bound| bound.within(stiffest_n_per_m));
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arm_is_given_no_stiffer_walls_than_it_is_made_for() {
        let mut config = Config::default();
        let bearable = |config: &Config, stiffest| {
            let settings = Settings::new(config).unwrap().bearable(stiffest);
            let across = settings.uplink.across_network.map(|bound| bound.largest_n_per_m());
            let rendered = settings.servo.render.map(|render| render.max_stiffness_n_per_m);
            assert_eq!(across.or(rendered), Some(settings.servo.stiffness.largest_n_per_m()));
            settings.servo.stiffness.largest_n_per_m()
        };
        for local_model in [true, false] {
            config.render.local_model = local_model;
            for (stiffest, expected) in [(None, 800.0), (Some(900.0), 800.0), (Some(500.0), 500.0)] {
                assert!((bearable(&config, stiffest) - expected).abs() < 1e-9, "{stiffest:?}");
            }
        }
        config.render.max_stiffness_n_per_m = Some(500.0);
        assert!((bearable(&config, Some(500.0)) - 500.0).abs() < 1e-9);
        let demand = |stiffest| Settings::new(&config).unwrap().demand_bearable(stiffest);
        assert!([None, Some(500.0)].map(demand).iter().all(Result::is_ok));
        let refused = demand(Some(499.0)).unwrap_err().to_string();
        assert!(refused.starts_with("render.max_stiffness_n_per_m: 500 N/m is more than the 499 N/m"), "{refused}");
    }
}
