//! The keys of a HapticMASTER.
use serde::{Deserialize, Serialize};

/// Who renders a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum HapticMasterContact {
    /// The bridge: its force goes to the arm as a bias force.
    Bias,
    /// The arm: it is told the plane of the contact, and the rest of the force is a bias force.
    Plane,
}

/// A HapticMASTER.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HapticMasterConfig {
    /// Host and port.
    pub address: String,
    /// Mass that the hand feels (kg).
    pub inertia_kg: f64,
    /// Who renders a contact: the bridge by a bias force, or the arm by a plane.
    pub contact: HapticMasterContact,
    /// The arm takes a plane's damping as a share of critical damping; false: in N s/m.
    pub damping_is_ratio: bool,
    /// Send `set` and `get` in requests of their own, for an arm that refuses them in one: half as many poses a second.
    pub apart: bool,
    /// How long finding home may take (s).
    pub homing_s: f64,
    /// Without an answer for so long (s) the arm is lost, and its force taken away.
    pub silence_s: f64,
}

impl Default for HapticMasterConfig {
    fn default() -> Self {
        Self {
            address: "192.168.0.25:7654".into(),
            inertia_kg: 2.0,
            contact: HapticMasterContact::Bias,
            damping_is_ratio: true,
            apart: false,
            homing_s: 60.0,
            silence_s: 0.02,
        }
    }
}
