//! Tokens: for scripts, and for browsers. They are macaroons (Birgisson et al., "Macaroons: Cookies with Contextual Caveats for
//! Decentralized Authorization in the Cloud", NDSS 2014): whoever has one makes a narrower one of it, without any key and without
//! asking anybody; nobody makes a wider one.
//!
//! ```text
//! palpate1.name=anna.role=viewer+injector.until=1798761600.<64 hexadecimal digits>
//! ```
//!
//! Each part between dots is a condition, and all of them hold: roles are those that every `role` names, and the end is the
//! earliest. With conditions c₁ … cₙ and the daemon's key k the digits are mₙ, where m₀ = HMAC(k, "palpate1") and
//! mᵢ = HMAC(mᵢ₋₁, cᵢ), HMAC being HMAC-SHA256 (RFC 2104). Adding cₙ₊₁ takes mₙ, which the token shows; taking cₙ away
//! takes mₙ₋₁, which it does not.
use super::{Identity, is_name, role::Roles};
use ring::hmac;
use std::{
    fmt::Write as _,
    time::{Duration, SystemTime, UNIX_EPOCH},
};
use thiserror::Error;

/// Bytes of the daemon's key.
pub const KEY_BYTES: usize = 32;
const VERSION: &str = "palpate1";
/// A token of more bytes is not looked at.
const MOST_BYTES: usize = 1024;

/// Why a token is worth nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum TokenError {
    /// Its form is not that of a token.
    #[error("it is no token: one looks like palpate1.name=NAME.role=ROLE.until=TIME.<64 digits>")]
    Form,
    /// A condition that this version does not know: it cannot be seen whether it holds.
    #[error("it has a condition that this version does not know")]
    Unknown,
    /// Not made by this daemon's key, or changed since.
    #[error("it was not made with this daemon's key")]
    Forged,
    /// It is over.
    #[error("it has ended")]
    Ended,
    /// Its conditions leave nothing.
    #[error("its conditions leave no role")]
    Nothing,
}

/// A new token.
pub fn mint(key: &[u8; KEY_BYTES], identity: &Identity) -> String {
    let conditions = [
        format!("name={}", identity.name),
        format!("role={}", identity.roles),
        format!("until={}", unix_s(identity.until)),
    ];
    extend(VERSION.to_owned(), start(key), &conditions)
}

/// A token of an existing one, with fewer roles or an earlier end. It has to be in form; whether it is genuine only the daemon sees.
///
/// # Errors
/// [`TokenError::Form`], or [`TokenError::Unknown`].
pub fn narrow(token: &str, roles: Option<Roles>, until: Option<SystemTime>) -> Result<String, TokenError> {
    let Parts { conditions, mac } = parts(token)?;
    let added = [roles.map(|roles| format!("role={roles}")), until.map(|until| format!("until={}", unix_s(until)))];
    let text = std::iter::once(VERSION).chain(conditions).collect::<Vec<_>>().join(".");
    Ok(extend(text, mac, &added.into_iter().flatten().collect::<Vec<_>>()))
}

/// Whose token it is, and what for.
///
/// # Errors
/// [`TokenError`].
pub fn read(key: &[u8; KEY_BYTES], token: &str, now: SystemTime) -> Result<Identity, TokenError> {
    let Parts { conditions, mac } = parts(token)?;
    let Some((last, others)) = conditions.split_last() else { return Err(TokenError::Form) };
    let before_last = others.iter().fold(start(key), |mac, condition| step(&mac, condition));
    // In a time that tells nothing of where they differ.
    hmac::verify(&hmac::Key::new(hmac::HMAC_SHA256, &before_last), last.as_bytes(), &mac)
        .map_err(|_| TokenError::Forged)?;
    let identity = meaning(&conditions)?;
    if now >= identity.until {
        return Err(TokenError::Ended);
    }
    if identity.roles.is_empty() {
        return Err(TokenError::Nothing);
    }
    Ok(identity)
}

