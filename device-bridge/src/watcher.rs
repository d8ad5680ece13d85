//! Says changes of the link, once each, and the counters now and then.
use crate::{run::Shared, settings::Settings, stats::reason};
use palpate_control::Link;
use std::{
    sync::atomic::Ordering,
    time::{Duration, Instant},
};
use tokio::time;

/// How often changes of the link are looked for.
pub(crate) const WATCH_PERIOD: Duration = Duration::from_millis(20);
/// Between two lines about a link that changes.
const SAY_AT_MOST_EVERY: Duration = Duration::from_secs(1);

/// Says changes of the link once, and the counters now and then.
#[derive(Debug)]
pub(crate) struct Watcher {
    link: Link,
    said_at: Option<Instant>,
    said_unguarded: bool,
    auto_recover: bool,
    report: Option<time::Interval>,
}

impl Watcher {
    /// For a bridge with these settings.
    pub(crate) fn new(settings: &Settings) -> Self {
        let report = settings.report_every.map(|pause| time::interval_at(time::Instant::now() + pause, pause));
        Self {
            link: Link::Waiting,
            said_at: None,
            said_unguarded: false,
            auto_recover: settings.servo.auto_recover,
            report,
        }
    }

    /// Looks, and says what is new.
    pub(crate) fn look(&mut self, shared: &Shared) {
        if !self.said_unguarded && shared.unguarded.load(Ordering::Relaxed) {
            self.said_unguarded = true;
            tracing::warn!(
                "the guard beside the arm is gone: start this program again, or nobody takes the force away should it be killed"
            );
        }
        let link = shared.stats.link();
        if self.is_news(link, Instant::now()) {
            self.say(link);
        }
        let mut cx = std::task::Context::from_waker(std::task::Waker::noop());
        if self.report.as_mut().is_some_and(|report| report.poll_tick(&mut cx).is_ready()) {
            let recent_peak_n = shared.stats.take_recent_peak_n();
            tracing::info!("{}", shared.stats.summary().line(recent_peak_n));
        }
    }

    /// Whether the link is to be spoken of now, and takes it for said. A link at the edge of what is fresh changes every few ticks:
    /// a latched fault is said at once, the rest once a second.
    fn is_news(&mut self, link: Link, now: Instant) -> bool {
        let quiet = self.said_at.is_some_and(|said| now.saturating_duration_since(said) < SAY_AT_MOST_EVERY);
        let news = phase(link) != phase(self.link) && (!quiet || matches!(link, Link::Latched(_)));
        if news {
            self.link = link;
            self.said_at = Some(now);
        }
        news
    }

    fn say(&self, link: Link) {
        match link {
            Link::Waiting => tracing::info!("no force until the daemon answers in time"),
            Link::Fresh | Link::Extrapolating => tracing::info!("the daemon answers: its force is ramped up"),
            Link::Ramping(fault) => tracing::warn!("{}: the force is reduced", reason(fault)),
            Link::Latched(fault) if self.auto_recover => {
                tracing::warn!("{}: the force is zero until the daemon answers steadily", reason(fault));
            }
            Link::Latched(fault) => tracing::warn!(
                "{}: the force stays at zero: recover with `kill -USR1 {}`, or start with --auto-recover",
                reason(fault),
                std::process::id()
            ),
        }
    }
}

/// Short gaps come and go: fresh and extrapolating are one phase.
fn phase(link: Link) -> Link {
    if link == Link::Extrapolating { Link::Fresh } else { link }
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_control::Fault;

    /// What is said of a link that is looked at every 20 ms: the number of the look, and the link.
    fn said(link_at: impl Fn(u32) -> Link, looks: u32) -> Vec<(u32, Link)> {
        let mut watcher =
            Watcher { link: Link::Waiting, said_at: None, said_unguarded: false, auto_recover: false, report: None };
        let start = Instant::now();
        let every = (0..looks).map(|look| (look, link_at(look)));
        every.filter(|&(look, link)| watcher.is_news(link, start + WATCH_PERIOD * look)).collect()
    }

    /// Answers at the edge of what is fresh made two lines of log of every gap, some 25 a second.
    #[test]
    fn a_link_that_flaps_is_said_once_a_second_and_its_last_state_is_said() {
        let flapping = |look: u32| if look.is_multiple_of(2) { Link::Fresh } else { Link::Ramping(Fault::Stale) };
        // Ten seconds of flapping, then two of a ramp: 50 looks a second.
        let lines = said(|look| if look < 500 { flapping(look) } else { Link::Ramping(Fault::Stale) }, 600);
        assert!((5..=12).contains(&lines.len()), "{lines:?}");
        assert!(lines.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 50), "{lines:?}");
        assert_eq!(lines.last().unwrap().1, Link::Ramping(Fault::Stale), "{lines:?}");
    }

    #[test]
    fn a_latched_fault_is_said_at_once_and_once() {
        let lines = said(|look| if look == 0 { Link::Fresh } else { Link::Latched(Fault::Stale) }, 200);
        assert_eq!(lines, [(0, Link::Fresh), (1, Link::Latched(Fault::Stale))]);
    }
}
