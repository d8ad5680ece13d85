//! The house is a ladder: each folder of the crate uses only those below it, and no kind of body knows another.
#![allow(clippy::unwrap_used)]
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// The rungs, the lowest first. A star stands for every folder there: none of these uses another.
const LADDER: [&str; 17] = [
    "hash",
    "settings",
    "linalg",
    "lanes",
    "mesh",
    "material",
    "elements",
    "kernels",
    "contact",
    "tick",
    "bodies/*",
    "bodies",
    "integrate",
    "world",
    "snapshot",
    "statics",
    "lib",
];

/// Where a file is on the ladder.
#[derive(Debug, PartialEq)]
struct Rung {
    number: usize,
    /// The folder that a star stands for.
    folder: String,
}

/// The rung that a path in the source folder, or a module path joined by `/`, belongs to.
fn rung_of(path: &str) -> Option<Rung> {
    let parts: Vec<&str> = path.split('/').collect();
    let of_star = |rung: &str| {
        let above = rung.strip_suffix("/*")?;
        let folder = format!("{above}/{}", parts.get(1).filter(|_| parts[0] == above)?);
        source_root().join(&folder).is_dir().then_some(folder)
    };
    let folder = |rung: &str| of_star(rung).or_else(|| (parts[0] == rung).then(|| rung.to_owned()));
    LADDER.iter().enumerate().find_map(|(number, rung)| folder(rung).map(|folder| Rung { number, folder }))
}

fn source_root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|ending| ending == "rs") {
            found.push(path);
        }
    }
}

/// The text without comments, and without what only tests see: they may use what they like.
fn product_part(text: &str) -> String {
    let is_inline =
        |(at, mark): &(usize, &str)| text[at + mark.len()..].lines().next().is_some_and(|l| l.contains('{'));
    let end = text.match_indices("#[cfg(test)]\n").find(is_inline).map_or(text.len(), |(at, _)| at);
    text[..end].lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Every `crate::…` and `super::…` path that the text of a module names, in `use` trees and in code, from the crate's root, its parts joined by `/`.
fn named_paths(module: &str, text: &str) -> BTreeSet<String> {
    let mut paths = BTreeSet::new();
    let is_word = |at: usize| text[..at].ends_with(|c: char| c.is_alphanumeric() || "_$:".contains(c));
    for (at, mark) in text.match_indices("crate::").filter(|(at, _)| !is_word(*at)) {
        expand(&mut text[at + mark.len()..].chars().peekable(), "", &mut paths);
    }
    for (at, _) in text.match_indices("super::").filter(|(at, _)| !is_word(*at)) {
        let (mut rest, mut base) = (&text[at..], module);
        while let Some(behind) = rest.strip_prefix("super::") {
            rest = behind;
            base = base.rsplit_once('/').map_or("", |(above, _)| above);
        }
        expand(&mut rest.chars().peekable(), base, &mut paths);
    }
    paths
}

/// Walks a use tree behind a prefix; each leaf is a path.
fn expand(rest: &mut std::iter::Peekable<std::str::Chars<'_>>, prefix: &str, paths: &mut BTreeSet<String>) {
    let mut path = prefix.to_owned();
    loop {
        let mut word = String::new();
        while let Some(c) = rest.next_if(|c| c.is_alphanumeric() || *c == '_') {
            word.push(c);
        }
        if !word.is_empty() {
            path = if path.is_empty() { word } else { format!("{path}/{word}") };
        }
        match rest.peek() {
            Some(':') => {
                rest.next();
            }
            Some('{') => {
                rest.next();
                loop {
                    while rest.next_if(|c| c.is_whitespace() || *c == ',').is_some() {}
                    if rest.next_if_eq(&'}').is_some() || rest.peek().is_none() {
                        return;
                    }
                    expand(rest, &path, paths);
                    // What is left of a leaf, as an alias.
                    while rest.next_if(|c| !matches!(c, ',' | '}')).is_some() {}
                }
            }
            _ => {
                paths.insert(path);
                return;
            }
        }
    }
}

/// What is wrong with the paths that a file of a rung names.
fn faults(file: &str, text: &str) -> Vec<String> {
    let module = file.trim_end_matches(".rs").trim_end_matches("/mod");
    let Some(own) = rung_of(module) else { return vec![format!("{file} is on no rung of the ladder")] };
    let mut faults = Vec::new();
    for path in named_paths(module, &product_part(text)) {
        // Names that the crate's root shows again are asked for where they are.
        let Some(other) = rung_of(&path) else {
            faults.push(format!("{file} uses crate::{}, which is no folder", path.replace('/', "::")));
            continue;
        };
        let beside = own.number == other.number && own.folder != other.folder;
        if other.number > own.number || beside {
            faults.push(format!("{file} ({}) uses crate::{} ({})", own.folder, path.replace('/', "::"), other.folder));
        }
    }
    faults
}

#[test]
fn every_folder_uses_only_those_below_it() {
    let root = source_root();
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 150, "{} files", files.len());
    let mut wrong = BTreeMap::new();
    for path in files {
        let file = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        // Helpers of tests, like tests, may use what they like.
        if file == "lib.rs" || file.starts_with("testing/") || file.contains("/testing") || file.contains("/tests") {
            continue;
        }
        let found = faults(&file, &fs::read_to_string(&path).unwrap());
        if !found.is_empty() {
            wrong.insert(file, found);
        }
    }
    let all: Vec<String> = wrong.into_values().flatten().collect();
    assert!(all.is_empty(), "{} arrows run up the ladder:\n{}", all.len(), all.join("\n"));
}

