//! The three numbers of a scene's text that a budget is spent on, read and written without touching anything else in it.
use miette::{Diagnostic, SourceSpan};
use std::path::Path;
use thiserror::Error;
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Tables of a body that say how many tets it is filled with.
const FILLED: [&str; 4] = ["surfaces", "ventricle", "sphere_shell", "ellipsoid_shell"];

/// A scene whose numbers cannot be chosen.
#[derive(Debug, Error, Diagnostic)]
pub(super) enum TextError {
    /// The file is not TOML.
    #[error("{name} is not TOML: {message}")]
    Syntax {
        name: String,
        message: String,
        #[source_code]
        text: String,
        #[label("here")]
        at: Option<SourceSpan>,
    },
    /// There are no particles to be chosen for.
    #[error("{name} has no [body.particles]")]
    #[diagnostic(help(
        "an empty table [body.particles] is enough: its numbers are chosen; of other bodies `palpated check` tells what a tick costs"
    ))]
    NoParticles { name: String },
    /// The spacing follows from the size of a tool.
    #[error("{name} has no [[tool]] with a radius_mm or radius_m, whose size the particles' spacing follows")]
    #[diagnostic(help("add the tool that is to touch the body, or write spacing_mm in [body.particles]"))]
    NoTool { name: String },
    /// What is there is no number that could be kept.
    #[error("{name}: {key} is there, and is not a number that can be used")]
    #[diagnostic(help("correct it, or leave it out to have it chosen"))]
    NotANumber { name: String, key: String },
    /// All three are there.
    #[error("{name} leaves nothing to be chosen: it says spacing, most_active and target_tets itself")]
    #[diagnostic(help("leave out those that are to be chosen, or add --again to choose all of them anew"))]
    NothingLeftOut { name: String },
}

/// The numbers that a budget is spent on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Numbers {
    /// Spacing (m) of the particles.
    pub(super) spacing_m: f64,
    /// Most particles awake at once.
    pub(super) most_active: u32,
    /// Coarse tets that are asked for; `None` for a body whose tets are given in another way.
    pub(super) target_tets: Option<u32>,
}

/// What a scene says of them itself.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Said {
    pub(super) spacing_m: Option<f64>,
    pub(super) most_active: Option<u32>,
    pub(super) target_tets: Option<u32>,
}

/// A scene's text.
#[derive(Debug, Clone)]
pub(super) struct SceneText {
    document: DocumentMut,
    /// The table of the body that says how many tets fill it.
    filled: Option<&'static str>,
    pub(super) said: Said,
}

impl SceneText {
    /// Reads a text, which `name` stands for in messages. What it says of the three numbers counts as left out where they are to be chosen
    /// `again`.
    ///
    /// # Errors
    /// [`TextError`], but [`TextError::NoTool`].
    pub(super) fn read(name: &Path, text: &str, again: bool) -> Result<Self, TextError> {
        let name = || name.display().to_string();
        let document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| TextError::Syntax {
            name: name(),
            message: error.message().to_owned(),
            text: text.to_owned(),
            at: error.span().map(SourceSpan::from),
        })?;
        let body = document.get("body").and_then(Item::as_table_like);
        let particles = body.and_then(|body| body.get("particles")?.as_table_like());
        let (Some(body), Some(particles)) = (body, particles) else {
            return Err(TextError::NoParticles { name: name() });
        };
        let filled = FILLED.into_iter().find(|table| body.contains_key(table));
        let tets = match filled.and_then(|table| body.get(table)?.as_table_like()) {
            Some(table) => whole(table, "target_tets"),
            None => Ok(None),
        };
        let unusable = |key: String| TextError::NotANumber { name: name(), key };
        let written = Said {
            spacing_m: length_m(particles, "spacing").map_err(unusable)?,
            most_active: whole(particles, "most_active").map_err(unusable)?,
            target_tets: tets.map_err(unusable)?,
        };
        let all = written.spacing_m.is_some()
            && written.most_active.is_some()
            && (filled.is_none() || written.target_tets.is_some());
        if all && !again {
            return Err(TextError::NothingLeftOut { name: name() });
        }
        let said = if again { Said::default() } else { written };
        Ok(Self { document, filled, said })
    }

    /// Whether the scene asks for a number of tets.
    pub(super) fn asks_for_tets(&self) -> bool {
        self.filled.is_some()
    }

    /// Returns the radius (m) of the first tool.
    pub(super) fn tool_radius_m(&self) -> Option<f64> {
        let tools = self.document.get("tool")?;
        let first = match tools.as_array_of_tables() {
            Some(tables) => tables.get(0).map(|table| table as &dyn TableLike),
            None => tools.as_array()?.get(0)?.as_inline_table().map(|table| table as &dyn TableLike),
        };
        length_m(first?, "radius").ok()?.filter(|radius_m| *radius_m > 0.0 && radius_m.is_finite())
    }

    /// Returns the text with these numbers in place of all that it says of them.
    pub(super) fn with_all(&self, numbers: &Numbers) -> String {
        self.with(numbers, &Said::default())
    }

    /// Returns the text with those of these numbers that it leaves out, or that are chosen again; all else is as it was.
    pub(super) fn with_chosen(&self, numbers: &Numbers) -> String {
        self.with(numbers, &self.said)
    }

    fn with(&self, numbers: &Numbers, said: &Said) -> String {
        let mut document = self.document.clone();
        let body = &mut document["body"];
        let particles = &mut body["particles"];
        if said.spacing_m.is_none() {
            if let Some(table) = particles.as_table_like_mut() {
                table.remove("spacing_m");
            }
            put(particles, "spacing_mm", number(millimetres(numbers.spacing_m)));
        }
        if said.most_active.is_none() {
            put(particles, "most_active", i64::from(numbers.most_active).into());
        }
        if let (Some(table), Some(tets), None) = (self.filled, numbers.target_tets, said.target_tets) {
            put(&mut body[table], "target_tets", i64::from(tets).into());
        }
        document.to_string()
    }
}

