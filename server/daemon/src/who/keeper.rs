//! Who calls: by the certificate of the connection, or the token of the request.
use super::{
    Identity, certificate,
    folder::{Folder, FolderError},
    role::Roles,
    token::{self, KEY_BYTES, TokenError},
};
use std::{
    collections::BTreeSet,
    sync::{Arc, PoisonError, RwLock},
    time::SystemTime,
};

/// What stands before a token in the header `authorization`.
const BEARER: &str = "Bearer ";

/// Knows identities, or lets everybody in.
#[derive(Debug)]
pub struct Keeper {
    keys: Option<(Folder, RwLock<Arc<Keys>>)>,
}

#[derive(Debug)]
struct Keys {
    token: [u8; KEY_BYTES],
    revoked: BTreeSet<String>,
}

/// Who calls.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Caller {
    /// Whoever reaches the daemon may do everything: identities are not asked for, or the caller is a process of this machine that
    /// may open the Unix socket.
    Trusted,
    /// Has shown neither certificate nor token.
    Unknown,
    /// Somebody.
    Known(Identity),
}

impl Caller {
    /// What the caller may do.
    pub fn roles(&self) -> Roles {
        match self {
            Self::Trusted => Roles::ALL,
            Self::Unknown => Roles::NONE,
            Self::Known(identity) => identity.roles,
        }
    }

    /// By what name, for the log.
    pub fn name(&self) -> Option<&str> {
        match self {
            Self::Known(identity) => Some(&identity.name),
            Self::Trusted | Self::Unknown => None,
        }
    }
}

/// Why what a caller shows is worth nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// The header `authorization` has no token.
    #[error("the header `authorization` is to be `Bearer TOKEN`")]
    Header,
    /// The token.
    #[error("the token is worth nothing: {0}")]
    Token(#[from] TokenError),
    /// The name has been revoked.
    #[error("what was issued to this name has been revoked")]
    Revoked,
    /// The certificate or the token is over.
    #[error("the certificate or token has ended")]
    Ended,
    /// The certificate names nobody.
    #[error("the certificate has no name or no role")]
    Nameless,
}

impl Keeper {
    /// Asks nobody who they are.
    pub fn open() -> Self {
        Self { keys: None }
    }

    /// Knows who was issued something with this folder's keys.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn of(folder: Folder) -> Result<Self, FolderError> {
        let keys = Keys::of(&folder)?;
        Ok(Self { keys: Some((folder, RwLock::new(Arc::new(keys)))) })
    }

    /// Reads the folder again: who was revoked, and the key of tokens.
    ///
    /// # Errors
    /// [`FolderError`]; what was known stays.
    pub fn reload(&self) -> Result<(), FolderError> {
        if let Some((folder, keys)) = &self.keys {
            let fresh = Arc::new(Keys::of(folder)?);
            *keys.write().unwrap_or_else(PoisonError::into_inner) = fresh;
        }
        Ok(())
    }

    fn keys(&self) -> Option<Arc<Keys>> {
        self.keys.as_ref().map(|(_, keys)| Arc::clone(&keys.read().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Who calls. A token counts before a certificate: it may have been narrowed for this call.
    ///
    /// # Errors
    /// [`Refused`], when what is shown is worth nothing.
    pub fn caller(
        &self,
        is_local: bool,
        certificate: Option<&[u8]>,
        authorization: Option<&[u8]>,
        now: SystemTime,
    ) -> Result<Caller, Refused> {
        let Some(keys) = self.keys().filter(|_| !is_local) else { return Ok(Caller::Trusted) };
        let identity = if let Some(header) = authorization {
            let token = std::str::from_utf8(header).ok().and_then(|text| text.strip_prefix(BEARER));
            token::read(&keys.token, token.ok_or(Refused::Header)?, now)?
        } else if let Some(der) = certificate {
            certificate::identity(der).ok_or(Refused::Nameless)?
        } else {
            return Ok(Caller::Unknown);
        };
        keys.check(&identity, now)?;
        Ok(Caller::Known(identity))
    }

    /// Whether a caller may go on.
    ///
    /// # Errors
    /// [`Refused`], when it has ended or was revoked.
    pub fn check(&self, caller: &Caller, now: SystemTime) -> Result<(), Refused> {
        match (self.keys(), caller) {
            (Some(keys), Caller::Known(identity)) => keys.check(identity, now),
            _ => Ok(()),
        }
    }
}

impl Keys {
    fn of(folder: &Folder) -> Result<Self, FolderError> {
        Ok(Self { token: folder.token_key()?, revoked: folder.revoked()? })
    }

    fn check(&self, identity: &Identity, now: SystemTime) -> Result<(), Refused> {
        if self.revoked.contains(&identity.name) {
            return Err(Refused::Revoked);
        }
        if now >= identity.until { Err(Refused::Ended) } else { Ok(()) }
    }
}
