//! The tables of what was found: `skips.csv`, and the one that is printed.
use super::{ALL, ELSEWHERE, Found, Skip};
use miette::{Result, WrapErr};
use std::fmt::Write as _;

/// Ticks that are timed.
const ROUNDS: usize = 1_000;

/// Measures every skip and prints a line for each.
pub fn print() -> Result<()> {
    println!("Ticks of 1 ms, in microseconds (medians), with a skip and without, in turns.\n");
    println!("| skip | left out | scene | with | without | saved | how far apart |");
    println!("|---|---|---|---|---|---|---|");
    for skip in ALL {
        let found = (skip.run)(ROUNDS).wrap_err_with(|| format!("the skip \"{}\" was not measured", skip.name))?;
        println!(
            "| {} | {} | {} | {:.1} | {:.1} | {:.0} % | {} |",
            skip.name,
            skip.what,
            skip.scene,
            found.with.median_s * 1e6,
            found.without.median_s * 1e6,
            100.0 * found.saved(),
            skip.sameness(&found)
        );
    }
    Ok(())
}

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
