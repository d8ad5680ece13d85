//! A progress bar on a terminal, for what takes longer than two seconds.
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::time::{Duration, Instant};

const PATIENCE: Duration = Duration::from_secs(2);
const RESOLUTION: u64 = 1000;

/// Shown only on a terminal, and only after two seconds.
pub(super) struct Progress {
    started: Instant,
    title: String,
    bar: Option<ProgressBar>,
}

impl Progress {
    pub(super) fn new(title: &str) -> Self {
        Self { started: Instant::now(), title: title.to_owned(), bar: None }
    }

    /// Shows a fraction in [0, 1] and what is being done.
    pub(super) fn show(&mut self, fraction: f64, what: &str) {
        if self.started.elapsed() < PATIENCE {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            // Hidden by itself when standard error is no terminal.
            let bar = ProgressBar::with_draw_target(Some(RESOLUTION), ProgressDrawTarget::stderr());
            if let Ok(style) = ProgressStyle::with_template("{prefix} {bar:30} {percent}% {msg} (left: {eta})") {
                bar.set_style(style);
            }
            bar.set_prefix(self.title.clone());
            bar
        });
        bar.set_position((fraction.clamp(0.0, 1.0) * RESOLUTION as f64) as u64);
        bar.set_message(what.to_owned());
    }

    pub(super) fn finish(&mut self) {
        if let Some(bar) = self.bar.take() {
            bar.finish_and_clear();
        }
    }
}
