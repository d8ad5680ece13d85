//! The folder of keys: an authority of the daemon's own, the daemon's certificate, the key of tokens, and who was issued or revoked.
//! Keys are readable by their owner only.
use super::{
    certificate::ROLE_URI,
    is_name,
    role::Roles,
    token::{KEY_BYTES, from_hex, to_hex},
};
use crate::whole_file::{self, PUBLIC, SECRET};
use miette::Diagnostic;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose,
    SanType,
};
use ring::rand::{SecureRandom as _, SystemRandom};
use std::{
    collections::BTreeSet,
    fs, io,
    net::IpAddr,
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};
use thiserror::Error;

/// How long the authority and the daemon's certificate last: they are made anew by whoever runs the daemon.
const YEARS_10: Duration = Duration::from_hours(10 * 365 * 24);
/// Clocks of other machines may be behind.
const EARLIER: Duration = Duration::from_hours(1);

/// Why keys cannot be made or used.
#[derive(Debug, Error, Diagnostic)]
pub enum FolderError {
    /// A file.
    #[error("cannot {what} {}", path.display())]
    #[diagnostic(help(
        "`palpated pki init --folder FOLDER` makes a folder of keys; it is to be the daemon's user's own"
    ))]
    File {
        /// What was tried.
        what: &'static str,
        /// Its path.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file holds something else than it should.
    #[error("{} cannot be used: {reason}", path.display())]
    #[diagnostic(help("`palpated pki init --folder FOLDER` makes a folder of keys, and writes over none"))]
    Content {
        /// Its path.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A name that is none.
    #[error("\"{name}\" is no name: give 1 to 64 letters, digits, - and _")]
    Name {
        /// As given.
        name: String,
    },
}

/// A folder of keys.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folder {
    path: PathBuf,
}

