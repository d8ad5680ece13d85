//! Numbers and their nouns in sentences.

/// `1 hole`, `2 holes`: a count and what is counted, whose plural takes an s.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}
