//! The JSON schema of the scene document, for editors and checks.
use super::Document;
use serde_json::{Map, Value, json};

/// JSON schema of the scene document, with the twin in millimetres of every length.
pub(crate) fn schema() -> Value {
    let mut schema = serde_json::to_value(schemars::schema_for!(Document)).unwrap_or_default();
    add_millimetres(&mut schema);
    schema
}

/// Whether a key is a length: `radius_m`, but not `stiffness_n_per_m`.
fn is_length(key: &str) -> bool {
    key.ends_with("_m") && !key.ends_with("_per_m")
}

fn add_millimetres(schema: &mut Value) {
    match schema {
        Value::Object(object) => {
            add_twins(object);
            object.values_mut().for_each(add_millimetres);
        }
        Value::Array(array) => array.iter_mut().for_each(add_millimetres),
        _ => {}
    }
}

/// Beside every length of an object its twin in millimetres, and "one of the two" where the length is required.
fn add_twins(object: &mut Map<String, Value>) {
    let Some(Value::Object(properties)) = object.get_mut("properties") else { return };
    let lengths: Vec<String> = properties.keys().filter(|key| is_length(key)).cloned().collect();
    for key in &lengths {
        let mut twin = properties[key].clone();
        if let Some(twin) = twin.as_object_mut() {
            twin.remove("default");
            twin.insert("description".into(), json!(format!("`{key}` in millimetres.")));
        }
        properties.insert(format!("{key}m"), twin);
    }
    let Some(Value::Array(required)) = object.get_mut("required") else { return };
    let demanded: Vec<String> =
        required.iter().filter_map(Value::as_str).filter(|key| is_length(key)).map(str::to_owned).collect();
    required.retain(|key| !demanded.iter().any(|length| key == length));
    if !demanded.is_empty() {
        let one_of = |key: &String| json!({"oneOf": [{"required": [key]}, {"required": [format!("{key}m")]}]});
        object.insert("allOf".into(), demanded.iter().map(one_of).collect());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_a_twin_and_stiffness_has_none() {
        let schema = schema().to_string();
        assert!(schema.contains("\"radius_mm\"") && schema.contains("\"position_mm\""));
        assert!(!schema.contains("stiffness_n_per_mm"));
    }
}
