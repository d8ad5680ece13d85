//! TLS: the daemon's certificate and key.
use super::listen::ListenError;
use std::{
    path::{Path, PathBuf},
    sync::Arc,
};
use tokio_rustls::{
    TlsAcceptor,
    rustls::{
        self, RootCertStore, ServerConfig,
        crypto::{CryptoProvider, ring},
        pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject as _},
        server::{WebPkiClientVerifier, danger::ClientCertVerifier},
    },
};

/// Certificate chain and key (PEM files).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TlsFiles {
    /// Certificate chain.
    pub certificate: PathBuf,
    /// Private key.
    pub key: PathBuf,
    /// Certificate authority of clients that show a certificate; none has to.
    pub authority: Option<PathBuf>,
}

/// The certificate that a client has shown, signed by the authority: an extension of its requests.
#[derive(Debug, Clone)]
pub struct PeerCertificate(pub Arc<CertificateDer<'static>>);

/// Protocols that the port speaks, by preference.
const PROTOCOLS: [&[u8]; 2] = [b"h2", b"http/1.1"];

/// What accepts TLS connections with this certificate.
///
/// # Errors
/// [`ListenError::TlsFile`] or [`ListenError::Tls`].
pub fn acceptor(files: &TlsFiles) -> Result<TlsAcceptor, ListenError> {
    let read = |what, path: &Path| {
        std::fs::read(path).map_err(|source| ListenError::TlsFile { what, path: path.to_owned(), source })
    };
    let (chain, key) = (read("certificate", &files.certificate)?, read("key", &files.key)?);
    let refuse = |reason: String| ListenError::Tls { path: files.certificate.clone(), reason };
    let chain: Vec<CertificateDer<'static>> =
        CertificateDer::pem_slice_iter(&chain).collect::<Result<_, _>>().map_err(|error| refuse(error.to_string()))?;
    if chain.is_empty() {
        return Err(refuse("the file has no certificate".to_owned()));
    }
    let key = PrivateKeyDer::from_pem_slice(&key).map_err(|error| refuse(format!("the key: {error}")))?;
    let provider = Arc::new(ring::default_provider());
    let clients = match &files.authority {
        Some(path) => clients_of(path, &provider)?,
        None => WebPkiClientVerifier::no_client_auth(),
    };
    let mut config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .and_then(|config| config.with_client_cert_verifier(clients).with_single_cert(chain, key))
        .map_err(|error: rustls::Error| refuse(error.to_string()))?;
    config.alpn_protocols = PROTOCOLS.map(<[u8]>::to_vec).into();
    Ok(TlsAcceptor::from(Arc::new(config)))
}

/// Sees whether certificates of clients are signed by this authority; who shows none is let in as nobody.
fn clients_of(path: &Path, provider: &Arc<CryptoProvider>) -> Result<Arc<dyn ClientCertVerifier>, ListenError> {
    let read = |source| ListenError::TlsFile { what: "certificate authority", path: path.to_owned(), source };
    let refuse = |reason: String| ListenError::Tls { path: path.to_owned(), reason };
    let pem = std::fs::read(path).map_err(read)?;
    let mut roots = RootCertStore::empty();
    for certificate in CertificateDer::pem_slice_iter(&pem) {
        let certificate = certificate.map_err(|error| refuse(error.to_string()))?;
        roots.add(certificate).map_err(|error| refuse(error.to_string()))?;
    }
    WebPkiClientVerifier::builder_with_provider(roots.into(), Arc::clone(provider))
        .allow_unauthenticated()
        .build()
        .map_err(|error| refuse(error.to_string()))
}
