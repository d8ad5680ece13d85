//! The control law between an arm and a body. Pure: no clock, no thread, no file, no network; time comes in as an argument.
//!
//! Nothing here allocates after construction, except where a constructor says so. Every function that takes a measured or
//! received number is safe against NaN and infinity: it answers zero force, and counts.
//!
//! Sign convention: forces act **on the arm** (N, world); the power an arm puts into the virtual world is `−F·v`.
pub mod contact_plane;
pub mod coupling;
pub mod energy;
pub mod extrapolate;
pub mod gain;
pub mod limits;
pub mod link_quality;
pub mod local_model;
pub mod local_torque;
pub mod parameter;
pub mod passivity;
pub mod phase;
pub mod simulated_arm;
pub mod thermal;
pub mod torque;
pub mod velocity;
pub mod watchdog;

pub use contact_plane::ContactPlane;
pub use coupling::VirtualCoupling;
pub use energy::EnergyMeter;
pub use extrapolate::{Motion, extrapolate, turn_rad};
pub use gain::StiffnessBound;
pub use limits::{ForceLimiter, ForceLimits, Limited};
pub use link_quality::SuccessRate;
pub use local_model::{LocalModel, RenderSettings, Rendered};
pub use local_torque::LocalTorque;
pub use parameter::ParameterError;
pub use passivity::{PassivityController, PassivitySettings, PassivityStep};
pub use phase::{PhaseLock, Wait};
pub use simulated_arm::{ArmSpec, HandPath, Keyframe, SimulatedArm};
pub use thermal::{ThermalLimiter, ThermalLimits};
pub use torque::{TorqueLaw, TorqueLimiter, TorqueLimits};
pub use velocity::Velocity;
pub use watchdog::{Fault, Link, Verdict, Watchdog, WatchdogSettings};
