//! Lines on standard output, whose reader may leave before the last (`palpated check heart.toml | head`).
use std::{
    fmt::Arguments,
    io::{ErrorKind, Write},
    process,
};

/// Prints a line. Where the reader has left, what is said is lost and the command goes on to its end: its files and its exit
/// code are as they would have been. Any other fault, such as a disk that is full, ends the command with exit code 1.
pub(super) fn say(line: Arguments<'_>) {
    match writeln!(std::io::stdout(), "{line}") {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            eprintln!("cannot write to standard output: {error}");
            process::exit(1);
        }
        _ => {}
    }
}
