//! The file: where the hashes were made, then a line per scene.
//!
//! ```text
//! target x86_64-linux-gnu
//! libc glibc 2.36
//! processor avx512 fma
//! block-press ticks=600/1200 model=0123456789abcdef 60=… 120=… … 600=… static=…
//! ```
use super::host::Host;
use miette::{Context, IntoDiagnostic, Result};
use palpate_physics::Chain;
use std::{
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
};

const ABOUT: &str = "\
# Hashes of every bit of every scene, made by `palpate-lab hashes --update`; without --update they are compared.
# A line: the scene, the ticks that are run and those there are; the hash of the model, of all ticks up to each of the ticks that are named,
# of the equilibrium and of the natural modes. Each tick's hash goes on from that of the tick before.
";

/// The hash of a part of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mark {
    /// A tick's number, or `model`, `static`, `modes`.
    pub label: String,
    /// The hash.
    pub hash: u64,
}

impl Mark {
    pub(super) fn new(label: impl Into<String>, chain: Chain) -> Self {
        Self { label: label.into(), hash: chain.value() }
    }

    /// The tick, where it is one.
    pub(super) fn tick(&self) -> Option<u64> {
        self.label.parse().ok()
    }
}

/// The hashes of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// The scene.
    pub name: String,
    /// Ticks that are run.
    pub ticks: u64,
    /// Ticks of the whole scene.
    pub of: u64,
    /// The hashes, the model's first, then those of ticks, ascending.
    pub marks: Vec<Mark>,
}

/// All of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Record {
    /// Where they were made.
    pub host: Host,
    /// The scenes.
    pub lines: Vec<Line>,
}

impl Line {
    fn parse(text: &str) -> Option<Self> {
        let mut words = text.split_whitespace();
        let name = words.next()?.to_owned();
        let (ticks, of) = words.next()?.strip_prefix("ticks=")?.split_once('/')?;
        let mark = |word: &str| {
            let (label, hash) = word.split_once('=')?;
            Some(Mark { label: label.to_owned(), hash: u64::from_str_radix(hash, 16).ok()? })
        };
        let marks = words.map(mark).collect::<Option<Vec<Mark>>>()?;
        Some(Self { name, ticks: ticks.parse().ok()?, of: of.parse().ok()?, marks })
    }

    fn write(&self, text: &mut String) {
        // Writing to a string cannot fail.
        let _ = write!(text, "{} ticks={}/{}", self.name, self.ticks, self.of);
        for Mark { label, hash } in &self.marks {
            let _ = write!(text, " {label}={hash:016x}");
        }
        text.push('\n');
    }
}

impl Record {
    /// Where it is kept.
    pub fn path() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("records/hashes.txt")
    }

    /// The text of the file.
    pub fn text(&self) -> String {
        let Host { target, libc, processor } = &self.host;
        let mut text = format!("{ABOUT}target {target}\nlibc {libc}\nprocessor {processor}\n");
        self.lines.iter().for_each(|line| line.write(&mut text));
        text
    }

    /// Reads the text of a file; `Err` is the line that is none.
    ///
    /// # Errors
    /// What is wrong, and in which line.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut host = Host { target: String::new(), libc: String::new(), processor: String::new() };
        let mut lines = Vec::new();
        let content = text.lines().zip(1..).filter(|(line, _)| !line.is_empty() && !line.starts_with('#'));
        for (line, number) in content {
            match line.split_once(' ') {
                Some(("target", value)) => value.clone_into(&mut host.target),
                Some(("libc", value)) => value.clone_into(&mut host.libc),
                Some(("processor", value)) => value.clone_into(&mut host.processor),
                _ => lines.push(Line::parse(line).ok_or_else(|| format!("line {number} is no scene's: {line}"))?),
            }
        }
        Ok(Self { host, lines })
    }

    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or is no record.
    pub fn read(path: &Path) -> Result<Self> {
        let told = || format!("cannot read {}; palpate-lab hashes --update makes it", path.display());
        let text = fs::read_to_string(path).into_diagnostic().wrap_err_with(told)?;
        Self::parse(&text).map_err(|what| miette::miette!("{}: {what}", path.display()))
    }

    /// Writes a file.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, path: &Path) -> Result<()> {
        fs::write(path, self.text()).into_diagnostic().wrap_err_with(|| format!("cannot write {}", path.display()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let mark = |label: &str, hash| Mark { label: label.into(), hash };
        let marks = vec![mark("model", 1), mark("60", u64::MAX), mark("static", 0)];
        let line = Line { name: "block/hand".into(), ticks: 60, of: 1200, marks };
        let record = Record { host: Host::here(), lines: vec![line.clone(), Line { name: "b".into(), ..line }] };
        assert_eq!(Record::parse(&record.text()).unwrap(), record);
    }

    #[test]
    fn a_line_that_is_none_is_named() {
        for bad in ["block", "block ticks=3", "block ticks=3/4 model=xyz", "block model=3"] {
            let told = Record::parse(&format!("# about\ntarget t\n{bad}\n")).unwrap_err();
            assert!(told.contains("line 3") && told.contains(bad), "{told}");
        }
    }
}
