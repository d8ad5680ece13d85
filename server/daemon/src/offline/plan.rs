//! When a run over time samples its probes and writes its frames.
use palpate_physics::Model;
use serde::{Deserialize, Serialize};

/// How many frames a run writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FrameCount {
    /// None at all.
    None,
    /// This many, evenly over the run, from its start to its end.
    Some(u32),
}

impl std::str::FromStr for FrameCount {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            _ => match text.parse() {
                Ok(count) if count > 1 => Ok(Self::Some(count)),
                _ => Err("give a whole number of frames, 2 or more, or \"none\"".into()),
            },
        }
    }
}

/// What to do at which tick.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Plan {
    pub(super) ticks: u64,
    pub(super) sample_every: u64,
    pub(super) frames: FrameRule,
}

/// When a frame is due.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum FrameRule {
    Never,
    Every(u64),
    /// This many over the run, at least 2.
    Count(u64),
}

/// Ticks in a time, at least one.
pub(super) fn in_ticks(time_s: f64, model: &Model) -> u64 {
    ((time_s / model.settings().tick_period_s).round() as u64).max(1)
}

impl Plan {
    pub(super) fn new(ticks: u64, sample_every: u64, frame_every: u64, frames: Option<FrameCount>) -> Self {
        let frames = match frames {
            Some(FrameCount::None) => FrameRule::Never,
            // There are no more states than ticks and the start.
            Some(FrameCount::Some(count)) => FrameRule::Count(u64::from(count).min(ticks.saturating_add(1))),
            None => FrameRule::Every(frame_every),
        };
        Self { ticks, sample_every, frames }
    }

    /// Whether the state after a tick is a frame, `written` being there already. The last state always is.
    pub(super) fn frame_is_due(&self, tick: u64, written: u64, last: bool) -> bool {
        match self.frames {
            FrameRule::Never => false,
            FrameRule::Every(ticks) => last || tick.is_multiple_of(ticks),
            FrameRule::Count(count) => {
                last || tick as u128 >= u128::from(written) * u128::from(self.ticks) / u128::from(count - 1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks whose states are frames, when the run ends after `ends`.
    fn frames(plan: &Plan, ends: u64) -> Vec<u64> {
        let mut due = Vec::new();
        for tick in 0..=ends {
            if plan.frame_is_due(tick, due.len() as u64, tick == ends) {
                due.push(tick);
            }
        }
        due
    }

    #[test]
    fn the_wanted_number_of_frames_from_the_start_to_the_end() {
        let plan = |ticks, count| Plan::new(ticks, 1, 1, Some(FrameCount::Some(count)));
        assert_eq!(frames(&plan(10, 2), 10), [0, 10]);
        assert_eq!(frames(&plan(10, 4), 10), [0, 3, 6, 10]);
        for count in 2..=101 {
            assert_eq!(frames(&plan(100, count), 100).len(), count as usize);
        }
    }

    #[test]
    fn more_frames_than_ticks_are_one_for_every_state() {
        assert_eq!(frames(&Plan::new(3, 1, 1, Some(FrameCount::Some(1000))), 3), [0, 1, 2, 3]);
        assert_eq!(frames(&Plan::new(1, 1, 1, Some(FrameCount::Some(u32::MAX))), 1), [0, 1]);
    }

    /// With an interval that does not divide the run, its end was in no frame.
    #[test]
    fn the_last_state_is_a_frame_whenever_the_run_ends() {
        assert_eq!(frames(&Plan::new(10, 1, 4, None), 10), [0, 4, 8, 10]);
        assert_eq!(frames(&Plan::new(10, 1, 5, None), 10), [0, 5, 10]);
        assert_eq!(frames(&Plan::new(10, 1, 4, None), 7), [0, 4, 7]);
        assert_eq!(frames(&Plan::new(10, 1, 4, Some(FrameCount::Some(3))), 7), [0, 5, 7]);
        assert!(frames(&Plan::new(10, 1, 4, Some(FrameCount::None)), 10).is_empty());
    }
}
