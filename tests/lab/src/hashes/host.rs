//! What else than the code decides bits.
//!
//! - `sin` and `exp` are the C library's own, which chooses among versions of them by whether the processor has FMA.
//! - Direct solvers (equilibria, modes, and with them when a body sleeps) are faer's, whose sums are as wide as the processor's vectors.
//!
//! The physics' own kernels give the same bits on every instruction set.
use palpate_physics::lanes::InstructionSet;
use std::fs;

/// Where hashes were made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Host {
    /// Processor family, operating system, environment.
    pub target: String,
    /// The C library and its version.
    pub libc: String,
    /// What the processor has.
    pub processor: String,
}

impl Host {
    /// This machine.
    pub fn here() -> Self {
        let environment = if cfg!(target_env = "gnu") {
            "gnu"
        } else if cfg!(target_env = "musl") {
            "musl"
        } else if cfg!(target_env = "msvc") {
            "msvc"
        } else {
            "other"
        };
        let target = format!("{}-{}-{environment}", std::env::consts::ARCH, std::env::consts::OS);
        let vectors = match InstructionSet::best() {
            InstructionSet::Baseline => "baseline",
            InstructionSet::Avx2 => "avx2",
            InstructionSet::Avx512 => "avx512",
        };
        let processor = if has_fma() { format!("{vectors} fma") } else { vectors.into() };
        Self { target, libc: libc().unwrap_or_else(|| "unknown".into()), processor }
    }

    /// What makes hashes of another machine no measure for this one's; `None`: they are.
    pub fn differs_from(&self, other: &Self) -> Option<String> {
        let pairs = [
            ("target", &self.target, &other.target),
            ("C library", &self.libc, &other.libc),
            ("processor", &self.processor, &other.processor),
        ];
        let told: Vec<String> = pairs
            .into_iter()
            .filter(|(_, own, other)| own != other)
            .map(|(what, own, other)| format!("{what} \"{own}\" here, \"{other}\" there"))
            .collect();
        (!told.is_empty()).then(|| told.join("; "))
    }
}

#[cfg(target_arch = "x86_64")]
fn has_fma() -> bool {
    std::arch::is_x86_feature_detected!("fma")
}

#[cfg(not(target_arch = "x86_64"))]
fn has_fma() -> bool {
    // Every 64-bit ARM has it; nobody chooses by it there.
    false
}

/// Kind and version of the C library that this process runs with, as its file says.
fn libc() -> Option<String> {
    let maps = fs::read_to_string("/proc/self/maps").ok()?;
    let path = maps.lines().filter_map(|line| line.find('/').map(|at| &line[at..])).find(|path| {
        path.rsplit('/').next().is_some_and(|name| name.starts_with("libc.so") || name.starts_with("libc-"))
    })?;
    version_in(&fs::read(path).ok()?)
}

/// The version in "GNU C Library (…) stable release version 2.36."
fn version_in(bytes: &[u8]) -> Option<String> {
    const BANNER: &[u8] = b"GNU C Library (";
    const VERSION: &str = "release version ";
    let at = bytes.windows(BANNER.len()).position(|window| window == BANNER)?;
    let banner = String::from_utf8_lossy(&bytes[at..bytes.len().min(at + 200)]).into_owned();
    let after = &banner[banner.find(VERSION)? + VERSION.len()..];
    let version: String = after.chars().take_while(|c| c.is_ascii_digit() || *c == '.').collect();
    let version = version.trim_end_matches('.');
    (!version.is_empty()).then(|| format!("glibc {version}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_read_from_the_banner() {
        let banner = b"\0\x7fGNU C Library (Debian GLIBC 2.36-9+deb12u14) stable release version 2.36.\nCopyright";
        assert_eq!(version_in(banner).unwrap(), "glibc 2.36");
        assert_eq!(version_in(b"GNU C Library (cut"), None);
        assert_eq!(version_in(b"nothing"), None);
    }

    #[test]
    fn another_library_is_told_of_by_name() {
        let here = Host::here();
        assert_eq!(here.differs_from(&here), None);
        let there = Host { libc: "glibc 1.0".into(), ..here.clone() };
        assert!(here.differs_from(&there).unwrap().contains("glibc 1.0"));
    }
}
