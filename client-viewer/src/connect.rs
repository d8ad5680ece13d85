//! Where the daemon is, and a channel to it.
use crate::ViewError;
use palpate_proto::{
    connect::{self, ConnectError, Connection, Credentials, is_transport, why_no_answer, why_unreachable},
    v1::{ListRequest, session_client::SessionClient},
};

/// A daemon's address: `http://`, `https://` (with the certificate authority to trust) or `unix://`.
#[derive(Debug, Clone)]
pub struct Server {
    /// Address as given.
    pub address: String,
    /// Whom it trusts, and what it shows of itself.
    pub credentials: Credentials,
}

impl Server {
    /// Opens a channel, or says why not.
    ///
    /// # Errors
    /// [`ViewError::Address`], [`ViewError::File`] or [`ViewError::Unreachable`].
    pub async fn connect(&self) -> Result<Connection, ViewError> {
        let endpoint = connect::endpoint(&self.address, &self.credentials)?;
        let bearer = self.credentials.bearer(&self.address)?;
        let unreachable = |reason| ViewError::Unreachable { address: self.address.clone(), reason };
        let channel = endpoint.connect().await.map_err(|error| unreachable(why_unreachable(&error)))?;
        let channel = Connection::new(channel, bearer);
        // A connection says nothing of who is at its other end; any answer does, a refusal too.
        match SessionClient::new(channel.clone()).list(ListRequest {}).await {
            Err(status) if is_transport(&status) => Err(unreachable(why_no_answer(&status))),
            _ => Ok(channel),
        }
    }
}

impl From<ConnectError> for ViewError {
    fn from(error: ConnectError) -> Self {
        match error {
            ConnectError::Address { address, reason } => Self::Address { address, reason },
            ConnectError::Authority { path, source } | ConnectError::Own { path, source, .. } => {
                Self::File { action: "cannot read", path, source }
            }
            ConnectError::Token => Self::Token(error.to_string()),
        }
    }
}
