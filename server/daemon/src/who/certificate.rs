//! What a client's certificate says: its name is the subject's common name, its roles are URIs among its alternative names, such as
//! `palpate:role:viewer`. That the daemon's authority has signed it was seen in the handshake.
use super::{Identity, is_name, role::Roles};
use std::time::{Duration, UNIX_EPOCH};
use x509_parser::{extensions::GeneralName, prelude::FromDer as _, prelude::X509Certificate};

/// What stands before a role.
pub const ROLE_URI: &str = "palpate:role:";

/// Who it is; `None` for a certificate without a name or a role, such as the daemon's own.
pub fn identity(der: &[u8]) -> Option<Identity> {
    let (_, certificate) = X509Certificate::from_der(der).ok()?;
    let name = certificate.subject().iter_common_name().next()?.as_str().ok()?.to_owned();
    let names = certificate.subject_alternative_name().ok()??;
    let roles = names.value.general_names.iter().filter_map(|name| match name {
        GeneralName::URI(uri) => uri.strip_prefix(ROLE_URI)?.parse::<Roles>().ok(),
        _ => None,
    });
    let roles = roles.fold(Roles::NONE, Roles::or);
    let until_s = u64::try_from(certificate.validity().not_after.timestamp()).ok()?;
    let is_whole = is_name(&name) && !roles.is_empty();
    is_whole.then(|| Identity { name, roles, until: UNIX_EPOCH + Duration::from_secs(until_s) })
}
