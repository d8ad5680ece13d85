//! What the fuzzer asks of every parser (`fuzz/README.md`), of the committed messages and of seeded spoilt ones: here on stable Rust, and each time.
#[allow(unreachable_pub)] // for the fuzzer it is a crate
#[path = "../fuzz/src/lib.rs"]
mod bodies;

use proptest::{
    prelude::RngExt as _,
    test_runner::{RngAlgorithm, TestRng},
};
use std::{collections::BTreeSet, fs, path::Path};

/// Spoilt messages for each parser.
const SPOILT: usize = 3000;

/// Says what a parser was given when it fails.
struct Given<'a>(&'a str, &'a [u8]);

impl Drop for Given<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{} was given \"{}\"", self.0, self.1.escape_ascii());
        }
    }
}

/// What is committed: what a fuzzer on this machine has added has names of 40 digits.
fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut files: Vec<_> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.file_name().unwrap().len() != 40);
    files.sort_unstable();
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

/// What parsers fail on more often than on others, of either byte order and both lengths: not a number, infinity, the least and the largest.
const STRANGE: [&[u8]; 12] = [
    b"\x7f\xf8\0\0\0\0\0\0",
    b"\0\0\0\0\0\0\xf8\x7f",
    b"\xff\xf0\0\0\0\0\0\0",
    b"\0\0\0\0\0\0\xf0\xff",
    b"\x7f\xc0\0\0",
    b"\0\0\xc0\x7f",
    b"\xff\xff\xff\xff\xff\xff\xff\xff",
    b"\0\0\0\0\0\0\0\0",
    b"\x7f\xff\xff\xff",
    b"NaN",
    b"-1e999",
    b"65536",
];

/// Bytes changed, written over, put in, left out, twice, or followed by another message's.
fn spoil(bytes: &mut Vec<u8>, other: &[u8], rng: &mut TestRng) {
    for _ in 0..rng.random_range(1..4) {
        let at = rng.random_range(0..=bytes.len());
        let end = (at + rng.random_range(0..9_usize)).min(bytes.len());
        let few: Vec<u8> = (0..rng.random_range(0..9)).map(|_| rng.random()).collect();
        let strange = STRANGE[rng.random_range(0..STRANGE.len())];
        match rng.random_range(0..8) {
            0 if at < bytes.len() => bytes[at] ^= 1 << rng.random_range(0..8),
            1 => drop(bytes.splice(at..end, few)),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => bytes.extend_from_within(at..),
            5 => drop(bytes.splice(at..end, strange.iter().copied())),
            6 => bytes.iter_mut().skip(at & !3).zip(strange).for_each(|(byte, strange)| *byte = *strange),
            _ => bytes.extend_from_slice(&other[at.min(other.len())..]),
        }
    }
}

#[test]
fn what_the_fuzzer_asks_holds_for_the_corpus_and_for_what_is_made_of_it() {
    let mut rng = TestRng::deterministic_rng(RngAlgorithm::default());
    for (target, body) in bodies::ALL {
        let seeds = corpus(target);
        let mut understood = 0;
        for bytes in &seeds {
            let _given = Given(target, bytes);
            understood += u32::from(body(bytes));
        }
        assert!(understood > 0, "the corpus of {target} holds none that it understands");
        for _ in 0..SPOILT {
            let mut bytes = seeds[rng.random_range(0..seeds.len())].clone();
            let other = &seeds[rng.random_range(0..seeds.len())];
            spoil(&mut bytes, other, &mut rng);
            let _given = Given(target, &bytes);
            body(&bytes);
        }
        for _ in 0..SPOILT / 10 {
            let bytes: Vec<u8> = (0..rng.random_range(0..400)).map(|_| rng.random()).collect();
            let _given = Given(target, &bytes);
            body(&bytes);
        }
    }
}

/// The fuzzer's targets, the bodies and the corpus go together.
#[test]
fn every_parser_has_a_target_and_messages() {
    let fuzz = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz");
    let bodies: BTreeSet<_> = bodies::ALL.map(|(target, _)| target.to_owned()).into();
    let in_folder = |folder: &str| -> BTreeSet<String> {
        let files = fs::read_dir(fuzz.join(folder)).unwrap();
        files.map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned()).collect()
    };
    assert_eq!(in_folder("fuzz_targets"), bodies);
    assert_eq!(in_folder("corpus"), bodies);
    let manifest = fs::read_to_string(fuzz.join("Cargo.toml")).unwrap();
    for target in &bodies {
        assert!(manifest.contains(&format!("path = \"fuzz_targets/{target}.rs\"")), "{target}");
        assert!(!corpus(target).is_empty(), "{target}");
    }
}
