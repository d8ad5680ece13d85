//! Commands that the documents and the programs' own help quote: the programs take them, and the files are there.
#![allow(clippy::unwrap_used)] // a test that cannot read the repository has failed
use palpate_system_tests::{programs::path_of, root};
use std::{collections::BTreeMap, fs, process::Command};

const PROGRAMS: [&str; 3] = ["palpated", "palpate-view", "palpate-bridge"];

/// A command as written, and where.
#[derive(Debug)]
struct Quoted {
    place: String,
    words: Vec<String>,
}

impl Quoted {
    fn new(place: &str, line: &str) -> Option<Self> {
        let command = line.split(" #").next().unwrap_or_default().split(" > ").next().unwrap_or_default();
        let words: Vec<String> = command.split_whitespace().map(str::to_owned).collect();
        (!words.is_empty()).then(|| Self { place: format!("{place}: {line}"), words })
    }
}

fn documents() -> Vec<String> {
    let listed = Command::new("git").args(["ls-files", "*.md"]).current_dir(root()).output().unwrap();
    assert!(listed.status.success());
    String::from_utf8(listed.stdout).unwrap().lines().map(str::to_owned).collect()
}

/// Lines of shell blocks, and code within a line that begins with one of the programs.
fn quoted_in(document: &str) -> Vec<Quoted> {
    let text = fs::read_to_string(root().join(document)).unwrap();
    let mut block: Option<&str> = None;
    let mut found = Vec::new();
    for line in text.lines() {
        if let Some(language) = line.trim_start().strip_prefix("```") {
            block = if block.is_some() { None } else { Some(language.trim()) };
        } else if let Some(language) = block {
            let ours = PROGRAMS.iter().any(|program| line.starts_with(&format!("{program} ")));
            // Blocks without a language also show output; `program   p50 …` is no command.
            if matches!(language, "sh" | "bash" | "console") || (language.is_empty() && ours && !line.contains("   ")) {
                found.extend(Quoted::new(document, line.trim_start_matches("$ ")));
            }
        } else {
            let code = line.split('`').skip(1).step_by(2);
            let ours = code.filter(|code| PROGRAMS.iter().any(|program| code.starts_with(&format!("{program} "))));
            found.extend(ours.filter_map(|code| Quoted::new(document, code)));
        }
    }
    found
}

/// What a program says of itself.
struct Help {
    main: String,
    /// Help of each subcommand.
    of: BTreeMap<String, String>,
}

