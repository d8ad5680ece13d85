//! From a daemon's address to an endpoint: `http://HOST:PORT`, `https://HOST:PORT` with a certificate authority, or
//! `unix:///path/to/socket`.
use crate::ARM_SIGN;
use hyper_util::rt::TokioIo;
use std::{
    fs, io,
    path::{Path, PathBuf},
    time::Duration,
};
use thiserror::Error;
use tokio::{
    io::AsyncWriteExt as _,
    net::{TcpStream, UnixStream},
};
use tokio_util::either::Either;
use tonic::{
    Request, Status,
    metadata::AsciiMetadataValue,
    service::{Interceptor, interceptor::InterceptedService},
    transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Identity, Uri},
};

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
    /// The own certificate or key cannot be read.
    #[error("cannot read the {what} {path}: {source}", path = path.display())]
    Own {
        /// `certificate` or `key`.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The token cannot be sent.
    #[error("the token holds what no token does: `palpated pki token` prints one, in one line")]
    Token,
}

/// Whom a client trusts, and what it shows of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Credentials {
    /// Certificate authority (PEM file) to trust for `https://`.
    pub authority: Option<PathBuf>,
    /// Its own certificate and key (PEM files), signed by the daemon's authority.
    pub certificate: Option<(PathBuf, PathBuf)>,
    /// Or its token.
    pub token: Option<String>,
}

impl Credentials {
    /// What puts the token into every call to this address. By TLS only: sent in the clear it would be anybody's, and daemons that
    /// are reached so ask for none.
    ///
    /// # Errors
    /// [`ConnectError::Token`].
    pub fn bearer(&self, address: &str) -> Result<Bearer, ConnectError> {
        let token = self.token.as_deref().map(str::trim).filter(|token| !token.is_empty() && is_tls(address));
        let header = token.map(|token| format!("Bearer {token}").parse());
        header.transpose().map(Bearer).map_err(|_| ConnectError::Token)
    }
}

fn is_tls(address: &str) -> bool {
    address.starts_with("https://")
}

/// Puts a token, if there is one, into every call.
#[derive(Debug, Clone)]
pub struct Bearer(Option<AsciiMetadataValue>);

impl Interceptor for Bearer {
    fn call(&mut self, mut request: Request<()>) -> Result<Request<()>, Status> {
        if let Some(token) = &self.0 {
            request.metadata_mut().insert("authorization", token.clone());
        }
        Ok(request)
    }
}

/// A channel whose calls carry a token, if there is one.
pub type Connection = InterceptedService<Channel, Bearer>;

/// The endpoint of an address; `https://` needs the certificate authority to trust.
///
/// # Errors
/// [`ConnectError`].
pub fn endpoint(address: &str, credentials: &Credentials) -> Result<Endpoint, ConnectError> {
    let bad = |reason: String| ConnectError::Address { address: address.to_owned(), reason };
    let scheme = address.split_once("://").map(|(scheme, _)| scheme);
    if !matches!(scheme, Some("http" | "https" | "unix")) {
        return Err(bad("it does not begin with http://, https:// or unix://".to_owned()));
    }
    let endpoint = Endpoint::from_shared(address.to_owned())
        .map_err(|error| bad(causes(&error)))?
        .connect_timeout(CONNECT_TIMEOUT)
        .tcp_nodelay(true)
        .http2_keep_alive_interval(KEEP_ALIVE)
        .keep_alive_timeout(KEEP_ALIVE);
    if scheme != Some("unix") && endpoint.uri().port_u16().is_none() {
        return Err(bad("it names no port, 1 to 65535; `palpated` takes 7411 unless it is told another".to_owned()));
    }
    if scheme != Some("https") && credentials.certificate.is_some() {
        return Err(bad("a certificate is shown by https:// only".to_owned()));
    }
    match (credentials.authority.as_deref(), scheme) {
        (None, Some("https")) => {
            Err(bad("https needs the certificate authority to trust: give its PEM file with --tls-ca".to_owned()))
        }
        (Some(path), Some("https")) => {
            let unread = |source| ConnectError::Authority { path: path.to_owned(), source };
            let pem = fs::read(path).map_err(unread)?;
            if !String::from_utf8_lossy(&pem).contains("-----BEGIN CERTIFICATE-----") {
                let none = "it holds no certificate in PEM form, which has a line -----BEGIN CERTIFICATE-----";
                return Err(unread(io::Error::new(io::ErrorKind::InvalidData, none)));
            }
            let mut tls = ClientTlsConfig::new().ca_certificate(Certificate::from_pem(pem));
            if let Some((certificate, key)) = &credentials.certificate {
                let read = |what, path: &Path| {
                    fs::read(path).map_err(|source| ConnectError::Own { what, path: path.to_owned(), source })
                };
                tls = tls.identity(Identity::from_pem(read("certificate", certificate)?, read("key", key)?));
            }
            endpoint.tls_config(tls).map_err(|error| bad(causes(&error)))
        }
        (Some(_), _) => Err(bad("a certificate authority is given, but the address is not https://".to_owned())),
        (None, _) => Ok(endpoint),
    }
}

