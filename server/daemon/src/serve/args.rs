//! Flags of `palpated serve`.
use super::config::{ServeConfig, default_limits};
use crate::{
    doors::{bounds::Bounds, listen::UnixSocket, tls::TlsFiles},
    kept::{autosave::AutosaveSettings, folder::KeptFolder},
    who::folder::Folder,
};
use clap::ValueEnum;
use palpate_realtime::OsMeasures;
use std::{
    net::{SocketAddr, ToSocketAddrs as _},
    path::PathBuf,
    time::Duration,
};

/// What moves the tool while no device is attached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Arm {
    /// A simulated arm, whose hand follows the scene's path and yields to force
    Simulated,
    /// Nothing: the tool rests where it is
    None,
}

/// Flags of `palpated serve`.
#[derive(Debug, Clone, clap::Args)]
pub struct ServeArgs {
    /// Scene file or name of a built-in scene
    #[arg(value_name = "SCENE", default_value = "heart")]
    pub scene: String,
    /// Address or name and port for arms, viewers and the page; port 0 takes a free one; `none`: no TCP
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:7411", value_parser = listen)]
    pub listen: Listen,
    /// Listen on this Unix socket as well; whoever may open it may do everything
    #[arg(long, value_name = "PATH")]
    pub unix: Option<PathBuf>,
    /// Permissions of the Unix socket, as chmod takes them
    #[arg(long, value_name = "MODE", default_value = "0660", value_parser = mode, requires = "unix")]
    pub unix_mode: u32,
    /// Group of the Unix socket
    #[arg(long, value_name = "GROUP", requires = "unix")]
    pub unix_group: Option<String>,
    /// Ask everybody who they are, by the keys of this folder (`palpated pki init` makes one); the port speaks TLS
    #[arg(long, value_name = "FOLDER")]
    pub pki: Option<PathBuf>,
    /// Whoever reaches the daemon by a network may do everything
    #[arg(long, conflicts_with = "pki")]
    pub trust_the_network: bool,
    /// Largest sum of forces that callers without the role of an operator inject while an arm is attached (N) [default: a quarter of
    /// --max-force-n]
    #[arg(long, value_name = "N")]
    pub max_injected_force_n: Option<f64>,
    /// An arm has force only while this button of it is held (0 is the first)
    #[arg(long, value_name = "BUTTON", value_parser = clap::value_parser!(u8).range(0..=31))]
    pub hold_to_run: Option<u8>,
    /// A name of this machine under which browsers may open the page, beside its host name and addresses; may be given several times
    #[arg(long = "host", value_name = "NAME")]
    pub host_names: Vec<String>,
    /// Certificate chain (PEM): the port speaks TLS
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    pub tls_cert: Option<PathBuf>,
    /// Private key of the certificate (PEM)
    #[arg(long, value_name = "FILE", requires = "tls_cert")]
    pub tls_key: Option<PathBuf>,
    /// What moves the tool while no device is attached
    #[arg(long, value_enum, default_value_t = Arm::Simulated)]
    pub arm: Arm,
    /// Largest force any arm is asked for (N); a device's own limit applies when it is smaller
    #[arg(long, value_name = "N", default_value_t = default_limits().force.max_force_n)]
    pub max_force_n: f64,
    /// Largest change of an arm's force (N/s)
    #[arg(long, value_name = "N/S", default_value_t = default_limits().force.max_force_rate_n_per_s)]
    pub max_force_rate_n_per_s: f64,
    /// Largest torque any arm is asked for (N m); a device's own limit applies when it is smaller
    #[arg(long, value_name = "NM", default_value_t = default_limits().torque.max_torque_nm)]
    pub max_torque_nm: f64,
    /// Largest change of an arm's torque (N m/s)
    #[arg(long, value_name = "NM/S", default_value_t = default_limits().torque.max_torque_rate_nm_per_s)]
    pub max_torque_rate_nm_per_s: f64,
    /// Updates per second for viewers that ask for no rate (Hz, 1 to 240)
    #[arg(long, value_name = "HZ", default_value_t = 60.0)]
    pub display_rate_hz: f64,
    /// Folder whose scene files viewers may load; may be given several times
    #[arg(long = "scene-folder", value_name = "FOLDER")]
    pub scene_folders: Vec<PathBuf>,
    /// Keep the session in this folder: from time to time, when the daemon stops, and before another scene is loaded
    #[arg(long, value_name = "FOLDER")]
    pub autosave: Option<PathBuf>,
    /// Time between two autosaves (s)
    #[arg(long, value_name = "S", default_value_t = 30, value_parser = clap::value_parser!(u32).range(1..=86_400))]
    pub autosave_every_s: u32,
    /// Go on with the session that is kept there, if one is, and not with SCENE
    #[arg(long, requires = "autosave")]
    pub resume: bool,
    /// SCHED_FIFO priority of the loop (1 to 99), or 0 for normal scheduling
    #[arg(long, value_name = "PRIORITY", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    pub priority: u8,
    /// Run the loop on this processor only
    #[arg(long, value_name = "NUMBER")]
    pub processor: Option<usize>,
    /// Keep processors out of deep sleep: less jitter, more power
    #[arg(long)]
    pub stay_awake: bool,
}

