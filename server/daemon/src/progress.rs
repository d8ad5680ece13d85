//! How far a long command is: a bar on a terminal, a line now and then where standard error is a file or a pipe.
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::{
    io::{IsTerminal, Write as _},
    time::{Duration, Instant},
};

/// A terminal waits so long for its bar.
const PATIENCE: Duration = Duration::from_secs(2);
/// A file gets its first line after this time, and one every so often; see [`next_line`].
const LINE_EVERY: Duration = Duration::from_secs(10);
const RESOLUTION: u64 = 1000;
/// What a model's own progress is about.
pub(crate) const BUILDING: &str = "building the body";

/// Shows nothing of what is over in two seconds.
pub(crate) struct Progress {
    started: Instant,
    title: String,
    bar: Option<ProgressBar>,
    on_terminal: bool,
    next_line: Duration,
}

impl Progress {
    pub(crate) fn new(title: &str) -> Self {
        let on_terminal = std::io::stderr().is_terminal();
        Self { started: Instant::now(), title: title.to_owned(), bar: None, on_terminal, next_line: LINE_EVERY }
    }

    /// Shows a fraction in [0, 1] and what is being done.
    pub(crate) fn show(&mut self, fraction: f64, what: &str) {
        self.tell(Some(fraction.clamp(0.0, 1.0)), what);
    }

    /// Shows what is being done where nobody knows how much of it is left.
    pub(crate) fn show_work(&mut self, what: &str) {
        self.tell(None, what);
    }

    fn tell(&mut self, fraction: Option<f64>, what: &str) {
        let elapsed = self.started.elapsed();
        if self.on_terminal && elapsed >= PATIENCE {
            let bar = self.bar.get_or_insert_with(|| new_bar(&self.title, fraction.is_some()));
            bar.set_position((fraction.unwrap_or(0.0) * RESOLUTION as f64) as u64);
            bar.set_message(format!("{what}, {}", times(elapsed, fraction)));
        } else if !self.on_terminal && elapsed >= self.next_line {
            self.next_line = next_line(elapsed);
            // Who closed the standard error does not want to know.
            let _ = writeln!(std::io::stderr(), "{}", line(&self.title, elapsed, fraction, what));
        }
    }

    pub(crate) fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}

fn new_bar(title: &str, has_end: bool) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(RESOLUTION), ProgressDrawTarget::stderr());
    let template = if has_end { "{prefix} {bar:30} {percent}% {msg}" } else { "{prefix} {spinner} {msg}" };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar.with_prefix(title.to_owned())
}

/// Every ten seconds, then whenever a tenth more time has passed: a day's run has less than a hundred lines.
fn next_line(elapsed: Duration) -> Duration {
    elapsed + LINE_EVERY.max(elapsed / 10)
}

fn line(title: &str, elapsed: Duration, fraction: Option<f64>, what: &str) -> String {
    let percent = fraction.map_or(String::new(), |fraction| format!("{:.0} % ", 100.0 * fraction));
    format!("{title}: {percent}{what}, {}", times(elapsed, fraction))
}

/// How long it has taken, and by the mean speed up to now how long it will take.
fn times(elapsed: Duration, fraction: Option<f64>) -> String {
    let elapsed_s = elapsed.as_secs_f64();
    match fraction.filter(|&fraction| fraction > 0.0 && fraction < 1.0) {
        Some(fraction) => format!("{elapsed_s:.0} s, about {:.0} s left", elapsed_s * (1.0 - fraction) / fraction),
        None => format!("{elapsed_s:.0} s"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_in_a_file_are_bounded_and_say_what_is_left() {
        let (mut at, mut lines) = (LINE_EVERY, 0);
        while at < Duration::from_hours(24) {
            at = next_line(at);
            lines += 1;
        }
        assert!((50..100).contains(&lines), "{lines}");
        assert_eq!(next_line(LINE_EVERY), LINE_EVERY * 2);
        let after = Duration::from_secs(30);
        assert_eq!(line("beam", after, Some(0.25), "simulating"), "beam: 25 % simulating, 30 s, about 90 s left");
        assert_eq!(line("beam", after, None, "iteration 3"), "beam: iteration 3, 30 s");
        assert_eq!(times(after, Some(0.0)), "30 s", "nothing is known yet");
    }
}
