//! Numbers and their nouns in sentences.

/// `1 hole`, `2 holes`: a count and what is counted, whose plural takes an s.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// `1 point that belongs to no triangle is left out`, `2 points that belong to no triangle are left out`: how many there are of
/// what is left out, its noun, and what is true of it, which starts with a verb.
pub(crate) fn left_out(count: usize, noun: &str, belong_to_nothing: &str) -> String {
    let (first, of) = noun.split_once(' ').map_or((noun, String::new()), |(first, of)| (first, format!(" {of}")));
    let (verb, rest) = belong_to_nothing.split_once(' ').unwrap_or((belong_to_nothing, ""));
    let (s, are) = if count == 1 { ("s", "is") } else { ("", "are") };
    format!("{}{of} that {verb}{s} {rest} {are} left out", counted(count, first))
}

/// `1 hexahedron`, `2 hexahedra`, `1 face of a solid`: a count and what is counted, in its plural, of which "lines and points" have
/// no other number.
pub(crate) fn counted_as(count: usize, plural: &str) -> String {
    if plural.contains(" and ") {
        return format!("{count} {plural}");
    }
    let (plural, of) = plural.find(" of ").map_or((plural, ""), |at| plural.split_at(at));
    match plural
        .strip_suffix("hedra")
        .map(|kind| format!("{kind}hedron"))
        .or(plural.strip_suffix('s').map(str::to_owned))
    {
        Some(singular) if count == 1 => format!("1 {singular}{of}"),
        _ => format!("{count} {plural}{of}"),
    }
}

/// `a, b and c`.
pub(crate) fn joined(parts: &[String]) -> String {
    match parts {
        [] => String::new(),
        [one] => one.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

/// Four significant digits, without the zeros behind them.
pub fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

/// Two significant digits, without the zeros behind them: an estimate.
pub fn two_digits(value: f64) -> String {
    short(format!("{value:.1e}").parse().unwrap_or(value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_lists() {
        let counts =
            [(1, "hexahedra"), (2, "hexahedra"), (1, "prisms"), (0, "lines")].map(|(n, what)| counted_as(n, what));
        assert_eq!(joined(&counts), "1 hexahedron, 2 hexahedra, 1 prism and 0 lines");
        assert_eq!(counted_as(1, "lines and points"), "1 lines and points");
        let faces = [1, 2].map(|count| counted_as(count, "faces of many corners"));
        assert_eq!(faces, ["1 face of many corners", "2 faces of many corners"]);
        assert_eq!((joined(&counts[..1]), joined(&[])), ("1 hexahedron".to_string(), String::new()));
    }

    #[test]
    fn what_is_left_out_agrees_with_its_number() {
        let told = [1, 2].map(|count| left_out(count, "node of the geometry", "belong to no tetrahedron"));
        assert_eq!(told[0], "1 node of the geometry that belongs to no tetrahedron is left out");
        assert_eq!(told[1], "2 nodes of the geometry that belong to no tetrahedron are left out");
        assert_eq!(left_out(1, "triangle", "use a vertex twice"), "1 triangle that uses a vertex twice is left out");
    }

    #[test]
    fn numbers_have_the_digits_they_need() {
        let cases = [
            (256.0, "256"),
            (3614.465, "3614"),
            (0.45, "0.45"),
            (4999.6, "5000"),
            (1e4, "10000"),
            (1.5e9, "1.5e9"),
            (0.0, "0"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn estimates_have_two_digits() {
        for (value, text) in [(0.1234, "0.12"), (99.6, "100"), (1349.0, "1300"), (2.0, "2"), (0.0, "0")] {
            assert_eq!(two_digits(value), text);
        }
    }
}
