//! The text of a scene, and where in it a key stands. Faults found anywhere in loading carry a [`Where`] (the path of
//! keys) and are turned here into errors that point at line and column.
use super::{
    Document,
    words::{did_you_mean, did_you_mean_key},
};
use crate::error::{SceneError, Stage};
use std::{fmt, ops::Range};
use toml::{
    Spanned, Table, Value,
    de::{DeTable, DeValue},
};

/// A path of keys from the document's root.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Where(Vec<Step>);

#[derive(Debug, Clone, PartialEq)]
enum Step {
    Key(String),
    Index(usize),
}

impl Where {
    /// The root's key.
    pub(crate) fn root(key: &str) -> Self {
        Self::default().key(key)
    }

    /// A key below.
    pub(crate) fn key(&self, key: &str) -> Self {
        let mut steps = self.0.clone();
        steps.push(Step::Key(key.into()));
        Self(steps)
    }

    /// An element below, counting from 0.
    pub(crate) fn index(&self, index: usize) -> Self {
        let mut steps = self.0.clone();
        steps.push(Step::Index(index));
        Self(steps)
    }

    /// The table at this path, for messages.
    fn table(&self) -> String {
        if self.0.is_empty() { "the scene".to_owned() } else { format!("[{self}]") }
    }

    /// The last key, for messages.
    fn name(&self) -> Option<&str> {
        self.0.iter().rev().find_map(|step| match step {
            Step::Key(key) => Some(key.as_str()),
            Step::Index(_) => None,
        })
    }
}

impl fmt::Display for Where {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (position, step) in self.0.iter().enumerate() {
            match step {
                Step::Key(key) => write!(out, "{}{key}", if position == 0 { "" } else { "." })?,
                Step::Index(index) => write!(out, "[{index}]")?,
            }
        }
        Ok(())
    }
}

/// Something wrong with what a key says.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) at: Where,
    /// Points at the key, not at its value.
    pub(crate) on_key: bool,
    pub(crate) stage: Stage,
    pub(crate) message: String,
    pub(crate) help: Option<String>,
    pub(crate) cause: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl Fault {
    /// A value that cannot be used.
    pub(crate) fn value(at: Where, message: impl Into<String>) -> Self {
        Self { at, on_key: false, stage: Stage::Value, message: message.into(), help: None, cause: None }
    }

    /// The same, of another stage.
    pub(crate) fn of(mut self, stage: Stage) -> Self {
        self.stage = stage;
        self
    }

    /// What to do next.
    pub(crate) fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Keeps the error underneath.
    pub(crate) fn cause(mut self, cause: impl std::error::Error + Send + Sync + 'static) -> Self {
        self.cause = Some(Box::new(cause));
        self
    }
}

/// A scene's text with the places of its keys.
pub(crate) struct Source<'t> {
    name: &'t str,
    text: &'t str,
    places: Spanned<DeTable<'t>>,
}

impl<'t> Source<'t> {
    /// Reads a document: TOML first, then lengths to metres, then keys and types.
    pub(crate) fn read(name: &'t str, text: &'t str) -> Result<(Self, Document), SceneError> {
        let syntax = |error: toml::de::Error| {
            let message = format!("this is not TOML: {}", error.message());
            SceneError::new(Stage::Syntax, message).at(name, text, error.span(), "here")
        };
        let places = DeTable::parse(text).map_err(syntax)?;
        let source = Self { name, text, places };
        let mut table: Table = text.parse().map_err(syntax)?;
        normalise(&Where::default(), &mut table).map_err(|fault| source.error(fault))?;
        let document = source.document(table)?;
        Ok((source, document))
    }

    fn document(&self, table: Table) -> Result<Document, SceneError> {
        let track = serde_path_to_error::deserialize::<_, Document>(Value::Table(table));
        track.map_err(|error| {
            let at = where_of(error.path());
            self.error(self.as_written(document_fault(at, error.inner().message())))
        })
    }

