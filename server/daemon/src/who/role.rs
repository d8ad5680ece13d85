//! Roles: what an identity is for. One may have several.
use clap::ValueEnum;
use std::{fmt, str::FromStr};

/// What an identity is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Role {
    /// Watches: surface, status, the page
    Viewer,
    /// Injects forces, bounded, and watches
    Injector,
    /// Is an arm
    Device,
    /// Orders everything but to be an arm
    Operator,
}

impl Role {
    /// Every role, with its name in certificates and tokens.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Viewer, "viewer"),
        (Self::Injector, "injector"),
        (Self::Device, "device"),
        (Self::Operator, "operator"),
    ];

    const fn bit(self) -> u8 {
        1 << self as u8
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }
}

/// A set of roles; in text joined by `+`, such as `viewer+injector`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Roles(u8);

impl Roles {
    /// None.
    pub const NONE: Self = Self(0);
    /// All.
    pub const ALL: Self = Self::of(&[Role::Viewer, Role::Injector, Role::Device, Role::Operator]);

    /// These.
    pub const fn of(roles: &[Role]) -> Self {
        let (mut bits, mut i) = (0, 0);
        while i < roles.len() {
            bits |= roles[i].bit();
            i += 1;
        }
        Self(bits)
    }

    /// Whether one is among them.
    pub const fn has(self, role: Role) -> bool {
        self.0 & role.bit() != 0
    }

    /// Those that both have.
    #[must_use]
    pub const fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Those that either has.
    #[must_use]
    pub const fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether there are none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

impl fmt::Display for Roles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let names: Vec<&str> = Role::ALL.iter().filter(|(role, _)| self.has(*role)).map(|(_, name)| *name).collect();
        f.write_str(&names.join("+"))
    }
}

/// A word that is no role.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NoRole;

impl FromStr for Roles {
    type Err = NoRole;

    fn from_str(text: &str) -> Result<Self, NoRole> {
        text.split('+').try_fold(Self::NONE, |roles, word| {
            let (role, _) = Role::ALL.iter().find(|(_, name)| *name == word).ok_or(NoRole)?;
            Ok(roles.or(Self::of(&[*role])))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_written_as_they_are_read() {
        for (role, name) in Role::ALL {
            assert_eq!((role.name(), name.parse()), (name, Ok(Roles::of(&[role]))));
        }
        for bits in 1..16 {
            let roles = Roles(bits);
            assert_eq!(roles.to_string().parse(), Ok(roles));
        }
        for bad in ["", "viewer+", "Viewer", "root", "viewer operator"] {
            assert_eq!(bad.parse::<Roles>(), Err(NoRole), "{bad}");
        }
        assert_eq!(Roles::ALL.to_string(), "viewer+injector+device+operator");
    }
}
