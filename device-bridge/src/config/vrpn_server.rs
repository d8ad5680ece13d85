//! `[vrpn_server]`: whether VRPN programs can read this arm, whatever its kind.
use serde::{Deserialize, Serialize};

/// A VRPN server in the bridge; off unless it is told where to listen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VrpnServerConfig {
    /// Address and port to listen at; absent: no server.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub listen: Option<String>,
    /// What VRPN programs call the arm: `NAME@host`.
    pub name: String,
    /// Poses a second (Hz), as near as a whole number of the servo's ticks comes; absent: the servo's rate.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate_hz: Option<f64>,
    /// Most programs at once; others are turned away.
    pub max_clients: usize,
}

impl Default for VrpnServerConfig {
    fn default() -> Self {
        Self { listen: None, name: "Palpate0".into(), rate_hz: None, max_clients: 8 }
    }
}
