//! Where the daemon is, and a channel to it.
use crate::ViewError;
use std::{fmt::Write as _, path::PathBuf, time::Duration};
use tonic::transport::{Certificate, Channel, ClientTlsConfig, Endpoint, Uri};

/// Longest wait for a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);

/// A daemon's address: `http://`, `https://` (with the certificate authority to trust, PEM) or `unix://`.
#[derive(Debug, Clone)]
pub struct Server {
    /// Address as given.
    pub address: String,
    /// Certificate authority for `https://`.
    pub ca_pem: Option<Vec<u8>>,
}

impl Server {
    /// Opens a channel, or says why not.
    ///
    /// # Errors
    /// [`ViewError::Address`] or [`ViewError::Unreachable`].
    pub async fn connect(&self) -> Result<Channel, ViewError> {
        let channel = if let Some(path) = self.address.strip_prefix("unix://") {
            self.connect_unix(PathBuf::from(path)).await
        } else {
            self.endpoint()?.connect().await
        };
        channel.map_err(|error| ViewError::Unreachable { address: self.address.clone(), reason: causes(&error) })
    }

    fn endpoint(&self) -> Result<Endpoint, ViewError> {
        let bad = |reason: String| ViewError::Address { address: self.address.clone(), reason };
        let uri: Uri = self.address.parse().map_err(|error| bad(format!("{error}")))?;
        let https = match uri.scheme_str() {
            Some("http") => false,
            Some("https") => true,
            _ => return Err(bad("it has no known scheme".into())),
        };
        let endpoint = Endpoint::from(uri).connect_timeout(CONNECT_TIMEOUT).tcp_nodelay(true);
        if !https {
            return Ok(endpoint);
        }
        let mut tls = ClientTlsConfig::new();
        if let Some(pem) = &self.ca_pem {
            tls = tls.ca_certificate(Certificate::from_pem(pem));
        }
        endpoint.tls_config(tls).map_err(|error| bad(causes(&error)))
    }

    async fn connect_unix(&self, path: PathBuf) -> Result<Channel, tonic::transport::Error> {
        let connector = tower::service_fn(move |_: Uri| {
            let path = path.clone();
            async move {
                Ok::<_, std::io::Error>(hyper_util::rt::TokioIo::new(tokio::net::UnixStream::connect(path).await?))
            }
        });
        // The URI only fills the request's authority; the connector decides where it goes.
        Endpoint::from_static("http://palpate.local")
            .connect_timeout(CONNECT_TIMEOUT)
            .connect_with_connector(connector)
            .await
    }
}

/// An error with its causes, in one line.
fn causes(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(next) = cause {
        // Writing into a String cannot fail.
        let _ = write!(text, ": {next}");
        cause = next.source();
    }
    text
}