impl Folder {
    /// At this path.
    pub fn at(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// The authority's certificate: clients trust it.
    pub fn authority(&self) -> PathBuf {
        self.path.join("ca.pem")
    }

    fn authority_key(&self) -> PathBuf {
        self.path.join("ca.key")
    }

    /// The daemon's certificate.
    pub fn certificate(&self) -> PathBuf {
        self.path.join("server.pem")
    }

    /// Its key.
    pub fn key(&self) -> PathBuf {
        self.path.join("server.key")
    }

    fn token_key_path(&self) -> PathBuf {
        self.path.join("token.key")
    }

    fn revoked_path(&self) -> PathBuf {
        self.path.join("revoked")
    }

    /// Makes all that is not there yet: `hosts` are the names and addresses under which the daemon is reached. What is there stays, but
    /// for the daemon's certificate, which is made for these hosts.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn init(&self, hosts: &[String], now: SystemTime) -> Result<(), FolderError> {
        fs::create_dir_all(&self.path).map_err(|source| self.file("make the folder", &self.path, source))?;
        if self.authority().exists() && !self.authority_key().exists() {
            let reason = "its key ca.key is not there: a new authority would make everything that was issued worth nothing. Bring the key \
                          back, or take ca.pem away as well";
            return Err(FolderError::Content { path: self.authority(), reason: reason.to_owned() });
        }
        if !self.authority_key().exists() {
            let mut params = params("Palpate", now, YEARS_10);
            params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
            params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
            let key = KeyPair::generate().map_err(|error| self.content(&self.authority_key(), &error))?;
            let key_pem = key.serialize_pem();
            let authority = params.self_signed(&key).map_err(|error| self.content(&self.authority(), &error))?;
            self.write(&self.authority(), authority.pem().as_bytes(), PUBLIC)?;
            self.write(&self.authority_key(), key_pem.as_bytes(), SECRET)?;
        }
        if !self.token_key_path().exists() {
            let mut key = [0; KEY_BYTES];
            SystemRandom::new()
                .fill(&mut key)
                .map_err(|_| self.file("get random bytes for", &self.token_key_path(), io::Error::other("refused")))?;
            self.write(&self.token_key_path(), to_hex(&key).as_bytes(), SECRET)?;
        }
        let mut params = params("palpated", now, YEARS_10);
        params.subject_alt_names = hosts
            .iter()
            .map(|host| alternative(host))
            .collect::<Result<_, _>>()
            .map_err(|error: rcgen::Error| self.content(&self.certificate(), &error))?;
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth];
        let (certificate, key) = self.signed(&params, &self.certificate())?;
        self.write(&self.certificate(), certificate.as_bytes(), PUBLIC)?;
        self.write(&self.key(), key.as_bytes(), SECRET)
    }

    /// A certificate and key for a client, as PEM files `NAME.pem` and `NAME.key` in `into`.
    ///
    /// # Errors
    /// [`FolderError`]; a file that is there already is not written over.
    pub fn issue(
        &self,
        name: &str,
        roles: Roles,
        lasts: Duration,
        now: SystemTime,
        into: &Path,
    ) -> Result<(PathBuf, PathBuf), FolderError> {
        if !is_name(name) {
            return Err(FolderError::Name { name: name.to_owned() });
        }
        self.refuse_revoked(name)?;
        let files = (into.join(format!("{name}.pem")), into.join(format!("{name}.key")));
        for path in [&files.0, &files.1] {
            if path.exists() {
                let reason = "it is there already, and is not written over".to_owned();
                return Err(FolderError::Content { path: path.clone(), reason });
            }
        }
        let mut params = params(name, now, lasts);
        let uris = roles.to_string();
        let uris = uris.split('+').map(|role| format!("{ROLE_URI}{role}").try_into().map(SanType::URI));
        params.subject_alt_names =
            uris.collect::<Result<_, _>>().map_err(|error: rcgen::Error| self.content(&files.0, &error))?;
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ClientAuth];
        let (certificate, key) = self.signed(&params, &files.0)?;
        self.write(&files.0, certificate.as_bytes(), PUBLIC)?;
        self.write(&files.1, key.as_bytes(), SECRET)?;
        Ok(files)
    }

    /// The key that tokens are made with.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn token_key(&self) -> Result<[u8; KEY_BYTES], FolderError> {
        let path = self.token_key_path();
        let text = fs::read_to_string(&path).map_err(|source| self.file("read", &path, source))?;
        let reason = || "it is no key of tokens, which has 64 hexadecimal digits".to_owned();
        from_hex(text.trim()).ok_or_else(|| FolderError::Content { path, reason: reason() })
    }

    /// Names that are worth nothing any more.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn revoked(&self) -> Result<BTreeSet<String>, FolderError> {
        let path = self.revoked_path();
        match fs::read_to_string(&path) {
            Ok(text) => Ok(text.lines().map(str::trim).filter(|line| !line.is_empty()).map(str::to_owned).collect()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(BTreeSet::new()),
            Err(source) => Err(self.file("read", &path, source)),
        }
    }

    /// Refuses a name to which nothing can be issued any more.
    ///
    /// # Errors
    /// [`FolderError::Content`].
    pub fn refuse_revoked(&self, name: &str) -> Result<(), FolderError> {
        if !self.revoked()?.contains(name) {
            return Ok(());
        }
        let reason = format!(
            "it names {name}, so that nothing issued to it is worth anything: take it out, or issue to another name"
        );
        Err(FolderError::Content { path: self.revoked_path(), reason })
    }

    /// Takes everything from a name that was issued to it.
    ///
    /// # Errors
    /// [`FolderError`].
    pub fn revoke(&self, name: &str) -> Result<(), FolderError> {
        if !is_name(name) {
            return Err(FolderError::Name { name: name.to_owned() });
        }
        let mut names = self.revoked()?;
        names.insert(name.to_owned());
        let text = names.into_iter().collect::<Vec<_>>().join("\n") + "\n";
        self.write(&self.revoked_path(), text.as_bytes(), PUBLIC)
    }

    /// A certificate that the authority has signed, and its key, both PEM.
    fn signed(&self, params: &CertificateParams, of: &Path) -> Result<(String, String), FolderError> {
        let read = |path: &Path| fs::read_to_string(path).map_err(|source| self.file("read", path, source));
        let (authority, key) = (read(&self.authority())?, read(&self.authority_key())?);
        let key = KeyPair::from_pem(&key).map_err(|error| self.content(&self.authority_key(), &error))?;
        let issuer =
            Issuer::from_ca_cert_pem(&authority, key).map_err(|error| self.content(&self.authority(), &error))?;
        let own = KeyPair::generate().map_err(|error| self.content(of, &error))?;
        let certificate = params.signed_by(&own, &issuer).map_err(|error| self.content(of, &error))?;
        Ok((certificate.pem(), own.serialize_pem()))
    }

    fn write(&self, path: &Path, bytes: &[u8], mode: u32) -> Result<(), FolderError> {
        whole_file::write(path, bytes, mode).map_err(|source| self.file("write", path, source))
    }

    #[allow(clippy::unused_self)] // beside `content`
    fn file(&self, what: &'static str, path: &Path, source: io::Error) -> FolderError {
        FolderError::File { what, path: path.to_owned(), source }
    }

    #[allow(clippy::unused_self)] // beside `file`
    fn content(&self, path: &Path, error: &rcgen::Error) -> FolderError {
        FolderError::Content { path: path.to_owned(), reason: error.to_string() }
    }
}

