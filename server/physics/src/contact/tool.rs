//! Tools: their shape, how they follow their device, and what is reported of them.
use super::{axis::Axis, foundation::ContactBound, local_torque::LocalTorqueModel};
use glam::{DMat3, DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// How a tool follows its device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coupling {
    /// The tool is where the device is: kinematic (trajectories, known-answer tests). It moves in a straight line
    /// during the tick, and slips from its device before it would go through the surface ([`super::clutch`]).
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

/// What a tool looks like: all that is nearer than its radius to a point, or to a segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ToolShape {
    /// A ball. It is the same whichever way its device is turned, so it does not turn, and has no torque.
    Sphere,
    /// A cylinder with a hemisphere on either end, along its own z. It turns with its device.
    Capsule(Capsule),
}

/// The dimensions of a capsule beside its radius, and its rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// Distance (m) from its centre to the centre of a hemisphere, > 0.
    pub half_length_m: f64,
    /// Orientation of the device at the start, tool frame to world.
    pub start_orientation: DQuat,
    /// How it follows its device's orientation; not used for a rigid tool.
    pub turning: Turning,
}

/// The virtual coupling of orientation: `J ω̇ = τ_contact + K_r log(R_device Rᵀ) + B_r (ω_device − ω)`, with an inertia
/// that is the same about every axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turning {
    /// `K_r` (N m/rad).
    pub stiffness_nm_per_rad: f64,
    /// `B_r` (N m s/rad).
    pub damping_nm_s_per_rad: f64,
    /// `J` (kg m²).
    pub inertia_kg_m2: f64,
}

impl Turning {
    /// Returns the coupling of orientation that belongs to one of position: `K_r = r² K`, `B_r = r² B`, `J = r² m`,
    /// with the radius of gyration of a rod with the body of a ball, `r² = L²/3 + 2R²/5`. So a tool turns as fast as it
    /// moves, and with the same damping. For a rigid coupling all are zero.
    pub fn of(coupling: Coupling, radius_m: f64, half_length_m: f64) -> Self {
        let square = half_length_m * half_length_m / 3.0 + 0.4 * radius_m * radius_m;
        match coupling {
            Coupling::Rigid => Self { stiffness_nm_per_rad: 0.0, damping_nm_s_per_rad: 0.0, inertia_kg_m2: 0.0 },
            Coupling::Spring { stiffness_n_per_m, damping_n_s_per_m, mass_kg } => Self {
                stiffness_nm_per_rad: square * stiffness_n_per_m,
                damping_nm_s_per_rad: square * damping_n_s_per_m,
                inertia_kg_m2: square * mass_kg,
            },
        }
    }
}

impl ToolShape {
    /// Returns a capsule along a direction (world), with the [`Turning`] that belongs to its coupling.
    pub fn capsule(coupling: Coupling, radius_m: f64, half_length_m: f64, along: DVec3) -> Self {
        Self::Capsule(Capsule {
            half_length_m,
            start_orientation: DQuat::from_rotation_arc(DVec3::Z, along.normalize_or(DVec3::Z)),
            turning: Turning::of(coupling, radius_m, half_length_m),
        })
    }

    /// Returns the capsule, where it is one.
    pub fn as_capsule(&self) -> Option<&Capsule> {
        match self {
            Self::Sphere => None,
            Self::Capsule(capsule) => Some(capsule),
        }
    }

    /// Returns half the length (m) of its axis.
    pub fn half_length_m(&self) -> f64 {
        self.as_capsule().map_or(0.0, |capsule| capsule.half_length_m)
    }

    fn start_orientation(&self) -> DQuat {
        self.as_capsule().map_or(DQuat::IDENTITY, |capsule| capsule.start_orientation)
    }

    /// Returns the axis of a tool of this shape (m, world).
    pub(super) fn axis(&self, centre_m: DVec3, orientation: DQuat) -> Axis {
        match self {
            Self::Sphere => Axis::point(centre_m),
            Self::Capsule(capsule) => Axis { centre_m, half_m: orientation * (DVec3::Z * capsule.half_length_m) },
        }
    }
}

/// A tool.
#[derive(Debug, Clone, PartialEq)]
pub struct ToolSpec {
    /// Name, unique in a scene.
    pub name: String,
    /// Its shape.
    pub shape: ToolShape,
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
    /// Orientation, tool frame to world; spheres do not use it.
    pub orientation: DQuat,
    /// Angular velocity (rad/s, world).
    pub angular_velocity_rad_per_s: DVec3,
}

impl ToolTarget {
    /// Returns a target at rest, unrotated.
    pub fn at(position_m: DVec3) -> Self {
        Self { position_m, ..Self::default() }
    }

    /// Returns the same target, at rest.
    #[must_use]
    pub fn at_rest(self) -> Self {
        Self { velocity_m_per_s: DVec3::ZERO, angular_velocity_rad_per_s: DVec3::ZERO, ..self }
    }

    pub(crate) fn is_finite(&self) -> bool {
        // A quaternion that is not a rotation would shear the tool.
        [self.position_m, self.velocity_m_per_s, self.angular_velocity_rad_per_s].iter().all(|a| a.is_finite())
            && self.orientation.is_finite()
            && self.orientation.is_normalized()
    }
}

