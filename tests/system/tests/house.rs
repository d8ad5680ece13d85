//! The house's rules: crate borders, the map, unsafe code.
#![allow(clippy::unwrap_used)] // a test that cannot read the repository has failed
#![allow(clippy::case_sensitive_file_extension_comparisons)] // git's paths
use cargo_metadata::{DependencyKind, MetadataCommand};
use palpate_system_tests::root;
use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::Path,
    process::Command,
};

/// Who may use whom (ARCHITECTURE.md, "Crate borders"); development dependencies are free.
const BORDERS: [(&str, &[&str]); 11] = [
    ("palpate-proto", &[]),
    ("palpate-physics", &[]),
    ("palpate-control", &[]),
    ("palpate-realtime", &[]),
    ("palpate-scene", &["palpate-physics"]),
    ("palpated", &["palpate-scene", "palpate-physics", "palpate-control", "palpate-realtime", "palpate-proto"]),
    ("palpate-bridge", &["palpate-control", "palpate-realtime", "palpate-proto"]),
    ("palpate-view", &["palpate-proto"]),
    ("palpate-lab", &["palpate-physics", "palpate-realtime", "palpate-scene"]),
    ("palpate-system-tests", &[]),
    ("palpate-mock-libhd", &[]),
];

/// Crates that must stay free of the network, however indirectly.
const PURE: [&str; 4] = ["palpate-physics", "palpate-control", "palpate-realtime", "palpate-scene"];
const NETWORK: [&str; 5] = ["tokio", "tonic", "prost", "hyper", "axum"];

/// Normal and build dependencies of every package reachable from the workspace, by package name.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let metadata = MetadataCommand::new().manifest_path(root().join("Cargo.toml")).exec().unwrap();
    let names: BTreeMap<_, _> = metadata.packages.iter().map(|p| (p.id.clone(), p.name.to_string())).collect();
    let resolve = metadata.resolve.unwrap();
    resolve
        .nodes
        .iter()
        .map(|node| {
            let used = node
                .deps
                .iter()
                .filter(|dep| dep.dep_kinds.iter().any(|kind| kind.kind != DependencyKind::Development))
                .map(|dep| names[&dep.pkg].clone())
                .collect();
            (names[&node.id].clone(), used)
        })
        .collect()
}

#[test]
fn crates_use_only_whom_the_map_allows() {
    let dependencies = dependencies();
    for (name, allowed) in BORDERS {
        let ours: Vec<_> = dependencies[name].iter().filter(|d| d.starts_with("palpate")).collect();
        for used in ours {
            assert!(allowed.contains(&used.as_str()), "{name} uses {used}, which ARCHITECTURE.md does not allow");
        }
    }
    let ours = dependencies.keys().filter(|name| name.starts_with("palpate")).count();
    assert_eq!(ours, BORDERS.len(), "a crate is missing from the borders");
}

#[test]
fn pure_crates_never_reach_the_network() {
    let dependencies = dependencies();
    for name in PURE {
        let mut reached = BTreeSet::new();
        let mut open = vec![name.to_owned()];
        while let Some(next) = open.pop() {
            if reached.insert(next.clone()) {
                open.extend(dependencies[&next].iter().cloned());
            }
        }
        for forbidden in NETWORK {
            assert!(!reached.contains(forbidden), "{name} reaches {forbidden}");
        }
    }
}

/// Every path in backticks in ARCHITECTURE.md that looks like a file or folder exists.
#[test]
fn the_map_names_only_what_exists() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let paths: Vec<&str> = text
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|word| word.contains('/') && !word.contains([' ', ':', '<', '*', '(']))
        .collect();
    assert!(paths.len() > 40, "the map names only {} paths", paths.len());
    let missing: Vec<_> = paths.iter().filter(|path| !root().join(path).exists()).collect();
    assert!(missing.is_empty(), "ARCHITECTURE.md names what does not exist: {missing:?}");
}

/// Documents name source files by the end of their path; files move, and what is written about them stays behind.
#[test]
fn documents_name_only_source_files_that_exist() {
    let paths = tracked();
    let exists = |name: &str| paths.iter().any(|path| path == name || path.ends_with(&format!("/{name}")));
    let (mut named, mut missing) = (0, Vec::new());
    for document in paths.iter().filter(|path| path.ends_with(".md")) {
        let text = fs::read_to_string(root().join(document)).unwrap();
        let words = text.split('`').skip(1).step_by(2);
        for word in words.filter(|word| word.ends_with(".rs") && !word.contains([' ', '<', '*', '\n'])) {
            named += 1;
            if !exists(word) {
                missing.push(format!("{document}: {word}"));
            }
        }
    }
    assert!(named > 100, "only {named} files are named");
    assert!(missing.is_empty(), "documents name what does not exist: {missing:#?}");
}

/// The reverse: every source folder and every crate's top-level file has its place on the map.
#[test]
fn every_module_is_on_the_map() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    let missing: Vec<String> = tracked()
        .iter()
        .filter(|path| path.ends_with(".rs") && path.contains("/src/"))
        .filter_map(|path| Path::new(path).parent()?.to_str().map(str::to_owned))
        .collect::<BTreeSet<_>>()
        .into_iter()
        .filter(|folder| !text.contains(&format!("`{folder}")))
        .collect();
    assert!(missing.is_empty(), "folders that ARCHITECTURE.md does not name: {missing:?}");
}

