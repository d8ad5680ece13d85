//! What a device has to be told beside its commands, each thing once.
use crate::sim::exchange::{LimitedTicks, ToolOutput};
use palpate_control::ForceLimits;
use palpate_proto::v1::{DeviceFault, DeviceFaultCode};
use std::time::{Duration, Instant};

/// Between two reports that the force is being limited.
const LIMITED_EVERY: Duration = Duration::from_secs(1);

/// What one device was told already.
#[derive(Debug)]
pub struct News {
    limits: ForceLimits,
    quarantined: Option<u64>,
    held: bool,
    stale: bool,
    let_go: bool,
    /// When limiting was told last, and in how many ticks the force had been limited then.
    limited: Option<(Instant, u64)>,
    counts: [u64; 4],
}

impl News {
    /// For a device under these limits that was told nothing yet.
    pub fn new(limits: ForceLimits) -> Self {
        Self { limits, quarantined: None, held: false, stale: false, let_go: false, limited: None, counts: [0; 4] }
    }

    /// The next thing that an output tells and the device does not know; `None` when it knows all.
    pub fn of(&mut self, output: &ToolOutput, now: Instant) -> Option<DeviceFault> {
        if output.quarantined != self.quarantined {
            self.quarantined = output.quarantined;
            if let Some(tick) = output.quarantined {
                let text = format!(
                    "the body's state became non-finite in tick {tick}; the force is zero until Reset or Restore (`palpate-view reset`)"
                );
                return Some(self.count(0, DeviceFaultCode::Quarantined, text));
            }
        }
        if output.held != self.held {
            self.held = output.held;
            if output.held {
                let text = "the session is paused, stepped, or about to be put elsewhere: the force ramps to zero";
                return Some(self.count(1, DeviceFaultCode::Held, text.to_owned()));
            }
        }
        if output.stale != self.stale {
            self.stale = output.stale;
            if output.stale {
                let text = "no fresh sample: the force ramps to zero until samples come again";
                return Some(self.count(2, DeviceFaultCode::Stale, text.to_owned()));
            }
        }
        if output.let_go != self.let_go {
            self.let_go = output.let_go;
            if output.let_go {
                let text =
                    "the button that the force depends on is not held: hold it, and the force rises (--hold-to-run)";
                return Some(self.count(3, DeviceFaultCode::NotHeld, text.to_owned()));
            }
        }
        self.limiting(output.limited, now)
    }

    fn limiting(&mut self, ticks: LimitedTicks, now: Instant) -> Option<DeviceFault> {
        let (told, known) = self.limited.map_or((None, 0), |(at, known)| (Some(at), known));
        if ticks.total <= known || told.is_some_and(|at| now.saturating_duration_since(at) < LIMITED_EVERY) {
            return None;
        }
        self.limited = Some((now, ticks.total));
        let ForceLimits { max_force_n, max_force_rate_n_per_s } = self.limits;
        let by_peak = (ticks.by_peak > 0).then(|| format!(", in {} by its peak of {max_force_n} N", ticks.by_peak));
        let by_rate =
            (ticks.by_rate > 0).then(|| format!(", in {} by its rate of {max_force_rate_n_per_s} N/s", ticks.by_rate));
        let (total, by_peak, by_rate) = (ticks.total, by_peak.unwrap_or_default(), by_rate.unwrap_or_default());
        let text = format!("ticks so far in which the force was held back: {total}{by_peak}{by_rate}");
        Some(fault(DeviceFaultCode::Limited, text, ticks.total))
    }

    fn count(&mut self, which: usize, code: DeviceFaultCode, message: String) -> DeviceFault {
        self.counts[which] += 1;
        fault(code, message, self.counts[which])
    }
}

/// A fault that concerns no sample.
pub fn fault(code: DeviceFaultCode, message: String, count: u64) -> DeviceFault {
    DeviceFault { code: code.into(), message, sample_sequence: 0, count }
}

#[cfg(test)]
mod tests {
    use super::*;
    use DeviceFaultCode::{Held, Limited, NotHeld, Quarantined, Stale};

    const LIMITS: ForceLimits = ForceLimits { max_force_n: 3.0, max_force_rate_n_per_s: 2000.0 };

    fn told(news: &mut News, output: &ToolOutput, now: Instant) -> Vec<(DeviceFaultCode, u64)> {
        std::iter::from_fn(|| news.of(output, now)).map(|fault| (fault.code(), fault.count)).collect()
    }

    #[test]
    fn each_change_is_told_once_and_counted() {
        let (mut news, now) = (News::new(LIMITS), Instant::now());
        let fine = ToolOutput::default();
        let bad = ToolOutput { quarantined: Some(7), held: true, stale: true, let_go: true, ..fine };
        assert_eq!(told(&mut news, &fine, now), []);
        assert_eq!(told(&mut news, &bad, now), [(Quarantined, 1), (Held, 1), (Stale, 1), (NotHeld, 1)]);
        assert_eq!(told(&mut news, &bad, now), []);
        assert_eq!(told(&mut news, &fine, now), []);
        assert_eq!(told(&mut news, &ToolOutput { stale: true, ..fine }, now), [(Stale, 2)]);
    }

    /// The count was that of the reports, one a second, whatever had happened between them.
    #[test]
    fn limiting_is_told_once_a_second_with_all_ticks_so_far() {
        let (mut news, start) = (News::new(LIMITS), Instant::now());
        let after = |ms| start + Duration::from_millis(ms);
        let limited = |total| {
            let limited = LimitedTicks { total, ..LimitedTicks::default() };
            ToolOutput { limited, ..ToolOutput::default() }
        };
        assert_eq!(told(&mut news, &limited(3), start), [(Limited, 3)]);
        assert_eq!(told(&mut news, &limited(400), after(999)), []);
        // Over since, but not told yet.
        assert_eq!(told(&mut news, &limited(400), after(1000)), [(Limited, 400)]);
        assert_eq!(told(&mut news, &limited(400), after(5000)), []);
        assert_eq!(told(&mut news, &limited(401), after(5001)), [(Limited, 401)]);
    }

    /// It said "the welcome says to what", which nobody who reads a log has seen.
    #[test]
    fn limiting_says_what_was_limited_and_to_what() {
        let limited = LimitedTicks { total: 7, by_peak: 3, by_rate: 5 };
        let fault = News::new(LIMITS).of(&ToolOutput { limited, ..ToolOutput::default() }, Instant::now()).unwrap();
        assert_eq!(
            fault.message,
            "ticks so far in which the force was held back: 7, in 3 by its peak of 3 N, in 5 by its rate of 2000 N/s"
        );
    }
}
