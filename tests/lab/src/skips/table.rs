//! `skips.csv`: one line per skip.
use super::{ELSEWHERE, Found, Skip};
use std::fmt::Write as _;

/// The table of what was found; skips that are not measured have a reason instead of numbers.
pub fn csv(found: &[(Skip, Found)]) -> String {
    let mut text = String::from("skip,with_us,without_us,saved,same_bits,farthest_m,tolerance_m,reason\n");
    for (skip, found) in found {
        let (with_us, without_us) = (found.with.median_s * 1e6, found.without.median_s * 1e6);
        // Writing to a string cannot fail.
        let tolerance_m = skip.tolerance_m.map_or_else(String::new, |m| format!("{m:e}"));
        let _ = writeln!(
            text,
            "\"{}\",{with_us:.3},{without_us:.3},{:.4},{},{:e},{tolerance_m},",
            skip.name,
            found.saved(),
            found.same_bits,
            found.farthest_m
        );
    }
    for (name, reason) in ELSEWHERE {
        let _ = writeln!(text, "\"{name}\",,,,,,,\"{reason}\"");
    }
    text
}
