//! The printed JSON schema describes the format that is read: shipped scenes fit it, and scenes with a mistake do not.
#![allow(clippy::unwrap_used)] // helpers outside #[test] functions
use palpate_scene::json_schema;
use serde_json::Value;
use std::path::PathBuf;

fn example(name: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../deploy/scenes");
    std::fs::read_to_string(folder.join(name)).unwrap()
}

fn as_json(text: &str) -> Value {
    serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap()
}

/// Where a value does not fit a schema, for the keywords that ours uses; an unknown keyword fails the test.
fn misfits(root: &Value, schema: &Value, value: &Value, path: &str, found: &mut Vec<String>) {
    let Some(schema) = schema.as_object() else { return };
    let fits = |schema: &Value| {
        let mut inner = Vec::new();
        misfits(root, schema, value, path, &mut inner);
        inner.is_empty()
    };
    for (keyword, rule) in schema {
        let ok = match keyword.as_str() {
            "$ref" => fits(root.pointer(rule.as_str().unwrap().trim_start_matches('#')).unwrap()),
            "type" => {
                rule.as_array().map_or_else(|| has_type(rule, value), |any| any.iter().any(|t| has_type(t, value)))
            }
            "const" => rule == value,
            "enum" => rule.as_array().unwrap().contains(value),
            "oneOf" => rule.as_array().unwrap().iter().filter(|schema| fits(schema)).count() == 1,
            "anyOf" => rule.as_array().unwrap().iter().any(fits),
            "allOf" => rule.as_array().unwrap().iter().all(fits),
            "required" => rule.as_array().unwrap().iter().all(|key| value.get(key.as_str().unwrap()).is_some()),
            "additionalProperties" => {
                assert_eq!(rule, &Value::Bool(false));
                let known = schema.get("properties").and_then(Value::as_object);
                value.as_object().is_none_or(|o| o.keys().all(|key| known.is_some_and(|known| known.contains_key(key))))
            }
            "properties" => {
                for (key, schema) in rule.as_object().unwrap() {
                    if let Some(value) = value.get(key) {
                        misfits(root, schema, value, &format!("{path}.{key}"), found);
                    }
                }
                true
            }
            "items" => {
                for (index, value) in value.as_array().into_iter().flatten().enumerate() {
                    misfits(root, rule, value, &format!("{path}[{index}]"), found);
                }
                true
            }
            "minItems" => value.as_array().is_none_or(|array| array.len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => value.as_array().is_none_or(|array| array.len() as u64 <= rule.as_u64().unwrap()),
            "minimum" => value.as_f64().is_none_or(|number| number >= rule.as_f64().unwrap()),
            "maximum" => value.as_f64().is_none_or(|number| number <= rule.as_f64().unwrap()),
            // Annotations; the pattern of `axes` is checked by the reader.
            "$schema" | "$defs" | "title" | "description" | "default" | "format" | "pattern" => true,
            unknown => panic!("the schema uses {unknown}, which this test does not know"),
        };
        if !ok {
            found.push(format!("{path}: {keyword}"));
        }
    }
}

fn has_type(name: &Value, value: &Value) -> bool {
    match name.as_str().unwrap() {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        other => panic!("type {other}"),
    }
}

fn all_misfits(scene: &Value) -> Vec<String> {
    let (schema, mut found) = (json_schema(), Vec::new());
    misfits(&schema, &schema, scene, "", &mut found);
    found
}

#[test]
fn shipped_scenes_fit_the_schema() {
    for name in ["ventricle", "cantilever", "lame-sphere", "block-press", "capsule-press", "paper-2006", "two-surfaces"]
    {
        let scene = as_json(&example(&format!("{name}.toml")));
        assert_eq!(all_misfits(&scene), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn mistakes_do_not_fit_it() {
    let good = example("ventricle.toml");
    for (from, to) in [
        ("poisson_ratio", "poison_ratio"),
        ("position_mm = [55, 0, 0]\n", ""),
        ("position_mm = [55, 0, 0]", "position_mm = [55, 0, 0]\nposition_m = [0.055, 0, 0]"),
        ("stable-neo-hookean", "neo-hookean"),
        ("start_mm = [55, 0, 0]", "start_mm = [55, 0]"),
    ] {
        assert!(good.contains(from));
        assert!(!all_misfits(&as_json(&good.replacen(from, to, 1))).is_empty(), "{to}");
    }
}

#[test]
fn every_key_is_described() {
    fn walk(value: &Value, path: &str, bare: &mut Vec<String>) {
        if let Some(properties) = value.get("properties").and_then(Value::as_object) {
            for (key, property) in properties {
                if property.get("description").is_none() && property.get("$ref").is_none() {
                    bare.push(format!("{path}.{key}"));
                }
            }
        }
        match value {
            Value::Object(object) => object.iter().for_each(|(key, value)| walk(value, &format!("{path}/{key}"), bare)),
            Value::Array(array) => array.iter().for_each(|value| walk(value, path, bare)),
            _ => {}
        }
    }
    let mut bare = Vec::new();
    walk(&json_schema(), "", &mut bare);
    assert_eq!(bare, Vec::<String>::new());
}
