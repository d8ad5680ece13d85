//! Spherical tools against the deforming surface.
use crate::mesh::{Surface, TetMesh};
use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

/// How a tool follows its device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coupling {
    /// The tool is where the device is: a kinematic sphere (trajectories, known-answer tests).
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
    /// Its velocity (m/s).
    pub velocity_m_per_s: DVec3,
    /// Device position and velocity at the end of the last tick.
    pub target: ToolTarget,
    /// The same at the end of the tick before: within a tick the device moves from there to `target`.
    pub previous_target: ToolTarget,
    /// Force of the body on the tool (N), mean over the tick's substeps.
    pub contact_force_n: DVec3,
    /// Force on the device (N): the coupling's, or the contact force of a rigid tool.
    pub device_force_n: DVec3,
    /// Contact samples that carry force.
    pub contacts: u32,
    /// Deepest penetration of the tool into the surface (m).
    pub penetration_m: f64,
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
            local_model: None,
        }
    }
}

/// What contact needs that depends on the rest state alone.
#[derive(Debug, Clone, Default)]
pub struct ContactModel {
    /// Bound on the square of the natural frequency that contact adds (rad²/s²): λ_max(A + B) ≤ λ_max(A) + λ_max(B).
    pub frequency_bound_sq: f64,
}

/// Buffers of contact.
#[derive(Debug, Clone, Default)]
pub struct ContactScratch {}

impl ContactModel {
    /// Precomputes contact samples and the foundation stiffness. `p_wave_modulus_pa[triangle]` is that of the tet behind it.
    pub fn build(
        _mesh: &TetMesh,
        _surface: &Surface,
        _p_wave_modulus_pa: &[f64],
        _mass_kg: &[f64],
        _tools: &[ToolSpec],
    ) -> Self {
        Self::default()
    }

    /// Buffers large enough for every tick.
    pub fn scratch(&self) -> ContactScratch {
        ContactScratch {}
    }

    /// Once a tick: broad phase for every tool, from where it is towards its target, over `tick_period_s`.
    pub fn begin_tick(
        &self,
        _surface: &Surface,
        _x: &[DVec3],
        _v: &[DVec3],
        _tools: &mut [ToolState],
        _tick_period_s: f64,
        _scratch: &mut ContactScratch,
    ) {
    }

    /// Once a substep, after the body drifted: moves the tools over `dt_s` (`fraction` of the tick is then done), and adds
    /// contact forces (N) on nodes to `forces_n`.
    pub fn substep(
        &self,
        _surface: &Surface,
        _x: &[DVec3],
        _v: &[DVec3],
        _tools: &mut [ToolState],
        _fraction: f64,
        _dt_s: f64,
        _forces_n: &mut [DVec3],
        _scratch: &mut ContactScratch,
    ) {
    }

    /// Once a tick, at its end: means, penetration and local models.
    pub fn end_tick(&self, _tools: &mut [ToolState], _substeps: u32, _scratch: &mut ContactScratch) {}
}
