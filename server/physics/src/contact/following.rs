//! How well a tool can follow its device, by its coupling and its size: what is told of a scene before a hand feels it.
use super::{
    ContactModel, Coupling, ToolModel,
    proxy::{NEAR, SMOOTHED_S},
};

/// What bounds how a tool follows its device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Following {
    /// A rigid tool is where its device is.
    Rigid {
        /// Speed (m/s) above which it moves by more than its radius in a substep. Beyond it may leap over a surface: samples
        /// press only while the tool's middle is still outside of them. How thick the wall is plays no part, for the far side
        /// of a wall is met from behind, where samples carry nothing.
        leaps_above_m_per_s: f64,
    },
    /// A tool on a spring.
    Coupled(CoupledFollowing),
}

/// The bounds of a tool on a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoupledFollowing {
    /// The largest force (N) that the coupling gives: spring and damper together.
    pub force_limit_n: f64,
    /// The largest stretch (m) of the spring that still adds force.
    pub stretch_limit_m: f64,
    /// In the air it gains no speed faster than this (m/s²).
    pub gains_m_per_s2: f64,
    /// A device that sets off no faster than this (m/s) does not bring the coupling to its limit.
    pub sets_off_m_per_s: f64,
    /// It comes back no faster than this (m/s) to a device that stands far away: its damper holds it against its spring.
    pub comes_back_m_per_s: f64,
    /// It never moves faster than this (m/s).
    pub moves_m_per_s: f64,
    /// It meets the surface no faster than this (m/s).
    pub meets_m_per_s: f64,
}

impl ContactModel {
    /// Returns how well a tool can follow its device in substeps of this length (s).
    pub fn following(&self, tool: usize, dt_s: f64) -> Following {
        self.tools[tool].following(dt_s)
    }
}

impl ToolModel {
    /// A mass `m` on a spring `K` and a damper `B`, both limited to `F_max` together, behind a device that sets off with
    /// `v`: while nothing is limited, the force on the mass is at most `v max(√(K m), min(B, m/τ))`. `√(K m)` is its peak
    /// without damping; with much, the mass follows the velocity that the damper has, which comes to `v` with the time
    /// constant `τ` ([`SMOOTHED_S`]). So a device may set off with `F_max` over that maximum, and `a = F_max/m`.
    fn following(&self, dt_s: f64) -> Following {
        let radius_m = self.spec.radius_m;
        let Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg } = self.spec.coupling else {
            return Following::Rigid { leaps_above_m_per_s: radius_m / dt_s };
        };
        let force_limit_n = self.force_limit_n;
        let moves_m_per_s = NEAR * radius_m / dt_s;
        let of_damper_n_s_per_m = damping_n_s_per_m.min(mass_kg / SMOOTHED_S);
        let unlimited_m_per_s = force_limit_n / (stiffness_n_per_m * mass_kg).sqrt().max(of_damper_n_s_per_m);
        Following::Coupled(CoupledFollowing {
            force_limit_n,
            stretch_limit_m: force_limit_n / stiffness_n_per_m,
            gains_m_per_s2: force_limit_n / mass_kg,
            sets_off_m_per_s: unlimited_m_per_s.min(moves_m_per_s),
            // F_max = B v; without damping nothing but the steps bounds it.
            comes_back_m_per_s: (force_limit_n / damping_n_s_per_m).min(moves_m_per_s),
            moves_m_per_s,
            meets_m_per_s: (2.0 * self.impact_energy_j / mass_kg).sqrt().min(moves_m_per_s),
        })
    }
}
