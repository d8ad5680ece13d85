//! What happens often is logged at most once a second, with how often it has happened since.
use std::{
    sync::{Mutex, PoisonError},
    time::{Duration, Instant},
};

/// Between two lines.
const INTERVAL: Duration = Duration::from_secs(1);

/// One kind of line.
#[derive(Debug, Default)]
pub struct Sparing {
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    said: Option<Instant>,
    unsaid: u64,
}

impl Sparing {
    /// Says it, unless it has just been said; `say` is told how often it happened since the last line, this time included.
    pub fn say(&self, say: impl FnOnce(u64)) {
        self.say_at(Instant::now(), say);
    }

    fn say_at(&self, now: Instant, say: impl FnOnce(u64)) {
        let times = {
            let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
            state.unsaid += 1;
            if state.said.is_some_and(|said| now - said < INTERVAL) {
                return;
            }
            state.said = Some(now);
            std::mem::take(&mut state.unsaid)
        };
        say(times);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flood_is_a_line_a_second_and_none_of_it_is_lost() {
        let (sparing, mut lines, start) = (Sparing::default(), Vec::new(), Instant::now());
        for ms in 0..3000 {
            sparing.say_at(start + Duration::from_millis(ms), |times| lines.push(times));
        }
        assert_eq!(lines, [1, 1000, 1000]);
    }
}
