//! What a device has to be told beside its commands, each thing once.
use crate::sim::exchange::ToolOutput;
use palpate_proto::v1::{DeviceFault, DeviceFaultCode};
use std::time::{Duration, Instant};

/// Between two reports that the force is being limited.
const LIMITED_EVERY: Duration = Duration::from_secs(1);

/// What one device was told already.
#[derive(Debug, Default)]
pub struct News {
    quarantined: Option<u64>,
    held: bool,
    stale: bool,
    /// When limiting was told last, and in how many ticks the force had been limited then.
    limited: Option<(Instant, u64)>,
    counts: [u64; 3],
}

impl News {
    /// The next thing that an output tells and the device does not know; `None` when it knows all.
    pub fn of(&mut self, output: &ToolOutput, now: Instant) -> Option<DeviceFault> {
        if output.quarantined != self.quarantined {
            self.quarantined = output.quarantined;
            if let Some(tick) = output.quarantined {
                let text = format!(
                    "the body's state became non-finite in tick {tick}; the force is zero until Reset or Restore"
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
        self.limiting(output.limited_ticks, now)
    }

    fn limiting(&mut self, ticks: u64, now: Instant) -> Option<DeviceFault> {
        let (told, known) = self.limited.map_or((None, 0), |(at, known)| (Some(at), known));
        if ticks <= known || told.is_some_and(|at| now.saturating_duration_since(at) < LIMITED_EVERY) {
            return None;
        }
        self.limited = Some((now, ticks));
        let text = format!("the force was limited in {ticks} ticks so far (the welcome says to what)");
        Some(fault(DeviceFaultCode::Limited, text, ticks))
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
    use DeviceFaultCode::{Held, Limited, Quarantined, Stale};

    fn told(news: &mut News, output: &ToolOutput, now: Instant) -> Vec<(DeviceFaultCode, u64)> {
        std::iter::from_fn(|| news.of(output, now)).map(|fault| (fault.code(), fault.count)).collect()
    }

    #[test]
    fn each_change_is_told_once_and_counted() {
        let (mut news, now) = (News::default(), Instant::now());
        let fine = ToolOutput::default();
        let bad = ToolOutput { quarantined: Some(7), held: true, stale: true, ..fine };
        assert_eq!(told(&mut news, &fine, now), []);
        assert_eq!(told(&mut news, &bad, now), [(Quarantined, 1), (Held, 1), (Stale, 1)]);
        assert_eq!(told(&mut news, &bad, now), []);
        assert_eq!(told(&mut news, &fine, now), []);
        assert_eq!(told(&mut news, &ToolOutput { stale: true, ..fine }, now), [(Stale, 2)]);
    }

    /// The count was that of the reports, one a second, whatever had happened between them.
    #[test]
    fn limiting_is_told_once_a_second_with_all_ticks_so_far() {
        let (mut news, start) = (News::default(), Instant::now());
        let after = |ms| start + Duration::from_millis(ms);
        let limited = |limited_ticks| ToolOutput { limited_ticks, ..ToolOutput::default() };
        assert_eq!(told(&mut news, &limited(3), start), [(Limited, 3)]);
        assert_eq!(told(&mut news, &limited(400), after(999)), []);
        // Over since, but not told yet.
        assert_eq!(told(&mut news, &limited(400), after(1000)), [(Limited, 400)]);
        assert_eq!(told(&mut news, &limited(400), after(5000)), []);
        assert_eq!(told(&mut news, &limited(401), after(5001)), [(Limited, 401)]);
    }
}