/// A tool's changing state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ToolState {
    /// Centre of the tool, the proxy (m).
    pub centre_m: DVec3,
    /// Its velocity (m/s), at the same time.
    pub velocity_m_per_s: DVec3,
    /// Its orientation, tool frame to world; a sphere is not rotated.
    pub orientation: DQuat,
    /// Its angular velocity (rad/s), at the same time; zero for a sphere.
    pub angular_velocity_rad_per_s: DVec3,
    /// Device pose and velocity at the end of the last tick.
    pub target: ToolTarget,
    /// The same at the end of the tick before: within a tick the device moves from there to `target`.
    pub previous_target: ToolTarget,
    /// How far (m) a rigid tool has slipped from its device; zero for a coupled one.
    pub slip_m: DVec3,
    /// Velocity of the device (m/s) as the coupling's damper has it: that of its path, smoothed.
    pub device_m_per_s: DVec3,
    /// Its angular velocity (rad/s) likewise.
    pub device_rad_per_s: DVec3,
    /// Force of the body on the tool (N), mean over the tick's substeps.
    pub contact_force_n: DVec3,
    /// Force on the device (N), mean over the tick's substeps: the coupling's, or the contact force of a rigid tool.
    pub device_force_n: DVec3,
    /// Torque of the body on the tool (N m, about its centre), mean over the tick's substeps; zero for a sphere.
    pub contact_torque_nm: DVec3,
    /// Torque on the device (N m, about the tool's centre), mean over the tick's substeps: the coupling's, or the
    /// contact's of a rigid tool; zero for a sphere.
    pub device_torque_nm: DVec3,
    /// Number of contact samples that carry force, at the end of the tick.
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
    /// Model of the torque, for a tool that turns.
    pub torque: Option<LocalTorqueModel>,
}

impl ToolState {
    /// Returns the state of a tool at its start, touching nothing.
    pub fn at_start(spec: &ToolSpec) -> Self {
        let target = spec.start();
        Self {
            centre_m: spec.start_position_m,
            velocity_m_per_s: DVec3::ZERO,
            orientation: target.orientation,
            angular_velocity_rad_per_s: DVec3::ZERO,
            target,
            previous_target: target,
            slip_m: DVec3::ZERO,
            device_m_per_s: DVec3::ZERO,
            device_rad_per_s: DVec3::ZERO,
            contact_force_n: DVec3::ZERO,
            device_force_n: DVec3::ZERO,
            contact_torque_nm: DVec3::ZERO,
            device_torque_nm: DVec3::ZERO,
            contacts: 0,
            penetration_m: 0.0,
            contact_energy_j: 0.0,
            friction_heat_j: 0.0,
            local_model: None,
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        let vectors = [
            self.centre_m,
            self.velocity_m_per_s,
            self.slip_m,
            self.angular_velocity_rad_per_s,
            self.device_m_per_s,
            self.device_rad_per_s,
            self.contact_force_n,
            self.device_force_n,
            self.contact_torque_nm,
            self.device_torque_nm,
        ];
        let model = self.local_model.is_none_or(|m| {
            [m.point_m, m.normal, m.force_n].iter().all(|a| a.is_finite())
                && m.stiffness_n_per_m.is_finite()
                && m.validity_radius_m.is_finite()
                && m.torque.is_none_or(|torque| torque.is_finite())
        });
        model
            && vectors.iter().all(|a| a.is_finite())
            && self.orientation.is_finite()
            && self.orientation.is_normalized()
            && [&self.target, &self.previous_target].iter().all(|t| t.is_finite())
            && [self.penetration_m, self.contact_energy_j, self.friction_heat_j].iter().all(|n| n.is_finite())
    }

    /// Ends its contact: it has no force and no speed.
    pub(crate) fn let_go(&mut self) {
        *self = Self {
            velocity_m_per_s: DVec3::ZERO,
            angular_velocity_rad_per_s: DVec3::ZERO,
            previous_target: self.target,
            device_m_per_s: DVec3::ZERO,
            device_rad_per_s: DVec3::ZERO,
            contact_force_n: DVec3::ZERO,
            device_force_n: DVec3::ZERO,
            contact_torque_nm: DVec3::ZERO,
            device_torque_nm: DVec3::ZERO,
            contacts: 0,
            penetration_m: 0.0,
            contact_energy_j: 0.0,
            local_model: None,
            ..*self
        };
    }
}

impl ToolSpec {
    /// Returns the target with which its device starts, at rest.
    pub fn start(&self) -> ToolTarget {
        ToolTarget { orientation: self.shape.start_orientation(), ..ToolTarget::at(self.start_position_m) }
    }

    /// Returns a bound (rad²/s²) of what the coupling, and contact of at most this stiffness on a tool that is a mass,
    /// add to the squared frequency.
    ///
    /// A capsule has a velocity and an angular velocity: contact at a point `p` from its centre moves it by
    /// `(−I, [p]ₓ)`, and a positive block matrix is bounded by the sum of its diagonal blocks, `Σ k a/m + Σ k a p²/J`.
    /// Each of the two couplings acts on one of them, so the larger one counts.
    pub(super) fn frequency_bound_sq(&self, contact: &ContactBound) -> f64 {
        match (self.coupling, &self.shape) {
            (Coupling::Rigid, _) => 0.0,
            (Coupling::Spring { stiffness_n_per_m, mass_kg, .. }, ToolShape::Sphere) => {
                (stiffness_n_per_m + contact.n_per_m) / mass_kg
            }
            (Coupling::Spring { stiffness_n_per_m, mass_kg, .. }, ToolShape::Capsule(capsule)) => {
                let Turning { stiffness_nm_per_rad, inertia_kg_m2, .. } = capsule.turning;
                let couplings = f64::max(stiffness_n_per_m / mass_kg, stiffness_nm_per_rad / inertia_kg_m2);
                couplings + contact.n_per_m / mass_kg + contact.nm_per_rad / inertia_kg_m2
            }
        }
    }
}