    /// Names a key as the user wrote it, in millimetres where it was.
    fn as_written(&self, mut fault: Fault) -> Fault {
        let written = self.span(&fault.at, true).and_then(|span| self.text.get(span)).filter(|_| fault.on_key);
        if let (Some(written), Some(name)) = (written, fault.at.name())
            && written.strip_suffix('m') == Some(name)
        {
            fault.message = fault.message.replacen(&format!("`{name}`"), &format!("`{written}`"), 1);
            // In the unit that was used: the other one is a thousand times off.
            let near = fault.help.take().filter(|help| !help.contains("_per_m`"));
            fault.help = near.map(|help| help.replacen("_m`?", "_mm`?", 1));
        }
        fault
    }

    /// A fault with its place in the text.
    pub(crate) fn error(&self, fault: Fault) -> SceneError {
        let label = fault.at.name().unwrap_or("here").to_owned();
        let mut error = SceneError::new(fault.stage, fault.message).at(
            self.name,
            self.text,
            self.span(&fault.at, fault.on_key),
            label,
        );
        if let Some(help) = fault.help {
            error = error.with_help(help);
        }
        match fault.cause {
            Some(cause) => error.with_boxed_cause(cause),
            None => error,
        }
    }

    /// The text of the deepest part of a path that exists: a value, or the header or key of a table.
    fn span(&self, at: &Where, on_key: bool) -> Option<Range<usize>> {
        let mut found = None;
        let mut here: Option<&Spanned<DeValue<'_>>> = None;
        for step in &at.0 {
            let next = match (step, here.map(Spanned::get_ref)) {
                (Step::Key(key), None) => entry(self.places.get_ref(), key),
                (Step::Key(key), Some(DeValue::Table(table))) => entry(table, key),
                (Step::Index(index), Some(DeValue::Array(array))) => array.get(*index).map(|v| (v.span(), v)),
                _ => None,
            };
            let Some((key, value)) = next else { break };
            let is_key = matches!(step, Step::Key(_)) && (on_key || matches!(value.get_ref(), DeValue::Table(_)));
            found = Some(if is_key { key } else { value.span() });
            here = Some(value);
        }
        found.map(|span| self.first_line(span))
    }

    /// A header or a value, without the lines that follow it.
    fn first_line(&self, span: Range<usize>) -> Range<usize> {
        let text = self.text.get(span.clone()).unwrap_or_default();
        let end = text.find('\n').map_or(span.end, |newline| span.start + newline);
        span.start..end
    }
}

/// The entry of a key, or of its twin in millimetres: places of key and value.
fn entry<'a, 't>(table: &'a DeTable<'t>, key: &str) -> Option<(Range<usize>, &'a Spanned<DeValue<'t>>)> {
    let twin = key.ends_with("_m").then(|| format!("{key}m"));
    let named = |name: &str| table.iter().find(|(known, _)| known.get_ref() == name);
    named(key).or_else(|| named(&twin?)).map(|(key, value)| (key.span(), value))
}

/// Turns lengths in millimetres into metres (`radius_mm` into `radius_m`), and refuses numbers that are not finite.
fn normalise(at: &Where, table: &mut Table) -> Result<(), Fault> {
    let keys: Vec<String> = table.keys().cloned().collect();
    for key in keys {
        let here = at.key(&key);
        let Some(mut value) = table.remove(&key) else { continue };
        check_value(&here, &mut value)?;
        let Some(metres) = key.strip_suffix('m').filter(|_| key.ends_with("_mm") && !key.ends_with("_per_mm")) else {
            table.insert(key, value);
            continue;
        };
        scale_to_metres(&mut value);
        if table.contains_key(metres) {
            let message = format!("`{metres}` and `{key}` give the same length twice");
            return Err(Fault::value(here, message).help("keep one of them"));
        }
        table.insert(metres.to_owned(), value);
    }
    Ok(())
}