/// Where TCP is listened on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Listen {
    /// At this address.
    At(SocketAddr),
    /// Nowhere.
    Nowhere,
}

fn listen(text: &str) -> Result<Listen, String> {
    if text == "none" { Ok(Listen::Nowhere) } else { address(text).map(Listen::At) }
}

/// Permissions in octal digits.
fn mode(text: &str) -> Result<u32, String> {
    let mode = u32::from_str_radix(text.trim_start_matches("0o"), 8).ok().filter(|mode| *mode <= 0o777);
    mode.ok_or_else(|| {
        "give permissions in octal digits, such as 0660 (its user and group) or 0600 (its user)".to_owned()
    })
}

/// An address with a port, or a name of this machine with one.
fn address(text: &str) -> Result<SocketAddr, String> {
    if let Ok(address) = text.parse() {
        return Ok(address);
    }
    let form = "give an address of this machine and a port, such as 127.0.0.1:7411, 0.0.0.0:7411, [::1]:7411 or localhost:7411";
    let mut found: Vec<SocketAddr> = text.to_socket_addrs().map_err(|error| format!("{error}: {form}"))?.collect();
    // The page's address is easier to read so.
    found.sort_by_key(SocketAddr::is_ipv6);
    found.first().copied().ok_or_else(|| format!("no machine is known by this name: {form}"))
}

impl ServeArgs {
    /// The configuration, checked.
    ///
    /// # Errors
    /// [`super::ServeError::Setting`], naming the flag.
    pub fn config(&self) -> Result<ServeConfig, super::ServeError> {
        let mut limits = default_limits();
        limits.force.max_force_n = self.max_force_n;
        limits.force.max_force_rate_n_per_s = self.max_force_rate_n_per_s;
        limits.torque.max_torque_nm = self.max_torque_nm;
        limits.torque.max_torque_rate_nm_per_s = self.max_torque_rate_nm_per_s;
        limits.max_injected_force_n = self.max_injected_force_n.unwrap_or(0.25 * self.max_force_n);
        limits.hold_to_run = self.hold_to_run;
        let keys = self.pki.as_deref().map(Folder::at);
        let given = self.tls_cert.clone().zip(self.tls_key.clone());
        let own = keys.as_ref().map(|keys| (keys.certificate(), keys.key()));
        let tls = given.or(own).map(|(certificate, key)| {
            let authority = keys.as_ref().map(Folder::authority);
            TlsFiles { certificate, key, authority }
        });
        let unix = self.unix.clone().map(|path| {
            let (mode, group) = (self.unix_mode, self.unix_group.clone());
            UnixSocket { path, mode, group }
        });
        let measures = OsMeasures {
            fifo_priority: Some(self.priority).filter(|&priority| priority > 0),
            lock_memory: true,
            processor: self.processor,
            stay_awake: self.stay_awake,
        };
        ServeConfig {
            listen: match self.listen {
                Listen::At(address) => Some(address),
                Listen::Nowhere => None,
            },
            unix,
            keys,
            trusts_network: self.trust_the_network,
            bounds: Bounds::default(),
            host_names: self.host_names.clone(),
            tls,
            simulated_arm: self.arm == Arm::Simulated,
            limits,
            display_rate_hz: self.display_rate_hz,
            source: None,
            autosave: self.autosave.as_deref().map(|folder| AutosaveSettings {
                folder: KeptFolder::at(folder),
                every: Duration::from_secs(self.autosave_every_s.into()),
            }),
            resume: None,
            scene_folders: self.scene_folders.clone(),
            measures,
        }
        .checked()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_and_names_are_listened_on() {
        for (text, address_then) in
            [("127.0.0.1:7411", "127.0.0.1:7411"), ("[::1]:1", "[::1]:1"), ("localhost:7411", "127.0.0.1:7411")]
        {
            assert_eq!(address(text).unwrap().to_string(), address_then);
        }
        for text in ["localhost", "7411", "", "127.0.0.1:70000", "localhost:"] {
            let refusal = address(text).unwrap_err();
            assert!(refusal.contains("0.0.0.0:7411"), "{text}: {refusal}");
        }
    }
}
