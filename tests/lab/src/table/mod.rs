//! The tables of `palpate-lab table`.
mod kernel;
mod tick;

/// Measures and prints everything.
///
/// # Errors
/// A body that cannot be built.
pub fn print() -> miette::Result<()> {
    kernel::print()?;
    println!();
    tick::print()
}
