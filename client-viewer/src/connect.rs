//! Where the daemon is, and a channel to it.
use crate::ViewError;
use palpate_proto::connect::{self, ConnectError, causes};
use std::path::PathBuf;
use tonic::transport::Channel;

/// A daemon's address: `http://`, `https://` (with the certificate authority to trust) or `unix://`.
#[derive(Debug, Clone)]
pub struct Server {
    /// Address as given.
    pub address: String,
    /// Certificate authority (PEM file) for `https://`.
    pub tls_ca: Option<PathBuf>,
}

impl Server {
    /// Opens a channel, or says why not.
    ///
    /// # Errors
    /// [`ViewError::Address`], [`ViewError::File`] or [`ViewError::Unreachable`].
    pub async fn connect(&self) -> Result<Channel, ViewError> {
        let endpoint = connect::endpoint(&self.address, self.tls_ca.as_deref())?;
        let unreachable = |error| ViewError::Unreachable { address: self.address.clone(), reason: causes(&error) };
        endpoint.connect().await.map_err(unreachable)
    }
}

impl From<ConnectError> for ViewError {
    fn from(error: ConnectError) -> Self {
        match error {
            ConnectError::Address { address, reason } => Self::Address { address, reason },
            ConnectError::Authority { path, source } => Self::File { action: "cannot read", path, source },
        }
    }
}
