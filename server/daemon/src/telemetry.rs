//! Logs: to standard error, filtered by `PALPATE_LOG` (for example `debug` or `palpated=trace,h2=warn`), as lines of JSON if
//! `PALPATE_LOG_FORMAT` is `json`. Never from the loop.
use std::io::IsTerminal as _;
use tracing_subscriber::EnvFilter;

/// Name of the variable that filters logs.
pub const VARIABLE: &str = "PALPATE_LOG";
/// Name of the variable that says how they are written.
pub const FORMAT_VARIABLE: &str = "PALPATE_LOG_FORMAT";

/// Starts logging; later calls do nothing.
pub fn init() {
    let filter = EnvFilter::try_from_env(VARIABLE).unwrap_or_else(|_| EnvFilter::new("info"));
    // Colours on a terminal only, and not when `NO_COLOR` asks for none.
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    let logs = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(colours)
        // They would be told on standard error, and one of them is that it has no reader: a panic.
        .log_internal_errors(false)
        .with_target(false);
    let _ = match std::env::var(FORMAT_VARIABLE).as_deref() {
        Ok("json") => logs.json().flatten_event(true).try_init(),
        _ => logs.try_init(),
    };
}

/// An error with its causes, in one line.
pub fn causes(error: &dyn std::error::Error) -> String {
    let chain = std::iter::successors(error.source(), |cause| cause.source());
    chain.fold(error.to_string(), |text, cause| {
        let next = cause.to_string();
        if text.contains(&next) { text } else { format!("{text}: {next}") }
    })
}