#[test]
fn an_arrow_up_is_seen_however_it_is_written() {
    for text in [
        "use crate::world::Model;",
        "use crate::{\n    mesh::Surface,\n    bodies::{Body, tet::TetBody},\n};",
        "fn f() { crate::statics::solve() }",
        "use crate::{mesh::{self, tet::EDGES as E}, integrate::Pace};",
    ] {
        assert_eq!(faults("contact/mod.rs", text).len(), if text.contains("Body, tet") { 2 } else { 1 }, "{text}");
    }
    assert_eq!(faults("bodies/tet/body.rs", "use crate::bodies::seed::SeedModel;").len(), 1);
    assert_eq!(faults("bodies/tet/body.rs", "use crate::bodies::Body;").len(), 1);
    assert!(faults("bodies/tet/body.rs", "use crate::{bodies::tet::modes, tick::Tick};").is_empty());
    assert!(faults("bodies/stepped.rs", "use crate::bodies::seed::SteppedSeed;").is_empty());
    assert!(faults("contact/mod.rs", "// use crate::world::Model;\nuse crate::mesh::Surface;").is_empty());
    assert!(
        faults("contact/mod.rs", "use crate::mesh::Surface;\n#[cfg(test)]\nmod tests { use crate::world::Model; }")
            .is_empty()
    );
    // So are relative paths: `super` of a folder's own file is the crate's root.
    assert_eq!(faults("contact/mod.rs", "use super::world::Model;").len(), 1);
    assert_eq!(faults("contact/narrow/mod.rs", "use super::super::{mesh::Surface, statics::solve};").len(), 1);
    assert_eq!(faults("bodies/tet/body.rs", "use super::super::seed::SeedModel;").len(), 1);
    assert!(faults("bodies/tet/body.rs", "use super::modes::Mode;").is_empty());
    // What follows the declaration of a file of helpers is product code again.
    let after = "#[cfg(test)]\npub(crate) mod testing;\npub use crate::world::Model;";
    assert_eq!(faults("contact/mod.rs", after).len(), 1);
    assert_eq!(faults("attic/mod.rs", "").len(), 1);
    // A kind of body is a folder, whichever there are.
    for kind in ["tet", "hybrid", "mass_spring", "seed"] {
        assert_eq!(rung_of(&format!("bodies/{kind}/mod")).unwrap().folder, format!("bodies/{kind}"));
    }
    assert_eq!(rung_of("bodies/stepped").unwrap().folder, "bodies");
}
