//! What a tool is, how it follows its device, and what is reported of it.
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// How a tool follows its device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coupling {
    /// The tool is where the device is: a kinematic sphere (trajectories, known-answer tests). It moves in a straight line
    /// during the tick; nothing keeps it outside if it is driven further than its radius in one substep.
    Rigid,
    /// The tool is a mass on a spring and damper to the device (virtual coupling): the proxy stays outside the body
    /// while the device may be inside.
    Spring {
        /// Stiffness (N/m).
        stiffness_n_per_m: f64,
        /// Damping (N s/m).
        damping_n_s_per_m: f64,
        /// Mass of the tool (kg).
        mass_kg: f64,
    },
}

/// A spherical tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolSpec {
    /// Name, unique in a scene.
    pub name: String,
    /// Radius (m).
    pub radius_m: f64,
    /// How it follows its device.
    pub coupling: Coupling,
    /// Coulomb's friction coefficient, ≥ 0.
    pub friction_coefficient: f64,
    /// Where the device starts (m, world).
    pub start_position_m: DVec3,
}

/// Where a device wants its tool at the end of the tick.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct ToolTarget {
    /// Position (m, world).
    pub position_m: DVec3,
    /// Velocity (m/s, world).
    pub velocity_m_per_s: DVec3,
}

/// A tool's changing state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolState {
    /// Centre of the tool, the proxy (m).
    pub centre_m: DVec3,
    /// Its velocity (m/s), at the same time.
    pub velocity_m_per_s: DVec3,
    /// Device position and velocity at the end of the last tick.
    pub target: ToolTarget,
    /// The same at the end of the tick before: within a tick the device moves from there to `target`.
    pub previous_target: ToolTarget,
    /// Force of the body on the tool (N), mean over the tick's substeps.
    pub contact_force_n: DVec3,
    /// Force on the device (N), mean over the tick's substeps: the coupling's, or the contact force of a rigid tool.
    pub device_force_n: DVec3,
    /// Contact samples that carry force, at the end of the tick.
    pub contacts: u32,
    /// Deepest penetration of the tool into the surface during the tick (m), whether it carries force or not.
    pub penetration_m: f64,
    /// Energy stored in the contact's foundation at the end of the tick (J).
    pub contact_energy_j: f64,
    /// Heat of friction since reset (J).
    pub friction_heat_j: f64,
    /// Linear model of the contact about the device position; `None` out of contact.
    pub local_model: Option<LocalContactModel>,
}

/// Force on the device near `point_m`: `F(p) = force_n + stiffness (p − point_m)`, never pulling.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct LocalContactModel {
    /// Device position about which it is expanded (m).
    pub point_m: DVec3,
    /// Outward unit normal of the contact.
    pub normal: DVec3,
    /// Force on the device at `point_m` (N).
    pub force_n: DVec3,
    /// `∂F/∂p` (N/m), symmetric.
    pub stiffness_n_per_m: DMat3,
    /// Radius inside which it may be used (m).
    pub validity_radius_m: f64,
}

impl ToolState {
    /// At its start, touching nothing.
    pub fn at_start(spec: &ToolSpec) -> Self {
        Self {
            centre_m: spec.start_position_m,
            velocity_m_per_s: DVec3::ZERO,
            target: ToolTarget { position_m: spec.start_position_m, velocity_m_per_s: DVec3::ZERO },
            previous_target: ToolTarget { position_m: spec.start_position_m, velocity_m_per_s: DVec3::ZERO },
            contact_force_n: DVec3::ZERO,
            device_force_n: DVec3::ZERO,
            contacts: 0,
            penetration_m: 0.0,
            contact_energy_j: 0.0,
            friction_heat_j: 0.0,
            local_model: None,
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        let targets = [&self.target, &self.previous_target];
        let vectors = [self.centre_m, self.velocity_m_per_s, self.contact_force_n, self.device_force_n];
        let model = self.local_model.is_none_or(|m| {
            [m.point_m, m.normal, m.force_n].iter().all(|a| a.is_finite())
                && m.stiffness_n_per_m.is_finite()
                && m.validity_radius_m.is_finite()
        });
        model
            && vectors.iter().all(|a| a.is_finite())
            && targets.iter().all(|t| t.position_m.is_finite() && t.velocity_m_per_s.is_finite())
            && [self.penetration_m, self.contact_energy_j, self.friction_heat_j].iter().all(|n| n.is_finite())
    }

    /// Ends its contact: no force, no speed.
    pub(crate) fn let_go(&mut self) {
        let (target, friction_heat_j) = (self.target, self.friction_heat_j);
        *self = Self {
            centre_m: self.centre_m,
            velocity_m_per_s: DVec3::ZERO,
            target,
            previous_target: target,
            friction_heat_j,
            contact_force_n: DVec3::ZERO,
            device_force_n: DVec3::ZERO,
            contacts: 0,
            penetration_m: 0.0,
            contact_energy_j: 0.0,
            local_model: None,
        };
    }
}

impl Coupling {
    /// What the coupling, and contact of total stiffness `contact_n_per_m` on a tool that is a mass, add (rad²/s²).
    pub(super) fn frequency_bound_sq(self, contact_n_per_m: f64) -> f64 {
        match self {
            Self::Rigid => 0.0,
            Self::Spring { stiffness_n_per_m, mass_kg, .. } => (stiffness_n_per_m + contact_n_per_m) / mass_kg,
        }
    }
}