/// Without the digits that rounding adds.
fn millimetres(metres: f64) -> f64 {
    format!("{:.12e}", metres * 1e3).parse().unwrap_or(metres * 1e3)
}

/// A whole number without a point: `4` rather than `4.0`.
fn number(value: f64) -> Value {
    if value.fract() == 0.0 && value.abs() < 1e9 { (value as i64).into() } else { value.into() }
}

/// Puts a value in place of another, whose comment stays, or after the others.
fn put(table: &mut Item, key: &str, value: Value) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(there) => {
            let decor = there.decor().clone();
            *there = value;
            *there.decor_mut() = decor;
        }
        None => table[key] = toml_edit::value(value),
    }
}

/// A length (m) that is given in metres or millimetres; the key where it is no number.
fn length_m(table: &dyn TableLike, key: &str) -> Result<Option<f64>, String> {
    let real = |item: &Item| item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64));
    for (unit, unit_m) in [("_m", 1.0), ("_mm", 1e-3)] {
        let key = format!("{key}{unit}");
        if let Some(item) = table.get(&key) {
            return real(item).map(|value| Some(value * unit_m)).ok_or(key);
        }
    }
    Ok(None)
}

/// A whole number, not negative; the key where it is none.
fn whole(table: &dyn TableLike, key: &str) -> Result<Option<u32>, String> {
    let Some(item) = table.get(key) else { return Ok(None) };
    let value = item.as_integer().and_then(|whole| whole.try_into().ok());
    value.map(Some).ok_or_else(|| key.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = "# A heart.\n[scene]\nname = \"h\"\n\n[body.surfaces]\ninner_file = \"a\" # inside\n\n\
                         [body.particles] # chosen\nsmooth_skin = true\n\n[[tool]]\nradius_mm = 8\n";

    fn read(text: &str, again: bool) -> Result<SceneText, TextError> {
        SceneText::read(Path::new("heart.toml"), text, again)
    }

    #[test]
    fn what_is_left_out_is_put_in_and_nothing_else_changes() {
        let text = read(SCENE, false).unwrap();
        assert_eq!((text.said, text.asks_for_tets(), text.tool_radius_m()), (Said::default(), true, Some(0.008)));
        let numbers = Numbers { spacing_m: 0.004, most_active: 280, target_tets: Some(400) };
        let chosen = SCENE
            .replace("# inside\n", "# inside\ntarget_tets = 400\n")
            .replace("smooth_skin = true\n", "smooth_skin = true\nspacing_mm = 4\nmost_active = 280\n");
        assert_eq!(text.with_chosen(&numbers), chosen);
        assert!(matches!(read(&chosen, false), Err(TextError::NothingLeftOut { .. })));
        let again = Numbers { spacing_m: 0.0035, most_active: 600, target_tets: Some(800) };
        let anew = chosen.replace("= 4\n", "= 3.5\n").replace("= 280", "= 600").replace("= 400", "= 800");
        assert_eq!(read(&chosen, true).unwrap().with_chosen(&again), anew);
    }

    #[test]
    fn what_a_scene_says_stays() {
        let said = SCENE.replace("smooth_skin = true\n", "spacing_m = 0.003 # fine\nmost_active = 50\n");
        let text = read(&said, false).unwrap();
        assert_eq!(text.said, Said { spacing_m: Some(0.003), most_active: Some(50), target_tets: None });
        let numbers = Numbers { spacing_m: 0.003, most_active: 50, target_tets: Some(200) };
        assert_eq!(text.with_chosen(&numbers), said.replace("# inside\n", "# inside\ntarget_tets = 200\n"));
        // In metres it is replaced by millimetres.
        let anew = read(&said, true).unwrap().with_chosen(&Numbers { spacing_m: 0.004, ..numbers });
        assert!(anew.contains("spacing_mm = 4\n") && !anew.contains("spacing_m ="), "{anew}");
        // A box asks for cells and not for tets.
        let block = said.replace("[body.surfaces]\ninner_file = \"a\" # inside", "[body.box]\nsize_mm = [1, 1, 1]");
        assert!(matches!(read(&block, false), Err(TextError::NothingLeftOut { .. })));
    }

    #[test]
    fn what_cannot_be_chosen_is_told() {
        let shown = |text: &str| read(text, false).unwrap_err().to_string();
        assert!(shown("[body").starts_with("heart.toml is not TOML: "));
        assert_eq!(shown(&SCENE.replace("[body.particles]", "[body.springs]")), "heart.toml has no [body.particles]");
        for (key, value) in [("spacing_mm", "\"four\""), ("most_active", "-5"), ("most_active", "2.5")] {
            let wrong = SCENE.replace("smooth_skin = true", &format!("{key} = {value}"));
            assert_eq!(shown(&wrong), format!("heart.toml: {key} is there, and is not a number that can be used"));
        }
        for without in [SCENE.replace("[[tool]]\nradius_mm = 8\n", ""), SCENE.replace("radius_mm = 8", "radius_mm = 0")]
        {
            assert_eq!(read(&without, false).unwrap().tool_radius_m(), None);
        }
        let inline = format!("tool = [{{ radius_m = 0.005 }}]\n{}", SCENE.replace("[[tool]]\nradius_mm = 8\n", ""));
        assert_eq!(read(&inline, false).unwrap().tool_radius_m(), Some(0.005));
    }
}
