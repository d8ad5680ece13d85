//! Scenes that are part of the program. They are the files of `deploy/scenes` that need no other file.

macro_rules! scenes {
    ($($name:literal),*) => {
        const SCENES: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../../deploy/scenes/", $name, ".toml")))),*];
        const NAMES: &[&str] = &[$($name),*];
    };
}

scenes!(
    "ventricle",
    "cantilever",
    "lame-sphere",
    "paper-2006",
    "hybrid-ventricle",
    "hybrid-block",
    "seed-ellipsoids",
    "seed-full-fem",
    "seed-hybrid",
    "springs-dome"
);

/// Text of a built-in scene.
pub fn builtin(name: &str) -> Option<&'static str> {
    SCENES.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Names of the built-in scenes; the first is the default.
pub fn builtin_names() -> &'static [&'static str] {
    NAMES
}