/// `unsafe` lives in three named places, and in the C library that stands in libHD's place for tests of the third.
#[test]
fn unsafe_stays_in_its_named_places() {
    let allowed = [
        "server/realtime/src/os.rs",
        "server/physics/src/lanes/",
        "device-bridge/src/device/phantom/ffi.rs",
        "tests/mock-libhd/src/",
    ];
    for path in tracked().iter().filter(|p| p.ends_with(".rs") && !p.starts_with("tests/system/tests/house")) {
        let text = fs::read_to_string(root().join(path)).unwrap();
        let used = text.lines().any(|line| {
            let code = line.split("//").next().unwrap_or("");
            ["unsafe {", "unsafe fn", "unsafe impl", "unsafe extern", "unsafe("].iter().any(|form| code.contains(form))
        });
        assert!(!used || allowed.iter().any(|place| path.starts_with(place)), "unsafe in {path}");
    }
}

/// Which kind a body is, is asked in the rooms of the kinds: `bodies` of the physics and of the daemon, `compile/kinds` of the scenes. Elsewhere
/// only these do: implicit integrators are of tetrahedra alone, and the solver at rest and natural modes are of some kinds.
#[test]
fn the_kind_of_a_body_is_asked_in_its_rooms() {
    let rooms = ["server/physics/src/bodies/", "server/daemon/src/bodies/", "server/scene/src/compile/kinds/"];
    let allowed = [("server/physics/src/integrate/scheme.rs", 3), ("server/physics/src/statics/mod.rs", 3)];
    // A kind is a folder of `bodies`, in snake case; its variants are in camel case.
    let folders: BTreeSet<String> = tracked()
        .iter()
        .filter_map(|path| path.strip_prefix(rooms[0])?.split_once('/').map(|(folder, _)| folder.to_owned()))
        .collect();
    assert!(folders.len() >= 4, "{folders:?}");
    let camel =
        |folder: &String| -> String { folder.split('_').map(|word| word[..1].to_uppercase() + &word[1..]).collect() };
    let kinds: Vec<String> = folders.iter().map(camel).collect();
    let enumerations = ["Body", "BodySpec", "BodyState", "BodyScratch", "SteppedBody", "Kind"];
    let variants = enumerations.iter().flat_map(|of| kinds.iter().map(move |kind| format!("{of}::{kind}")));
    let accessors = folders.iter().flat_map(|kind| [format!("as_{kind}("), format!("as_{kind}_mut(")]);
    let questions: Vec<String> = variants.chain(accessors).collect();
    let product = |path: &&String| {
        ["physics", "scene", "daemon"].iter().any(|name| path.starts_with(&format!("server/{name}/src/")))
            && path.ends_with(".rs")
            && !path.contains("/test")
            && !path.ends_with("/tests.rs")
            && !rooms.iter().any(|room| path.starts_with(room))
    };
    let mut found = Vec::new();
    for path in tracked().iter().filter(product) {
        let text = fs::read_to_string(root().join(path)).unwrap();
        let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
        let asks = |line: &&str| questions.iter().any(|question| line.contains(question.as_str()));
        let lines = text[..end].lines().filter(|line| !line.trim_start().starts_with("//")).filter(asks).count();
        if lines > 0 {
            found.push((path.clone(), lines));
        }
    }
    let expected: Vec<(String, usize)> = allowed.map(|(path, lines)| (path.to_owned(), lines)).into();
    assert_eq!(found, expected, "lines that ask for the kind of a body");
}

/// A folder of modules has its module's file inside, `mod.rs`: one style, and a folder is moved with all that it has.
#[test]
fn the_file_of_a_module_with_a_folder_is_in_the_folder() {
    let paths = tracked();
    let folders: BTreeSet<&str> = paths
        .iter()
        .filter(|path| path.ends_with(".rs"))
        .filter_map(|path| path.rsplit_once('/'))
        .map(|(f, _)| f)
        .collect();
    let beside = |path: &&String| path.strip_suffix(".rs").is_some_and(|module| folders.contains(module));
    let strangers: Vec<_> = paths.iter().filter(beside).collect();
    assert!(strangers.is_empty(), "these belong into their folders as mod.rs: {strangers:?}");
}

/// LLVM 22 compiles plain arithmetic of the physics wrongly where it packs it into vectors (`docs/adr/no-slp.md`). Tests of physics see that in the build
/// that they are of, and in no other.
#[test]
fn plain_arithmetic_is_not_packed_into_vectors() {
    let config: toml::Table = fs::read_to_string(root().join(".cargo/config.toml")).unwrap().parse().unwrap();
    let flags = config["build"]["rustflags"].as_array().unwrap();
    let words: Vec<&str> = flags.iter().filter_map(toml::Value::as_str).collect();
    assert!(words.windows(2).any(|pair| pair == ["-C", "no-vectorize-slp"]), "{words:?}");
}

/// The top level is given: nothing else is committed there.
#[test]
fn the_top_level_holds_only_what_belongs_there() {
    let allowed = [
        ".cargo",
        ".ci",
        ".gitattributes",
        ".gitignore",
        "ARCHITECTURE.md",
        "CHANGELOG.md",
        "CONTRIBUTING.md",
        "Cargo.lock",
        "Cargo.toml",
        "LICENSE",
        "README.md",
        "client-viewer",
        "clippy.toml",
        "deny.toml",
        "deploy",
        "device-bridge",
        "docs",
        "proto",
        "rustfmt.toml",
        "server",
        "tests",
    ];
    let found: BTreeSet<String> =
        tracked().iter().filter_map(|path| path.split('/').next().map(str::to_owned)).collect();
    let strangers: Vec<_> = found.iter().filter(|name| !allowed.contains(&name.as_str())).collect();
    assert!(strangers.is_empty(), "at the top level: {strangers:?}");
}

fn tracked() -> Vec<String> {
    let output = Command::new("git").arg("ls-files").current_dir(root()).output().unwrap();
    String::from_utf8(output.stdout).unwrap().lines().map(str::to_owned).collect()
}
