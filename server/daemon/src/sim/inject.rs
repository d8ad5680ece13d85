//! Forces injected at given ticks: a list of fixed capacity, kept in the order of their arrival so that sums are reproducible.
use glam::DVec3;
use palpate_physics::PointForce;

/// Forces that may wait or act at a time.
pub const CAPACITY: usize = 16_384;
/// How far ahead (ticks) a force may begin: a day and more at 1 kHz.
pub const HORIZON_TICKS: u64 = 100_000_000;

/// A force on a node over a span of ticks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Injection {
    /// Node.
    pub node: u32,
    /// Force (N, world).
    pub force_n: DVec3,
    /// First tick it acts in; 0: the next.
    pub from_tick: u64,
    /// Ticks it acts, at least 1.
    pub tick_count: u32,
    /// While an arm is attached, the sum of such forces is bounded.
    pub is_bounded: bool,
}

/// Why injections were refused; none of them was taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InjectRefusal {
    /// One begins in a tick that is over.
    Past {
        /// Its first tick.
        from_tick: u64,
        /// The next tick.
        next_tick: u64,
    },
    /// One begins further ahead than [`HORIZON_TICKS`].
    Far {
        /// Its first tick.
        from_tick: u64,
        /// The last tick it might begin in.
        last_tick: u64,
    },
    /// No room.
    Full {
        /// Waiting or acting now.
        pending: u32,
    },
}

/// Waiting and acting forces.
#[derive(Debug)]
pub struct Injections {
    pending: Vec<Injection>,
    acting: Vec<PointForce>,
}

impl Default for Injections {
    fn default() -> Self {
        Self { pending: Vec::with_capacity(CAPACITY), acting: Vec::with_capacity(CAPACITY) }
    }
}

impl Injections {
    /// Waiting or acting now.
    pub fn pending(&self) -> u32 {
        self.pending.len() as u32
    }

    /// The forces of the last tick.
    pub fn acting(&self) -> &[PointForce] {
        &self.acting
    }

    /// Takes all, or none. Returns the first tick one of them acts in.
    ///
    /// # Errors
    /// [`InjectRefusal`].
    pub fn add(&mut self, fresh: &[Injection], next_tick: u64) -> Result<u64, InjectRefusal> {
        if let Some(past) = fresh.iter().find(|f| f.from_tick != 0 && f.from_tick < next_tick) {
            return Err(InjectRefusal::Past { from_tick: past.from_tick, next_tick });
        }
        let last_tick = next_tick.saturating_add(HORIZON_TICKS);
        if let Some(far) = fresh.iter().find(|f| f.from_tick > last_tick) {
            return Err(InjectRefusal::Far { from_tick: far.from_tick, last_tick });
        }
        if self.pending.len() + fresh.len() > CAPACITY {
            return Err(InjectRefusal::Full { pending: self.pending() });
        }
        let mut first_tick = u64::MAX;
        for injection in fresh {
            let from_tick = if injection.from_tick == 0 { next_tick } else { injection.from_tick };
            first_tick = first_tick.min(from_tick);
            self.pending.push(Injection { from_tick, ..*injection });
        }
        Ok(if fresh.is_empty() { next_tick } else { first_tick })
    }

    /// The forces of a tick; those that are bounded are scaled together so that Σ |f| is at most `bound_n` (N). Forgets those that end
    /// with it.
    pub fn acting_in(&mut self, tick: u64, bound_n: Option<f64>) -> &[PointForce] {
        self.acting.clear();
        if !self.pending.is_empty() {
            let bounded = self.pending.iter().filter(|f| f.is_bounded && f.from_tick <= tick);
            let sum_n: f64 = bounded.map(|f| f.force_n.length()).sum();
            let share = bound_n.filter(|bound_n| sum_n > *bound_n).map_or(1.0, |bound_n| bound_n / sum_n);
            let acting = &mut self.acting;
            self.pending.retain(|f| {
                if f.from_tick <= tick {
                    let force_n = if f.is_bounded { f.force_n * share } else { f.force_n };
                    acting.push(PointForce { node: f.node, force_n });
                }
                tick.saturating_sub(f.from_tick) + 1 < u64::from(f.tick_count) || f.from_tick > tick
            });
        }
        &self.acting
    }

    /// Forgets all: their ticks belong to another course of time.
    pub fn clear(&mut self) {
        self.pending.clear();
        self.acting.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn force(from_tick: u64, tick_count: u32) -> Injection {
        Injection { node: 3, force_n: DVec3::X, from_tick, tick_count, is_bounded: false }
    }

    #[test]
    fn forces_act_in_their_ticks_and_in_no_other() {
        let mut injections = Injections::default();
        assert_eq!(injections.add(&[force(7, 2), force(0, 1)], 5), Ok(5));
        let counts: Vec<usize> = (5..10).map(|tick| injections.acting_in(tick, None).len()).collect();
        assert_eq!(counts, [1, 0, 1, 1, 0]);
        assert_eq!(injections.pending(), 0);
    }

    #[test]
    fn all_or_none_are_taken() {
        let mut injections = Injections::default();
        let refused = injections.add(&[force(9, 1), force(4, 1)], 5);
        assert_eq!(refused, Err(InjectRefusal::Past { from_tick: 4, next_tick: 5 }));
        let last_tick = 5 + HORIZON_TICKS;
        let refused = injections.add(&[force(9, 1), force(last_tick + 1, 1)], 5);
        assert_eq!(refused, Err(InjectRefusal::Far { from_tick: last_tick + 1, last_tick }));
        assert_eq!(injections.pending(), 0);
        let many = vec![force(0, 1); CAPACITY];
        assert!(injections.add(&many, 1).is_ok());
        assert_eq!(injections.add(&many[..1], 1), Err(InjectRefusal::Full { pending: CAPACITY as u32 }));
    }

    #[test]
    fn the_sum_of_bounded_forces_is_bounded_and_others_stay() {
        let mut injections = Injections::default();
        let bounded = Injection { is_bounded: true, ..force(0, 9) };
        injections.add(&[bounded, force(0, 9), bounded, bounded], 1).unwrap();
        let sum_n = |forces: &[PointForce]| forces.iter().map(|f| f.force_n.length()).sum::<f64>();
        assert_eq!(sum_n(injections.acting_in(1, None)), 4.0);
        assert!((sum_n(injections.acting_in(2, Some(1.5))) - 2.5).abs() < 1e-12);
        assert_eq!(injections.acting()[1].force_n, DVec3::X);
        assert_eq!(sum_n(injections.acting_in(3, Some(3.0))), 4.0);
        assert_eq!(sum_n(injections.acting_in(4, Some(0.0))), 1.0);
    }
}
