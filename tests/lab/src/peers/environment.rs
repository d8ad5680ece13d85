//! A virtual environment of Python that belongs to the lab alone and can be thrown away: it is made anew when it is missing.
use std::{
    env,
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// An environment that exists. Errors are one line for people: what is missing and what to do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Environment {
    /// Its interpreter.
    pub python: PathBuf,
}

/// `palpate-lab-peers` in the user's cache folder, so that a second run installs nothing.
pub(super) fn default_folder() -> PathBuf {
    let cache = env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
    let cache = cache.or_else(|| Some(PathBuf::from(env::var_os("HOME")?).join(".cache")));
    cache.unwrap_or_else(env::temp_dir).join("palpate-lab-peers")
}

impl Environment {
    /// Makes it in `folder` with an interpreter, unless it is there.
    pub fn make(python: &str, folder: &Path) -> Result<Self, String> {
        let inside = folder.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
        if !inside.exists() {
            let mut venv = Command::new(python);
            run(venv.args(["-m", "venv"]).arg(folder), "install Python 3.11 or later with its venv module")?;
        }
        Ok(Self { python: inside })
    }

    /// Installs a package at a version, unless it is there.
    pub fn install(&self, (name, version): (&str, &str)) -> Result<(), String> {
        let mut ask = Command::new(&self.python);
        ask.args(["-c", "import importlib.metadata, sys; print(importlib.metadata.version(sys.argv[1]))", name]);
        let there = ask.output().is_ok_and(|output| output.stdout.trim_ascii() == version.as_bytes());
        if there {
            return Ok(());
        }
        let mut pip = Command::new(&self.python);
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).arg(format!("{name}=={version}"));
        run(&mut pip, "check the network and whether the package has this version for this Python").map(|_| ())
    }
}

fn run(command: &mut Command, advice: &str) -> Result<Output, String> {
    let words: Vec<_> = std::iter::once(command.get_program()).chain(command.get_args()).collect();
    let what = words.iter().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ");
    let output = command.output().map_err(|error| format!("`{what}` cannot be run ({error}); {advice}"))?;
    if output.status.success() {
        return Ok(output);
    }
    Err(format!("`{what}` failed: {}; {advice}", last_line(&String::from_utf8_lossy(&output.stderr))))
}

/// Where Python and pip say what was wrong.
pub(super) fn last_line(text: &str) -> &str {
    text.lines().rev().map(str::trim).find(|line| !line.is_empty()).unwrap_or("it does not say why")
}
