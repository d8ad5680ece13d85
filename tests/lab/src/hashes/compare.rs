//! What differs, and between which ticks.
use super::record::{Line, Mark};
use std::fmt;

/// A scene that is not as it was.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// The scene.
    pub name: String,
    /// In words.
    pub what: Vec<String>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.what.join("; "))
    }
}

/// What differs between what was kept and what was found now. `all`: every scene was run, so one that is kept only is gone.
pub fn differences(kept: &[Line], found: &[Line], all: bool) -> Vec<Difference> {
    let of = |lines: &[Line], name: &str| lines.iter().find(|line| line.name == name).cloned();
    let told = |name: &str, what: Vec<String>| Difference { name: name.to_owned(), what };
    let mut list: Vec<Difference> = found
        .iter()
        .map(|line| match of(kept, &line.name) {
            Some(before) => told(&line.name, of_line(&before, line)),
            None => told(&line.name, vec!["is not in the file".into()]),
        })
        .collect();
    let gone = kept.iter().filter(|line| all && of(found, &line.name).is_none());
    list.extend(gone.map(|line| told(&line.name, vec!["is in the file, and there is no such scene".into()])));
    list.retain(|difference| !difference.what.is_empty());
    list
}

fn of_line(kept: &Line, found: &Line) -> Vec<String> {
    let mut what = Vec::new();
    if (kept.ticks, kept.of) != (found.ticks, found.of) {
        what.push(format!("{} of {} ticks are kept, {} of {} were run", kept.ticks, kept.of, found.ticks, found.of));
    }
    let kept_of = |mark: &Mark| kept.marks.iter().find(|kept| kept.label == mark.label);
    let mut same_to = 0;
    let mut ticks_differ = false;
    for mark in &found.marks {
        let is_same = kept_of(mark).map(|kept| kept.hash == mark.hash);
        match (mark.tick(), is_same) {
            (_, None) => what.push(format!("no hash of {} is kept", mark.label)),
            (None, Some(false)) => what.push(format!("the {} differs", in_words(&mark.label))),
            (Some(tick), Some(true)) => same_to = tick,
            // What follows differs with it.
            (Some(tick), Some(false)) if !ticks_differ => {
                ticks_differ = true;
                what.push(format!("differs from one of the ticks {} to {tick} on", same_to + 1));
            }
            (None, Some(true)) | (Some(_), Some(false)) => {}
        }
    }
    let found_of = |mark: &&Mark| found.marks.iter().all(|found| found.label != mark.label);
    what.extend(kept.marks.iter().filter(found_of).map(|mark| format!("a hash of {} is kept only", mark.label)));
    what
}

fn in_words(label: &str) -> &str {
    match label {
        "static" => "equilibrium",
        "modes" => "first natural modes",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str) -> Line {
        let mark = |label: &str, hash| Mark { label: label.into(), hash };
        let marks = vec![mark("model", 1), mark("10", 2), mark("20", 3), mark("30", 4), mark("static", 5)];
        Line { name: name.into(), ticks: 30, of: 90, marks }
    }

    fn told(kept: &Line, found: &Line, all: bool) -> Vec<String> {
        differences(std::slice::from_ref(kept), std::slice::from_ref(found), all)
            .iter()
            .map(ToString::to_string)
            .collect()
    }

    #[test]
    fn a_divergence_is_told_with_its_ticks() {
        let mut found = line("block");
        assert!(told(&line("block"), &found, true).is_empty());
        (found.marks[2].hash, found.marks[3].hash) = (7, 8);
        assert_eq!(told(&line("block"), &found, true), ["block: differs from one of the ticks 11 to 20 on"]);
        found = line("block");
        (found.marks[0].hash, found.marks[1].hash, found.marks[4].hash) = (7, 8, 9);
        assert_eq!(
            told(&line("block"), &found, true),
            ["block: the model differs; differs from one of the ticks 1 to 10 on; the equilibrium differs"]
        );
    }

    #[test]
    fn scenes_that_are_new_or_gone_are_told() {
        let (one, other) = (line("one"), line("other"));
        assert_eq!(told(&one, &other, false), ["other: is not in the file"]);
        let both = told(&one, &other, true);
        assert_eq!(both[1], "one: is in the file, and there is no such scene");
    }

    #[test]
    fn other_ticks_and_other_hashes_are_told() {
        let (kept, mut found) = (line("block"), line("block"));
        found.ticks = 40;
        found.marks[3].label = "40".into();
        let told = told(&kept, &found, true).join("");
        assert!(told.contains("30 of 90 ticks are kept, 40 of 90 were run"), "{told}");
        assert!(told.contains("no hash of 40 is kept") && told.contains("a hash of 30 is kept only"), "{told}");
    }
}
