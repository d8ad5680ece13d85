//! Who may do what: identities by certificate or token, their roles, and one table of calls by role.
//!
//! Without a folder of keys ([`folder`]) whoever reaches the daemon may do everything: that is for one machine, or a network that is
//! trusted. With one, every call needs an identity; [`table`] denies what it does not name.
pub mod certificate;
pub mod commands;
pub mod folder;
pub mod gate;
pub mod keeper;
pub mod role;
pub mod table;
pub mod token;

use role::Roles;
use std::time::SystemTime;

/// Somebody who is known.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Who: as issued.
    pub name: String,
    /// What for.
    pub roles: Roles,
    /// Until when.
    pub until: SystemTime,
}

/// Names are for logs and file names: 1 to 64 letters, digits, `-` and `_`.
pub fn is_name(text: &str) -> bool {
    (1..=64).contains(&text.len()) && text.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_')
}