/// Connects an arm to a daemon: with the sign by which the daemon serves it before all viewers, whatever these do.
///
/// `address` is the one that the endpoint was made of.
///
/// # Errors
/// The transport's.
pub async fn connect_arm(endpoint: &Endpoint, address: &str) -> Result<Channel, tonic::transport::Error> {
    let path = address.strip_prefix("unix://").map(str::to_owned);
    let connector = tower::service_fn(move |uri: Uri| {
        let path = path.clone();
        async move {
            if let Some(path) = path {
                let mut stream = UnixStream::connect(path).await?;
                stream.write_all(ARM_SIGN).await?;
                return Ok::<_, io::Error>(TokioIo::new(Either::Left(stream)));
            }
            // An address of IPv6 stands in brackets.
            let host = uri.host().unwrap_or_default().trim_matches(['[', ']']).to_owned();
            let mut stream = TcpStream::connect((host, uri.port_u16().unwrap_or_default())).await?;
            stream.set_nodelay(true)?;
            stream.write_all(ARM_SIGN).await?;
            Ok(TokioIo::new(Either::Right(stream)))
        }
    });
    endpoint.connect_with_connector(connector).await
}

/// Why a connection was not made: what that means, and the transport's words.
pub fn why_unreachable(error: &(dyn std::error::Error + 'static)) -> String {
    let words = causes(error).trim_start_matches("transport error: ").to_owned();
    let meaning = match kind_of(error) {
        // What the TLS library finds wrong has no kind of its own.
        _ if words.contains("InvalidContentType") => "it does not speak TLS: write http:// in its place",
        _ if words.contains("UnknownIssuer") || words.contains("BadSignature") => {
            "its certificate is not signed by the authority given with --tls-ca"
        }
        Some(io::ErrorKind::ConnectionRefused) => "nothing listens there",
        Some(io::ErrorKind::NotFound) => "there is no such socket",
        _ => return words,
    };
    format!("{meaning} ({words})")
}

/// Whether a connection was not made because nothing listens at the address.
pub fn is_nobody_there(error: &(dyn std::error::Error + 'static)) -> bool {
    matches!(kind_of(error), Some(io::ErrorKind::ConnectionRefused | io::ErrorKind::NotFound))
}

fn kind_of(error: &(dyn std::error::Error + 'static)) -> Option<io::ErrorKind> {
    let chain = std::iter::successors(Some(error), |error| error.source());
    chain.filter_map(|error| error.downcast_ref::<io::Error>()).map(io::Error::kind).last()
}

/// Why a connection that was made is no daemon's, when it broke before the first answer.
pub fn why_no_answer(status: &Status) -> String {
    format!(
        "what listens there broke the connection off without an answer: it is another program, or a daemon that wants https:// ({})",
        words_of(status)
    )
}

/// What went wrong with the transport, or what the daemon answered.
pub fn words_of(status: &Status) -> String {
    std::error::Error::source(status).map_or_else(|| status.message().to_owned(), causes)
}

/// Whether a status was made up on this side because the transport failed; what a daemon answers has no cause here.
pub fn is_transport(status: &Status) -> bool {
    std::error::Error::source(status).is_some()
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
        let authority = authority.map(PathBuf::from);
        endpoint(address, &Credentials { authority, ..Credentials::default() }).unwrap_err().to_string()
    }

    #[test]
    fn addresses_are_checked() {
        // A port that is none was taken for none, and 80 was called.
        for address in ["127.0.0.1:7411", "ftp://host", "", "http://", "http://host", "http://host:99999"] {
            assert!(refused(address, None).contains("no address of a daemon"), "{address}");
        }
        assert!(refused("https://host:7411", None).contains("--tls-ca"));
        assert!(refused("http://host:7411", Some("ca.pem")).contains("not https"));
        let missing = refused("https://host:7411", Some("/nowhere/ca.pem"));
        assert!(missing.contains("cannot read the certificate authority /nowhere/ca.pem"), "{missing}");
    }

    /// A token sent in the clear is anybody's.
    #[test]
    fn what_tells_a_client_apart_is_shown_by_tls_only() {
        let own = Credentials { certificate: Some(("a.pem".into(), "a.key".into())), ..Credentials::default() };
        let refusal = endpoint("http://host:7411", &own).unwrap_err().to_string();
        assert!(refusal.contains("https:// only"), "{refusal}");
        let with = |token: &str| Credentials { token: Some(token.to_owned()), ..Credentials::default() };
        for (token, address, is_shown) in [
            ("palpate1.x", "https://host:7411", true),
            ("palpate1.x", "http://host:7411", false),
            ("palpate1.x", "unix:///run/palpate.sock", false),
            // A variable that is there and empty.
            ("", "https://host:7411", false),
        ] {
            assert_eq!(with(token).bearer(address).unwrap().0.is_some(), is_shown, "{token} {address}");
        }
        assert!(matches!(with("palpate1\nx").bearer("https://host:7411"), Err(ConnectError::Token)));
    }
}
