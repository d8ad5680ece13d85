//! Scenes that are part of the program. They are the files of `deploy/scenes` that need no other file.

const SCENES: &[(&str, &str)] = &[];

const NAMES: &[&str] = &[];

/// Text of a built-in scene.
pub fn builtin(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Names of the built-in scenes; the first is the default.
pub fn builtin_names() -> &'static [&'static str] {
    NAMES
}
