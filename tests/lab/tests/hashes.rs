//! Every bit of every scene is as it is kept, and the scenes do what they are for.
#![allow(clippy::unwrap_used)] // a test that cannot run its scenes has failed
use palpate_lab::hashes::{self, Host, Line, Record, Seen};
use std::collections::BTreeSet;

#[test]
fn every_bit_of_every_scene_is_as_it_is_kept() {
    let found = hashes::all(&hashes::every_case(false).unwrap(), &|_, _| {}).unwrap();
    let of = |part: &str| -> Vec<(String, Seen)> {
        found
            .iter()
            .filter(|(line, _)| line.name.contains(part))
            .map(|(line, seen)| (line.name.clone(), *seen))
            .collect()
    };
    for (name, seen) in of("") {
        let is_pressed = ["grid/", "contact/", "sleep/", "hybrid", "seed", "springs", "refused/"];
        assert!(seen.pressed > 0 || !is_pressed.iter().any(|part| name.contains(part)), "no tool presses in {name}");
    }
    for (name, seen) in of("hybrid") {
        assert!(seen.most_awake > 0, "no particle wakes in {name}");
    }
    assert!(of("hybrid").iter().filter(|(_, seen)| seen.awake_at_last == 0).count() > 10, "none fall asleep");
    assert!(of("sleep/").iter().all(|(_, seen)| seen.asleep > 1000 && seen.woken == 4), "{:?}", of("sleep/"));
    assert!(of("too-long").iter().all(|(_, seen)| seen.repeated > 0), "{:?}", of("too-long"));
    assert!(of("refused/inputs").iter().all(|(_, seen)| seen.rejected > 10), "{:?}", of("refused/inputs"));
    let refused = [of("refused/tick"), of("refused/unstable"), of("hybrid/refused")].concat();
    assert!(refused.iter().all(|(_, seen)| seen.refused > 0), "{refused:?}");

    let kept = Record::read(&Record::path()).unwrap();
    if let Some(what) = Host::here().differs_from(&kept.host) {
        println!("not compared: the hashes were made elsewhere, where bits may differ ({what})");
        return;
    }
    let found: Vec<Line> = found.into_iter().map(|(line, _)| line).collect();
    let cut: Vec<Line> = kept.lines.into_iter().filter(|line| !line.name.ends_with("/whole")).collect();
    let told: Vec<String> = hashes::differences(&cut, &found, true).iter().map(ToString::to_string).collect();
    assert!(
        told.is_empty(),
        "bits differ from tests/lab/records/hashes.txt; `palpate-lab hashes` tells what to do:\n{}",
        told.join("\n")
    );
}

#[test]
fn every_shipped_scene_and_every_built_in_one_is_run() {
    let names: BTreeSet<String> = hashes::every_case(true).unwrap().into_iter().map(|case| case.name).collect();
    for built_in in palpate_scene::builtin_names() {
        assert!(names.contains(*built_in), "{built_in}");
    }
    assert_eq!(names.len(), hashes::every_case(true).unwrap().len(), "two scenes have one name");
    assert!(names.iter().all(|name| !name.contains(char::is_whitespace)));
}