fn help(program: &str) -> Help {
    let ask = |arguments: &[&str]| {
        let output = Command::new(path_of(program)).args(arguments).output().unwrap();
        assert!(output.status.success(), "{program} {arguments:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let main = ask(&["--help"]);
    let mut of = BTreeMap::new();
    for name in subcommands(&main) {
        let own = ask(&[&name, "--help"]);
        for below in subcommands(&own) {
            of.insert(format!("{name} {below}"), ask(&[&name, &below, "--help"]));
        }
        of.insert(name, own);
    }
    Help { main, of }
}

/// Names of subcommands that a help lists.
fn subcommands(help: &str) -> Vec<String> {
    let commands = help.split_once("Commands:\n").map_or("", |(_, rest)| rest.split("\n\n").next().unwrap_or_default());
    // Lines that are further in go on with what is said of the one before.
    let names = commands.lines().filter_map(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with(' '));
    let names = names.filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help");
    names.map(str::to_owned).collect()
}

fn examples(program: &str, help: &Help) -> Vec<Quoted> {
    let texts = std::iter::once(&help.main).chain(help.of.values());
    let lines = texts.flat_map(|text| text.lines()).filter_map(|line| line.strip_prefix("  "));
    let ours = lines.filter(|line| line.starts_with(&format!("{program} ")));
    // What stands behind two spaces explains.
    ours.filter_map(|line| Quoted::new("--help", line.split("  ").next().unwrap_or_default())).collect()
}

fn names(text: &str, flag: &str) -> bool {
    text.split(|c: char| !(c.is_alphanumeric() || c == '-')).any(|word| word == flag)
}

/// Subcommand and flags against the program's help; scenes against the built-in ones and the repository.
fn check_ours(quoted: &Quoted, help: &Help, builtin: &[String]) {
    let (program, arguments) = quoted.words.split_first().unwrap();
    // The longest of them: `pki` has commands of its own.
    let count = (0..=2.min(arguments.len()))
        .rev()
        .find(|&n| n == 0 || help.of.contains_key(&arguments[..n].join(" ")))
        .unwrap_or(0);
    let command = (count > 0).then(|| arguments[..count].join(" "));
    let text = command.as_ref().map_or(&help.main, |command| &help.of[command]);
    let takes_scenes = program == "palpated" && count < 2;
    // Only palpated has a default command, and its argument is a scene.
    let plain = arguments.first().is_some_and(|word| !word.starts_with('-'));
    assert!(command.is_some() || !plain || takes_scenes, "{}: no such command", quoted.place);
    let operands = &arguments[count..];
    for (index, word) in operands.iter().enumerate() {
        if word.starts_with('-') {
            let flag = word.split('=').next().unwrap();
            assert!(flag == "--help" || names(text, flag), "{}: {flag} is not in the help", quoted.place);
        } else if takes_scenes && index == 0 {
            let known = builtin.contains(word) || root().join(word).is_file();
            // Names in capitals, and scenes of the reader's own, stand for something.
            let placeholder = word.starts_with("my") || word.chars().all(|c| c.is_uppercase() || c == '_');
            assert!(known || placeholder, "{}: there is no scene {word}", quoted.place);
        }
    }
}

/// Programs of the repository, packages and tests that cargo is told to use.
fn check_other(quoted: &Quoted, packages: &BTreeMap<String, Vec<String>>) {
    let words = &quoted.words;
    if words[0].contains('/') && !words[0].starts_with('/') {
        assert!(root().join(&words[0]).is_file(), "{}: no such file", quoted.place);
    }
    if words[0] != "cargo" {
        return;
    }
    let after = |flag: &'static str| words.windows(2).filter(move |pair| pair[0] == flag).map(|pair| pair[1].as_str());
    let concrete = |word: &&str| !word.chars().all(char::is_uppercase);
    for package in after("-p").filter(concrete) {
        let targets = packages.get(package);
        assert!(targets.is_some(), "{}: no package {package}", quoted.place);
        for target in after("--test").chain(after("--bench")).chain(after("--example")).filter(concrete) {
            assert!(targets.unwrap().iter().any(|known| known == target), "{}: no target {target}", quoted.place);
        }
    }
}

fn packages() -> BTreeMap<String, Vec<String>> {
    let metadata = cargo_metadata::MetadataCommand::new().manifest_path(root().join("Cargo.toml")).no_deps().exec();
    let of = |package: cargo_metadata::Package| {
        (package.name.to_string(), package.targets.into_iter().map(|target| target.name).collect())
    };
    metadata.unwrap().packages.into_iter().map(of).collect()
}

#[test]
fn quoted_commands_are_taken_by_the_programs() {
    let helps: BTreeMap<&str, Help> = PROGRAMS.into_iter().map(|program| (program, help(program))).collect();
    let listed = Command::new(path_of("palpated")).args(["check", "--list"]).output().unwrap();
    let builtin: Vec<String> = String::from_utf8(listed.stdout).unwrap().lines().map(str::to_owned).collect();
    let packages = packages();
    let mut quoted: Vec<Quoted> = documents().iter().flat_map(|document| quoted_in(document)).collect();
    for (program, help) in &helps {
        quoted.extend(examples(program, help));
    }
    let mut ours = BTreeMap::from(PROGRAMS.map(|program| (program, 0)));
    for command in &quoted {
        match helps.get_key_value(command.words[0].as_str()) {
            Some((program, help)) => {
                check_ours(command, help, &builtin);
                *ours.get_mut(program).unwrap() += 1;
            }
            None => check_other(command, &packages),
        }
    }
    println!("{} commands, of ours {ours:?}", quoted.len());
    assert!(ours["palpated"] >= 10 && ours["palpate-view"] >= 4 && ours["palpate-bridge"] >= 1, "{ours:?}");
}
