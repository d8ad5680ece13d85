//! How far bodies are off in time: what is right at rest may swing at another frequency, and answer a hand that swings too stiffly.
//!
//! - `modes.rs`: natural frequencies while all particles sleep
//! - `bands.rs`: dynamic stiffness under a patch, by frequency
mod bands;
mod modes;

use miette::Result;

/// Measures and prints, as the rows of two tables.
///
/// # Errors
/// A body that cannot be built, or a reference that is missing.
pub fn print() -> Result<()> {
    modes::print()?;
    println!();
    bands::print()
}
