//! The name of a constitutive law. Every law of the physics has one, so a new law needs no change here.
use palpate_physics::material::Law;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{
    Deserialize, Deserializer,
    de::{Error, Visitor},
};
use serde_json::{Value, json};
use std::{borrow::Cow, fmt};

/// A constitutive law, by its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LawName(pub(crate) Law);

impl<'de> Deserialize<'de> for LawName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_str(Word)
    }
}

struct Word;

impl Visitor<'_> for Word {
    type Value = LawName;

    fn expecting(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        text.write_str("a word")
    }

    fn visit_str<E: Error>(self, word: &str) -> Result<LawName, E> {
        Law::by_name(word).map(LawName).ok_or_else(|| E::unknown_variant(word, Law::NAMES))
    }
}

impl JsonSchema for LawName {
    fn schema_name() -> Cow<'static, str> {
        "LawName".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let one = |law: Law| json!({"description": law.description(), "type": "string", "const": law.name()});
        let each: Vec<Value> = Law::ALL.into_iter().map(one).collect();
        json_schema!({"description": "A constitutive law.", "oneOf": each})
    }
}