/// Whose token it says it is; whether that is true only the daemon sees.
///
/// # Errors
/// [`TokenError::Form`] or [`TokenError::Unknown`].
pub fn claimed(token: &str) -> Result<Identity, TokenError> {
    meaning(&parts(token)?.conditions)
}

type Mac = [u8; KEY_BYTES];

struct Parts<'a> {
    conditions: Vec<&'a str>,
    mac: Mac,
}

fn parts(token: &str) -> Result<Parts<'_>, TokenError> {
    if token.len() > MOST_BYTES {
        return Err(TokenError::Form);
    }
    let mut words: Vec<&str> = token.split('.').collect();
    let mac = words.pop().and_then(from_hex).ok_or(TokenError::Form)?;
    if words.len() < 2 || words.remove(0) != VERSION {
        return Err(TokenError::Form);
    }
    meaning(&words)?;
    Ok(Parts { conditions: words, mac })
}

/// What conditions mean together: a name first and once, at least one set of roles, at least one end.
fn meaning(conditions: &[&str]) -> Result<Identity, TokenError> {
    let (mut name, mut roles, mut until_s) = (None, None, None);
    for (index, condition) in conditions.iter().enumerate() {
        match condition.split_once('=').ok_or(TokenError::Form)? {
            ("name", text) if index == 0 && is_name(text) => name = Some(text.to_owned()),
            ("role", text) => {
                let these: Roles = text.parse().map_err(|_| TokenError::Unknown)?;
                roles = Some(roles.map_or(these, |before: Roles| before.and(these)));
            }
            ("until", text) => {
                let this: u32 = text.parse().map_err(|_| TokenError::Form)?;
                until_s = Some(until_s.map_or(this, |before: u32| before.min(this)));
            }
            ("name", _) => return Err(TokenError::Form),
            _ => return Err(TokenError::Unknown),
        }
    }
    let (Some(name), Some(roles), Some(until_s)) = (name, roles, until_s) else { return Err(TokenError::Form) };
    Ok(Identity { name, roles, until: UNIX_EPOCH + Duration::from_secs(until_s.into()) })
}

fn start(key: &[u8; KEY_BYTES]) -> Mac {
    step(key, VERSION)
}

/// HMAC(mac, condition).
fn step(mac: &Mac, condition: &str) -> Mac {
    let tag = hmac::sign(&hmac::Key::new(hmac::HMAC_SHA256, mac), condition.as_bytes());
    let mut next = Mac::default();
    next.copy_from_slice(tag.as_ref());
    next
}

fn extend(mut text: String, mut mac: Mac, conditions: &[String]) -> String {
    for condition in conditions {
        mac = step(&mac, condition);
        text.push('.');
        text.push_str(condition);
    }
    text.push('.');
    text + &to_hex(&mac)
}

/// Hexadecimal digits.
pub fn to_hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// 32 bytes of 64 hexadecimal digits.
pub fn from_hex(text: &str) -> Option<[u8; KEY_BYTES]> {
    let digits: Vec<u8> = text.bytes().map(|b| (b as char).to_digit(16).map(|d| d as u8)).collect::<Option<_>>()?;
    let bytes: Vec<u8> = digits.chunks_exact(2).map(|pair| 16 * pair[0] + pair[1]).collect();
    (digits.len() == 2 * KEY_BYTES).then(|| bytes.try_into().ok()).flatten()
}

