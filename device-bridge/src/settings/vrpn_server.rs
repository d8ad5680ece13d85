//! What the keys of the VRPN server mean.
use super::value;
use crate::{BridgeError, config::VrpnServerConfig};
use std::net::SocketAddr;

/// Most programs that may be allowed.
const MOST_CLIENTS: usize = 64;
/// Longest name of a sender that VRPN's own library takes.
const LONGEST_NAME: usize = 99;

/// A server for programs that read by VRPN.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct VrpnServerSettings {
    /// Where it listens.
    pub listen: SocketAddr,
    /// What the arm is called.
    pub name: String,
    /// Every so many ticks of the servo are told.
    pub every: u64,
    /// Most programs at once.
    pub max_clients: usize,
}

pub(super) fn checked(config: &VrpnServerConfig, servo_hz: f64) -> Result<Option<VrpnServerSettings>, BridgeError> {
    let Some(listen) = &config.listen else { return Ok(None) };
    let wrong = |_| value("vrpn_server.listen", format!("\"{listen}\" is no address and port, like 127.0.0.1:3883"));
    vrpn_name("vrpn_server.name", &config.name)?;
    let rate_hz = config.rate_hz.unwrap_or(servo_hz);
    if !(1.0..=servo_hz).contains(&rate_hz) {
        let reason = format!("{rate_hz} is out of range: use 1 to the servo's rate, {servo_hz}");
        return Err(value("vrpn_server.rate_hz", reason));
    }
    if !(1..=MOST_CLIENTS).contains(&config.max_clients) {
        let reason = format!("{} is out of range: use 1 to {MOST_CLIENTS}", config.max_clients);
        return Err(value("vrpn_server.max_clients", reason));
    }
    Ok(Some(VrpnServerSettings {
        listen: listen.parse().map_err(wrong)?,
        name: config.name.clone(),
        every: (servo_hz / rate_hz).round() as u64,
        max_clients: config.max_clients,
    }))
}

/// Checks a name that goes over the wire.
pub(super) fn vrpn_name(key: &str, name: &str) -> Result<(), BridgeError> {
    let is_one = (1..=LONGEST_NAME).contains(&name.len());
    if is_one && name.bytes().all(|byte| (b' '..=b'~').contains(&byte) && byte != b'@') {
        return Ok(());
    }
    let text = name.escape_debug();
    Err(value(key, format!("\"{text}\" is no name: use 1 to {LONGEST_NAME} ASCII characters, and leave out \"@host\"")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_off_unless_told_where_to_listen_and_every_refusal_names_the_key() {
        let on = VrpnServerConfig { listen: Some("[::1]:3883".into()), ..VrpnServerConfig::default() };
        assert_eq!(checked(&VrpnServerConfig::default(), 1e3).unwrap(), None);
        let every = |rate_hz| checked(&VrpnServerConfig { rate_hz, ..on.clone() }, 1e3).unwrap().unwrap().every;
        assert_eq!([every(None), every(Some(1e3)), every(Some(300.0)), every(Some(1.0))], [1, 1, 3, 1000]);
        let refused = |config: VrpnServerConfig| checked(&config, 1e3).unwrap_err().to_string();
        assert!(
            refused(VrpnServerConfig { listen: Some("3883".into()), ..on.clone() })
                .starts_with("vrpn_server.listen: \"3883\" is no address")
        );
        assert!(
            refused(VrpnServerConfig { rate_hz: Some(2e3), ..on.clone() }).starts_with("vrpn_server.rate_hz: 2000")
        );
        assert!(refused(VrpnServerConfig { max_clients: 0, ..on.clone() }).starts_with("vrpn_server.max_clients: 0"));
        for name in ["", "a@b", "a\n", "é", &"x".repeat(100)] {
            assert!(refused(VrpnServerConfig { name: name.into(), ..on.clone() }).starts_with("vrpn_server.name"));
        }
    }
}
