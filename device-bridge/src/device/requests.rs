//! When an arm that answers each request, in their order, was asked for what it says: it measured it then or later.

/// Most that can be on their way.
const ROOM: usize = 8;

/// An answer that comes so much later (periods) than the last one, though it was asked for in time, was late.
const LATE: u64 = 2;

/// Periods between two poses: between their requests, or, where the answer was late, between their answers. A pose that was measured late would be a jump otherwise.
pub fn between(requests: u64, answers: u64) -> u64 {
    if answers > requests.saturating_add(LATE) { answers } else { requests }
}

/// Requests on their way, and what time it is (servo periods).
#[derive(Debug, Clone, Copy, Default)]
pub struct Requests {
    now: u64,
    /// Oldest first.
    made_at: [u64; ROOM],
    count: usize,
}

impl Requests {
    /// So many periods have passed.
    pub fn pass(&mut self, periods: u64) {
        self.now = self.now.saturating_add(periods);
    }

    /// What time it is.
    pub fn now(&self) -> u64 {
        self.now
    }

    /// How many are on their way.
    pub fn unanswered(&self) -> usize {
        self.count
    }

    /// One more is; the oldest is forgotten when there are too many.
    pub fn made(&mut self) {
        if self.count == ROOM {
            self.answered();
        }
        self.made_at[self.count] = self.now;
        self.count += 1;
    }

    /// The oldest is answered: when it was made; `None` if none is on its way.
    pub fn answered(&mut self) -> Option<u64> {
        let made_at = self.made_at[..self.count].first().copied()?;
        self.made_at.copy_within(1..self.count, 0);
        self.count -= 1;
        Some(made_at)
    }

    /// They were lost on their way.
    pub fn forget(&mut self) {
        self.count = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_answer_is_no_jump_and_jitter_is_none() {
        for (requests, answers, expected) in
            [(1, 1, 1), (1, 3, 1), (2, 1, 2), (1, 50, 50), (50, 1, 50), (u64::MAX, 0, u64::MAX)]
        {
            assert_eq!(between(requests, answers), expected);
        }
    }

    #[test]
    fn answers_are_to_the_oldest_request() {
        let mut requests = Requests::default();
        assert_eq!(requests.answered(), None);
        for _ in 0..3 {
            requests.pass(10);
            requests.made();
        }
        assert_eq!((requests.unanswered(), requests.now()), (3, 30));
        assert_eq!((requests.answered(), requests.answered()), (Some(10), Some(20)));
        requests.forget();
        assert_eq!(requests.answered(), None);
        requests.pass(u64::MAX);
        (0..20).for_each(|_| requests.made());
        assert_eq!((requests.unanswered(), requests.answered()), (ROOM, Some(u64::MAX)));
    }
}
