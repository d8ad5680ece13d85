//! One error type for scenes: what was wrong, where (file, line, column), and what to do next.
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};
use std::{ops::Range, sync::Arc};
use thiserror::Error;

/// Which stage of loading refused the scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// A file could not be read.
    Read,
    /// The text is not TOML.
    Syntax,
    /// A key is unknown, missing, or of the wrong type.
    Document,
    /// A value is outside its range, or does not fit the others.
    Value,
    /// The body could not be made: mesh file, surfaces, shape.
    Body,
    /// The physics refused the model.
    Model,
}

/// Why a scene could not be loaded. Its `Display` is the message alone; [`SceneError::one_line`] adds the place, and
/// miette draws it with the lines concerned.
#[derive(Debug, Error)]
#[error("{message}")]
pub struct SceneError {
    stage: Stage,
    message: String,
    help: Option<String>,
    place: Option<Box<Place>>,
    #[source]
    cause: Option<Box<dyn std::error::Error + Send + Sync>>,
}

#[derive(Debug)]
struct Place {
    source: NamedSource<Arc<str>>,
    span: Option<Range<usize>>,
    label: String,
}

impl SceneError {
    /// An error of a stage.
    pub fn new(stage: Stage, message: impl Into<String>) -> Self {
        Self { stage, message: message.into(), help: None, place: None, cause: None }
    }

    /// Says what to do next.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Keeps the error underneath, unless the message says all of it already: a report shows both.
    #[must_use]
    pub fn with_cause(self, cause: impl std::error::Error + Send + Sync + 'static) -> Self {
        self.with_boxed_cause(Box::new(cause))
    }

    /// The same, already boxed.
    #[must_use]
    pub fn with_boxed_cause(mut self, cause: Box<dyn std::error::Error + Send + Sync>) -> Self {
        if !self.message.contains(&cause.to_string()) {
            self.cause = Some(cause);
        }
        self
    }

    /// Points into a text.
    #[must_use]
    pub fn at(mut self, name: &str, text: &str, span: Option<Range<usize>>, label: impl Into<String>) -> Self {
        let source = NamedSource::new(name, Arc::from(text)).with_language("toml");
        self.place = Some(Box::new(Place { source, span, label: label.into() }));
        self
    }

    /// Which stage refused the scene.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// What to do next, if there is something to say.
    pub fn advice(&self) -> Option<&str> {
        self.help.as_deref()
    }

    /// Line and column (from 1) of the place pointed at.
    pub fn line_and_column(&self) -> Option<(usize, usize)> {
        let place = self.place.as_ref()?;
        let before = place.source.inner().get(..place.span.as_ref()?.start)?;
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        Some((before.matches('\n').count() + 1, before[line_start..].chars().count() + 1))
    }

    /// `file:line:column: message (what to do)`, for places that show plain text.
    pub fn one_line(&self) -> String {
        let name = self.place.as_ref().map_or("", |place| place.source.name());
        let place = match self.line_and_column() {
            Some((line, column)) => format!("{name}:{line}:{column}: "),
            None if name.is_empty() => String::new(),
            None => format!("{name}: "),
        };
        let help = self.help.as_ref().map_or(String::new(), |help| format!(" ({help})"));
        format!("{place}{}{help}", self.message)
    }
}

impl Diagnostic for SceneError {
    fn help<'a>(&'a self) -> Option<Box<dyn std::fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn std::fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.place.as_ref().filter(|place| place.span.is_some()).map(|place| &place.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.place.as_ref()?;
        let label = LabeledSpan::at(place.span.clone()?, place.label.clone());
        Some(Box::new(std::iter::once(label)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A report printed "the file is empty" twice, once as the message and once as its cause.
    #[test]
    fn a_cause_that_the_message_tells_is_not_told_again() {
        use std::{error::Error, io};
        let cause = || io::Error::other("no room");
        let told = SceneError::new(Stage::Read, format!("cannot read a.msh: {}", cause())).with_cause(cause());
        let untold = SceneError::new(Stage::Read, "cannot read a.msh").with_cause(cause());
        assert!(told.source().is_none() && untold.source().is_some());
    }

    #[test]
    fn one_line_names_file_line_and_column() {
        let text = "a = 1\nβ = 2 # x\nkey = 3\n";
        let start = text.find("key").unwrap();
        let error = SceneError::new(Stage::Value, "bad").with_help("do").at("s.toml", text, Some(start..start + 3), "");
        assert_eq!(error.one_line(), "s.toml:3:1: bad (do)");
        assert_eq!(SceneError::new(Stage::Read, "gone").one_line(), "gone");
    }
}
