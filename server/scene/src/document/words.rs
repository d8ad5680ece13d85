//! Words that were meant: the nearest known key or name, and keys whose number is in another unit.

/// The nearest known name if one is near, else all of them.
pub(crate) fn did_you_mean(word: &str, known: &[&str]) -> String {
    let likeness = |near: &str| strsim::jaro_winkler(word, near);
    let nearest = known.iter().max_by(|a, b| likeness(a).total_cmp(&likeness(b)));
    match nearest.filter(|near| likeness(near) > NEAR) {
        Some(near) => format!("did you mean `{near}`?"),
        None => all_of(known),
    }
}

/// The same of keys: what they are called counts before their unit.
pub(super) fn did_you_mean_key(word: &str, known: &[&str]) -> String {
    let likeness = |near: &str| {
        let names = strsim::jaro_winkler(name_and_unit(word).0, name_and_unit(near).0);
        (names, strsim::jaro_winkler(word, near))
    };
    let order = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1));
    let nearest = known.iter().max_by(|a, b| order(&likeness(a), &likeness(b)));
    match nearest.filter(|near| likeness(near).0 > NEAR) {
        Some(near) => with_unit(word, near),
        None => all_of(known),
    }
}

/// Jaro and Winkler's likeness from which a word is taken for a slip.
const NEAR: f64 = 0.8;

fn all_of(known: &[&str]) -> String {
    if known.is_empty() { "nothing may be given here".into() } else { format!("known: {}", known.join(", ")) }
}

/// A length in a foreign unit is answered in millimetres, one without in both.
fn with_unit(word: &str, near: &str) -> String {
    let (unit, wanted) = (name_and_unit(word).1, name_and_unit(near).1);
    let per = |unit: &str| unit.replace("per_", "");
    match (unit, wanted) {
        ("", "m") => format!("did you mean `{near}` or `{near}m`?"),
        ("m" | "", _) | (_, "") => format!("did you mean `{near}`?"),
        (_, "m") => format!("did you mean `{near}m`? Convert the number"),
        _ if per(unit) == per(wanted) => format!("did you mean `{near}`?"),
        _ => format!("did you mean `{near}`? Convert the number"),
    }
}

/// A key without its unit, and the unit: `density` and `kg_per_m3`.
fn name_and_unit(key: &str) -> (&str, &str) {
    const UNITS: &str = " per m mm cm dm km um nm m2 mm2 cm2 m3 mm3 cm3 ml s s2 ms us ns hz khz rad deg n mn kn \
                         pa kpa mpa gpa hpa bar mmhg j mj kg g mg ";
    let mut name = key;
    while let Some((rest, last)) = name.rsplit_once('_')
        && UNITS.contains(&format!(" {last} "))
    {
        name = rest;
    }
    (name, key[name.len()..].trim_start_matches('_'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_have_no_units() {
        assert_eq!(did_you_mean("wall_s", &["wall_m", "base"]), "did you mean `wall_m`?");
        assert_eq!(did_you_mean("x", &[]), "nothing may be given here");
        assert_eq!(did_you_mean("apex", &["rim", "wall"]), "known: rim, wall");
    }
}
