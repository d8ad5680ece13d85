//! From a daemon's address to an endpoint: `http://HOST:PORT`, `https://HOST:PORT` with a certificate authority, or
//! `unix:///path/to/socket`.
use std::{
    fs, io,
    path::{Path, PathBuf},
    time::Duration,
};
use thiserror::Error;
use tonic::transport::{Certificate, ClientTlsConfig, Endpoint};

/// Longest wait for a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
/// Unanswered pings for so long end a connection that the network lost silently.
const KEEP_ALIVE: Duration = Duration::from_secs(2);

/// Why an address leads nowhere, before anybody was called.
#[derive(Debug, Error)]
pub enum ConnectError {
    /// It is no address of a daemon, or does not go with the certificate authority.
    #[error("\"{address}\" is no address of a daemon: {reason}")]
    Address {
        /// As given.
        address: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The certificate authority cannot be read.
    #[error("cannot read the certificate authority {path}: {source}", path = path.display())]
    Authority {
        /// Its path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// The endpoint of an address; `https://` needs the certificate authority (PEM file) to trust.
///
/// # Errors
/// [`ConnectError`].
pub fn endpoint(address: &str, authority: Option<&Path>) -> Result<Endpoint, ConnectError> {
    let bad = |reason: String| ConnectError::Address { address: address.to_owned(), reason };
    let scheme = address.split_once("://").map(|(scheme, _)| scheme);
    if !matches!(scheme, Some("http" | "https" | "unix")) {
        return Err(bad("it has no known scheme".to_owned()));
    }
    let endpoint = Endpoint::from_shared(address.to_owned())
        .map_err(|error| bad(causes(&error)))?
        .connect_timeout(CONNECT_TIMEOUT)
        .tcp_nodelay(true)
        .http2_keep_alive_interval(KEEP_ALIVE)
        .keep_alive_timeout(KEEP_ALIVE);
    match (authority, scheme) {
        (None, Some("https")) => {
            Err(bad("https needs the certificate authority to trust: give its PEM file with --tls-ca".to_owned()))
        }
        (Some(path), Some("https")) => {
            let pem = fs::read(path).map_err(|source| ConnectError::Authority { path: path.to_owned(), source })?;
            let tls = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(pem));
            endpoint.tls_config(tls).map_err(|error| bad(causes(&error)))
        }
        (Some(_), _) => Err(bad("a certificate authority is given, but the address is not https://".to_owned())),
        (None, _) => Ok(endpoint),
    }
}

/// An error with its causes, in one line.
pub fn causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(next) = cause {
        let next_text = next.to_string();
        if !text.contains(&next_text) {
            text = format!("{text}: {next_text}");
        }
        cause = next.source();
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(address: &str, authority: Option<&str>) -> String {
        endpoint(address, authority.map(Path::new)).unwrap_err().to_string()
    }

    #[test]
    fn addresses_are_checked() {
        for address in ["127.0.0.1:7411", "ftp://host", "", "http://"] {
            assert!(refused(address, None).contains("no address of a daemon"), "{address}");
        }
        assert!(refused("https://host:7411", None).contains("--tls-ca"));
        assert!(refused("http://host:7411", Some("ca.pem")).contains("not https"));
        let missing = refused("https://host:7411", Some("/nowhere/ca.pem"));
        assert!(missing.contains("cannot read the certificate authority /nowhere/ca.pem"), "{missing}");
    }
}