fn check_value(at: &Where, value: &mut Value) -> Result<(), Fault> {
    match value {
        Value::Float(number) if !number.is_finite() => {
            Err(Fault::value(at.clone(), format!("{at} = {number}: must be a finite number")))
        }
        Value::Array(array) => {
            array.iter_mut().enumerate().try_for_each(|(index, value)| check_value(&at.index(index), value))
        }
        Value::Table(table) => normalise(at, table),
        _ => Ok(()),
    }
}

/// Divides, because `x / 1000` is the closest number to the one meant and `x · 0.001` may not be.
fn scale_to_metres(value: &mut Value) {
    match value {
        Value::Integer(number) => *value = Value::Float(*number as f64 / 1000.0),
        Value::Float(number) => *number /= 1000.0,
        Value::Array(array) => array.iter_mut().for_each(scale_to_metres),
        _ => {}
    }
}

fn where_of(path: &serde_path_to_error::Path) -> Where {
    use serde_path_to_error::Segment;
    let mut at = Where::default();
    for segment in path {
        at = match segment {
            Segment::Seq { index } => at.index(*index),
            Segment::Map { key } => at.key(key),
            Segment::Enum { .. } | Segment::Unknown => at,
        };
    }
    at
}

/// What the deserialiser says, in the words of this format.
fn document_fault(at: Where, message: &str) -> Fault {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    let table = at.table();
    let fault = |at: Where, message: String| Fault::value(at, message).of(Stage::Document);
    match quoted.split_first() {
        Some((key, known)) if message.starts_with("unknown field") => {
            // The path may or may not end with the key itself.
            let parent = match at.0.split_last() {
                Some((Step::Key(last), parent)) if last == key => Where(parent.to_vec()),
                _ => at,
            };
            let unknown = format!("unknown key `{}` in {}", key, parent.table());
            Fault { on_key: true, ..fault(parent.key(key), unknown).help(did_you_mean_key(key, known)) }
        }
        Some((word, known)) if message.starts_with("unknown variant") => {
            fault(at.clone(), format!("{at} = \"{word}\" is not known")).help(did_you_mean(word, known))
        }
        Some((key, _)) if message.starts_with("duplicate field") => {
            fault(at, format!("`{key}` is given twice, once by an earlier name of the key")).help("keep one of them")
        }
        Some((key, _)) if message.starts_with("missing field") => {
            let length = if key.ends_with("_m") { format!(" (or `{key}m`)") } else { String::new() };
            let chosen = if ["spacing_m", "target_tets"].contains(key) {
                "; of a body with particles `palpated fit-budget` chooses it, by what a tick may take"
            } else {
                ""
            };
            let help = format!("docs/scenes.md describes every key{chosen}");
            fault(at, format!("{table} lacks the key `{key}`{length}")).help(help)
        }
        _ if message == "invalid type: map, expected a sequence" => {
            fault(at.clone(), format!("{at} is a table, and should be a list of them")).help(format!("write [[{at}]]"))
        }
        _ => fault(at.clone(), format!("{at}: {}", in_words(message))),
    }
}

