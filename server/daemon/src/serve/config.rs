//! Configuration of a daemon, parsed once.
use super::ServeError;
use crate::{
    doors::{bounds::Bounds, listen::UnixSocket, tls::TlsFiles},
    grpc::convert::MAX_WATCH_RATE_HZ,
    kept::{
        autosave::AutosaveSettings,
        folder::{Kept, Source},
    },
    sim::tool::ArmLimits,
    who::folder::Folder,
};
use palpate_control::{ForceLimits, TorqueLimits, WatchdogSettings};
use palpate_realtime::OsMeasures;
use std::{
    net::{Ipv4Addr, SocketAddr},
    path::PathBuf,
};

/// Configuration of a daemon.
#[derive(Debug, Clone, PartialEq)]
pub struct ServeConfig {
    /// Address and port; port 0 takes a free one; `None`: no TCP.
    pub listen: Option<SocketAddr>,
    /// Unix socket.
    pub unix: Option<UnixSocket>,
    /// Keys by which callers are known; without them whoever reaches the daemon may do everything.
    pub keys: Option<Folder>,
    /// Whoever reaches the daemon by a network is trusted.
    pub trusts_network: bool,
    /// What connections and requests have to keep to.
    pub bounds: Bounds,
    /// Names of this machine by which browsers may ask for the page, beside its own.
    pub host_names: Vec<String>,
    /// TLS on the port.
    pub tls: Option<TlsFiles>,
    /// Whether a simulated arm drives tools without a device.
    pub simulated_arm: bool,
    /// Limits of arms.
    pub limits: ArmLimits,
    /// Updates per second for viewers that ask for no rate (Hz).
    pub display_rate_hz: f64,
    /// Where the scene comes from; `None`: its session cannot be kept.
    pub source: Option<Source>,
    /// How sessions are kept, if they are.
    pub autosave: Option<AutosaveSettings>,
    /// The session that is taken up again.
    pub resume: Option<Kept>,
    /// Folders whose scene files viewers may load.
    pub scene_folders: Vec<PathBuf>,
    /// What the loop asks of the operating system.
    pub measures: OsMeasures,
}

/// Peak 8 N (a desktop arm's is 3 to 9 N), 2000 N/s, 0.5 N m, 100 N m/s, the watchdog's own times; what others inject, a quarter of the peak.
pub fn default_limits() -> ArmLimits {
    ArmLimits {
        force: ForceLimits { max_force_n: 8.0, max_force_rate_n_per_s: 2000.0 },
        torque: TorqueLimits { max_torque_nm: 0.5, max_torque_rate_nm_per_s: 100.0 },
        watchdog: WatchdogSettings::default(),
        max_injected_force_n: 2.0,
        hold_to_run: None,
    }
}

impl ServeConfig {
    /// A free port of this machine only, no real-time measures: for tests and benchmarks in one process.
    pub fn in_process() -> Self {
        Self {
            listen: Some(SocketAddr::from((Ipv4Addr::LOCALHOST, 0))),
            unix: None,
            keys: None,
            trusts_network: false,
            bounds: Bounds::default(),
            host_names: Vec::new(),
            tls: None,
            simulated_arm: true,
            limits: default_limits(),
            display_rate_hz: 60.0,
            source: None,
            autosave: None,
            resume: None,
            scene_folders: Vec::new(),
            measures: OsMeasures::NONE,
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`ServeError::Setting`].
    pub fn checked(self) -> Result<Self, ServeError> {
        let setting = |error: palpate_control::ParameterError| ServeError::Setting { reason: error.to_string() };
        self.limits.force.checked().map_err(setting)?;
        self.limits.torque.checked().map_err(setting)?;
        self.limits.watchdog.checked().map_err(setting)?;
        if !(1.0..=MAX_WATCH_RATE_HZ).contains(&self.display_rate_hz) {
            let rate = self.display_rate_hz;
            return Err(ServeError::Setting {
                reason: format!("display_rate_hz = {rate} must be 1 to {MAX_WATCH_RATE_HZ}"),
            });
        }
        if !(self.limits.max_injected_force_n.is_finite() && self.limits.max_injected_force_n >= 0.0) {
            let force = self.limits.max_injected_force_n;
            let reason = format!("max_injected_force_n = {force} must be finite and not negative");
            return Err(ServeError::Setting { reason });
        }
        if self.listen.is_none() && self.unix.is_none() {
            let reason = "nobody could connect: give --unix PATH beside --listen none".to_owned();
            return Err(ServeError::Setting { reason });
        }
        match self.listen {
            Some(address) if !address.ip().is_loopback() && self.keys.is_none() && !self.trusts_network => {
                Err(ServeError::Untrusted { address })
            }
            _ => Ok(self),
        }
    }
}
