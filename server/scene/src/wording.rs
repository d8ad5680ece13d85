//! Numbers and their nouns in sentences.

/// `1 hole`, `2 holes`: a count and what is counted, whose plural takes an s.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Four significant digits, without the zeros behind them.
pub fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-4..1e7).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