/// A message of the deserialiser without the names of its types.
fn in_words(message: &str) -> String {
    let Some((found, wanted)) = message.rsplit_once(", expected ") else { return message.to_owned() };
    let wanted = match wanted {
        "f64" => "a number",
        "u32" => "a whole number, not negative",
        "a sequence" => "a list",
        "a string" => "a text in quotes",
        table if table.starts_with("struct ") => "a table",
        other => other,
    };
    // An enumeration's word was wanted, and what is there is none.
    if found == "invalid type: unit variant" || wanted == "a word" {
        return "must be a text in quotes".to_owned();
    }
    format!("{found}, expected {wanted}").replace("invalid type: map", "invalid type: table")
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINIMAL: &str = "[scene]\nname = \"t\"\n[body.box]\nsize_mm = [10, 20, 30]\ncells = [1, 1, 1]\n[[material]]\n\
                           law = \"stvk\"\nyoung_modulus_pa = 1e4\npoisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n";

    fn refused(text: &str) -> String {
        Source::read("s.toml", text).map(|_| ()).unwrap_err().one_line()
    }

    #[test]
    fn millimetres_become_the_nearest_metres() {
        let (_, document) = Source::read("s.toml", MINIMAL).unwrap();
        assert_eq!(document.body.block.unwrap().size_m, [0.01, 0.02, 0.03]);
    }

    #[test]
    fn unknown_keys_are_pointed_at_with_the_nearest_known_one() {
        let text = MINIMAL.replace("poisson_ratio", "poison_ratio");
        assert_eq!(
            refused(&text),
            "s.toml:9:1: unknown key `poison_ratio` in [material[0]] (did you mean `poisson_ratio`?)"
        );
        let text = format!("{MINIMAL}[outptu]\n");
        assert_eq!(refused(&text), "s.toml:11:2: unknown key `outptu` in the scene (did you mean `output`?)");
    }

    /// `radius_cm` was answered with whatever key had the most letters in common, and a length misspelt in millimetres with
    /// one in metres.
    #[test]
    fn keys_in_another_unit_are_answered_by_what_they_are_called() {
        let shell =
            MINIMAL.replace("[body.box]\nsize_mm = [10, 20, 30]\ncells = [1, 1, 1]", "[body.sphere_shell]\nKEY = 1");
        let cases = [
            (&shell, "outer_radius_cm", "did you mean `outer_radius_mm`? Convert the number"),
            (&shell, "outer_radius", "did you mean `outer_radius_m` or `outer_radius_mm`?"),
            (&shell, "outer_raduis_mm", "did you mean `outer_radius_mm`?"),
            (&shell, "outer_raduis_m", "did you mean `outer_radius_m`?"),
            (
                &MINIMAL.replace("young_modulus_pa", "KEY"),
                "young_kpa",
                "did you mean `young_modulus_pa`? Convert the number",
            ),
            (
                &MINIMAL.replace("young_modulus_pa", "KEY"),
                "young_modulus_kpa",
                "did you mean `young_modulus_pa`? Convert the number",
            ),
            (
                &MINIMAL.replace("density_kg_per_m3", "KEY"),
                "density_g_per_cm3",
                "did you mean `density_kg_per_m3`? Convert the number",
            ),
            (&MINIMAL.replace("density_kg_per_m3", "KEY"), "density_kg_m3", "did you mean `density_kg_per_m3`?"),
        ];
        for (text, key, help) in cases {
            let message = refused(&text.replace("KEY", key));
            assert!(message.contains(&format!("unknown key `{key}`")), "{message}");
            assert!(message.ends_with(&format!("({help})")), "{message}");
        }
    }

    #[test]
    fn wrong_words_types_and_missing_keys_are_pointed_at() {
        let text = MINIMAL.replace("stvk", "stkv");
        assert_eq!(refused(&text), "s.toml:7:7: material[0].law = \"stkv\" is not known (did you mean `stvk`?)");
        let text = MINIMAL.replace("0.3", "\"0.3\"");
        assert!(
            refused(&text).starts_with("s.toml:9:17: material[0].poisson_ratio: invalid type: string"),
            "{}",
            refused(&text)
        );
        let text = MINIMAL.replace("cells = [1, 1, 1]\n", "");
        assert!(refused(&text).contains("[body.box] lacks the key `cells`"), "{}", refused(&text));
    }

    #[test]
    fn numbers_that_are_not_finite_and_lengths_given_twice_are_refused() {
        let text = MINIMAL.replace("1e4", "nan");
        assert_eq!(refused(&text), "s.toml:8:20: material[0].young_modulus_pa = NaN: must be a finite number");
        let text = MINIMAL.replace("size_mm", "size_m = [1, 1, 1]\nsize_mm");
        assert!(refused(&text).contains("twice"));
    }

    #[test]
    fn broken_toml_is_pointed_at() {
        assert!(refused("[scene\nname = 1").starts_with("s.toml:1:"), "{}", refused("[scene\nname = 1"));
    }
}
