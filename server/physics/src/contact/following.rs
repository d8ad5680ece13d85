//! How well a tool can follow its device, by its coupling and its size: what is told of a scene before a hand feels it.
use super::{ContactModel, Coupling, ToolModel, clutch::LEAP_M_PER_S, proxy::NEAR};

/// What bounds how a tool follows its device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Following {
    /// A rigid tool is where its device is, within these bounds.
    Rigid {
        /// It slips from its device where the surface bears more than this (N), at the latest.
        slips_at_n: f64,
        /// It never moves faster than this (m/s), so that it leaps over nothing.
        moves_m_per_s: f64,
    },
    /// A tool on a spring.
    Coupled(CoupledFollowing),
}

/// The bounds of a tool on a spring.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoupledFollowing {
    /// The largest force (N) that the coupling gives near the surface, and tells its device: spring and damper together.
    pub force_limit_n: f64,
    /// The largest stretch (m) of the spring that still adds force there.
    pub stretch_limit_m: f64,
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
    /// A tool moves by R/4 in a substep at most, and a mass `m` meets the surface with the energy that the flat foundation
    /// bears, `½ m v²` ([`super::proxy`]).
    fn following(&self, dt_s: f64) -> Following {
        let moves_m_per_s = NEAR * self.spec.radius_m / dt_s;
        match self.spec.coupling {
            Coupling::Rigid => {
                Following::Rigid { slips_at_n: self.slips_at_n, moves_m_per_s: moves_m_per_s.min(LEAP_M_PER_S) }
            }
            Coupling::Spring { stiffness_n_per_m, mass_kg, .. } => Following::Coupled(CoupledFollowing {
                force_limit_n: self.force_limit_n,
                stretch_limit_m: self.force_limit_n / stiffness_n_per_m,
                moves_m_per_s,
                meets_m_per_s: (2.0 * self.impact_energy_j / mass_kg).sqrt().min(moves_m_per_s),
            }),
        }
    }
}