/// Whole seconds, within what a token can say (until the year 2106).
fn unix_s(time: SystemTime) -> u32 {
    let s = time.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_secs());
    u32::try_from(s).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::who::role::Role;
    use proptest::prelude::*;

    const KEY: [u8; KEY_BYTES] = [7; KEY_BYTES];

    fn at(s: u64) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(s)
    }

    fn anna() -> Identity {
        let roles = Roles::of(&[Role::Viewer, Role::Injector]);
        Identity { name: "anna".into(), roles, until: at(2000) }
    }

    #[test]
    fn a_token_says_whose_it_is_until_it_ends() {
        let token = mint(&KEY, &anna());
        assert!(token.starts_with("palpate1.name=anna.role=viewer+injector.until=2000."), "{token}");
        assert_eq!(read(&KEY, &token, at(1999)), Ok(anna()));
        assert_eq!(read(&KEY, &token, at(2000)), Err(TokenError::Ended));
        assert_eq!(read(&[8; KEY_BYTES], &token, at(1)), Err(TokenError::Forged));
        assert_eq!(claimed(&token), Ok(anna()));
    }

    #[test]
    fn a_token_can_be_narrowed_and_never_widened() {
        let token = mint(&KEY, &anna());
        let narrow_roles = Roles::of(&[Role::Viewer, Role::Operator]);
        let narrowed = narrow(&token, Some(narrow_roles), Some(at(1000))).unwrap();
        let viewer = Roles::of(&[Role::Viewer]);
        assert_eq!(read(&KEY, &narrowed, at(1)), Ok(Identity { roles: viewer, until: at(1000), ..anna() }));
        let later = narrow(&narrowed, Some(Roles::ALL), Some(at(9000))).unwrap();
        assert_eq!(read(&KEY, &later, at(1)), Ok(Identity { roles: viewer, until: at(1000), ..anna() }));
        let none = narrow(&narrowed, Some(Roles::of(&[Role::Device])), None).unwrap();
        assert_eq!(read(&KEY, &none, at(1)), Err(TokenError::Nothing));
        // Taking a condition away, or changing one, makes it worth nothing.
        let mac = narrowed.rsplit('.').next().unwrap();
        for changed in [
            format!("palpate1.name=anna.role=viewer+injector.until=2000.{mac}"),
            narrowed.replace("until=1000", "until=1001"),
            narrowed.replace("anna", "anne"),
            narrowed.replace("viewer+injector", "viewer+injector+operator"),
        ] {
            assert_eq!(read(&KEY, &changed, at(1)), Err(TokenError::Forged), "{changed}");
        }
    }

    #[test]
    fn what_is_no_token_is_said_to_be_none() {
        let mac = to_hex(&KEY);
        for (text, why) in [
            (String::new(), TokenError::Form),
            ("palpate1".into(), TokenError::Form),
            (format!("palpate1.{mac}"), TokenError::Form),
            (format!("palpate2.name=a.role=viewer.until=9.{mac}"), TokenError::Form),
            (format!("palpate1.role=viewer.name=a.until=9.{mac}"), TokenError::Form),
            (format!("palpate1.name=a.name=b.role=viewer.until=9.{mac}"), TokenError::Form),
            (format!("palpate1.name=a b.role=viewer.until=9.{mac}"), TokenError::Form),
            (format!("palpate1.name=a.role=viewer.{mac}"), TokenError::Form),
            (format!("palpate1.name=a.until=9.{mac}"), TokenError::Form),
            (format!("palpate1.name=a.role=root.until=9.{mac}"), TokenError::Unknown),
            (format!("palpate1.name=a.role=viewer.until=9.colour=red.{mac}"), TokenError::Unknown),
            (format!("palpate1.name=a.role=viewer.until=99999999999.{mac}"), TokenError::Form),
            (format!("palpate1.name=a.role=viewer.until=9.{mac}0"), TokenError::Form),
            (format!("palpate1.name=a{}.until=9.{mac}", ".role=viewer".repeat(100)), TokenError::Form),
        ] {
            assert_eq!(read(&KEY, &text, at(1)), Err(why), "{text}");
        }
    }

    proptest! {
        #[test]
        fn whatever_is_sent_is_read_without_panic_and_opens_nothing(text in "\\PC{0,200}") {
            prop_assert!(read(&KEY, &text, at(1)).is_err());
        }

        #[test]
        fn one_changed_byte_makes_a_token_worth_nothing(index in 0_usize..140, byte in 32_u8..127) {
            let token = mint(&KEY, &anna());
            let mut changed = token.clone().into_bytes();
            let index = index % changed.len();
            prop_assume!(!changed[index].eq_ignore_ascii_case(&byte));
            changed[index] = byte;
            let changed = String::from_utf8(changed).unwrap();
            prop_assert!(read(&KEY, &changed, at(1)).is_err(), "{}", changed);
        }
    }
}