fn params(name: &str, now: SystemTime, lasts: Duration) -> CertificateParams {
    let mut params = CertificateParams::default();
    params.distinguished_name.push(DnType::CommonName, name);
    params.not_before = (now - EARLIER).into();
    params.not_after = (now + lasts).into();
    params
}

/// An address or a name under which the daemon is reached.
fn alternative(host: &str) -> Result<SanType, rcgen::Error> {
    match host.parse::<IpAddr>() {
        Ok(address) => Ok(SanType::IpAddress(address)),
        Err(_) => host.to_owned().try_into().map(SanType::DnsName),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::who::{certificate, role::Role};
    use std::os::unix::fs::PermissionsExt as _;
    use tokio_rustls::rustls::pki_types::{CertificateDer, pem::PemObject as _};

    #[test]
    fn an_issued_certificate_says_name_and_roles_and_keys_are_their_owners() {
        let parent = tempfile::tempdir().unwrap();
        let folder = Folder::at(&parent.path().join("pki"));
        let now = SystemTime::now();
        folder.init(&["localhost".into(), "10.1.2.3".into(), "::1".into()], now).unwrap();
        let roles = Roles::of(&[Role::Device, Role::Viewer]);
        let day = Duration::from_hours(24);
        let (certificate, key) = folder.issue("left-arm", roles, day, now, parent.path()).unwrap();
        let der = CertificateDer::from_pem_file(&certificate).unwrap();
        let identity = certificate::identity(&der).unwrap();
        assert_eq!((identity.name.as_str(), identity.roles), ("left-arm", roles));
        let lasts_s = identity.until.duration_since(now).unwrap().as_secs_f64();
        assert!((lasts_s - day.as_secs_f64()).abs() < 2.0, "{lasts_s}");
        let own = CertificateDer::from_pem_file(folder.certificate()).unwrap();
        assert_eq!(certificate::identity(&own), None, "the daemon's own is nobody's");
        for secret in [key.clone(), folder.key(), folder.authority_key(), folder.token_key_path()] {
            let mode = fs::metadata(&secret).unwrap().permissions().mode();
            assert_eq!(mode & 0o777, 0o600, "{}", secret.display());
        }
        // Nothing is written over.
        let before = fs::read(&key).unwrap();
        assert!(folder.issue("left-arm", roles, day, now, parent.path()).is_err());
        assert_eq!(fs::read(&key).unwrap(), before);
        let (authority, token_key) = (fs::read(folder.authority()).unwrap(), folder.token_key().unwrap());
        folder.init(&["heart.example".into()], now).unwrap();
        assert_eq!((fs::read(folder.authority()).unwrap(), folder.token_key().unwrap()), (authority, token_key));
        assert!(folder.issue("../root", roles, day, now, parent.path()).is_err());
        assert!(folder.revoke("a b").is_err());
        folder.revoke("left-arm").unwrap();
        let again = tempfile::tempdir().unwrap();
        assert!(folder.issue("left-arm", roles, day, now, again.path()).unwrap_err().to_string().contains("revoked"));
        // Where the authority's key is kept elsewhere, no other authority takes its place.
        fs::rename(folder.authority_key(), again.path().join("ca.key")).unwrap();
        assert!(folder.init(&["localhost".into()], now).unwrap_err().to_string().contains("ca.key"));
        folder.revoke("anna").unwrap();
        assert_eq!(folder.revoked().unwrap().into_iter().collect::<Vec<_>>(), ["anna", "left-arm"]);
    }

    #[test]
    fn a_folder_without_keys_says_how_to_get_some() {
        let empty = tempfile::tempdir().unwrap();
        let folder = Folder::at(empty.path());
        let error = folder.token_key().unwrap_err();
        assert!(error.to_string().contains("token.key") && error.help().unwrap().to_string().contains("pki init"));
        fs::write(folder.token_key_path(), "abc").unwrap();
        assert!(folder.token_key().unwrap_err().to_string().contains("64 hexadecimal digits"));
    }
}
