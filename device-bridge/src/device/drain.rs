//! After a guard spoke to an arm that answers: its answers come, too, and nothing tells them from ours. All are dropped until the line is quiet; then the driver asks anew. Meanwhile
//! the arm has no force, which its readings tell by their share.
use super::{Fault, serial::Line};

/// A line that is not quiet after so many times what makes it quiet never will be.
const MOST: u64 = 10;

/// What is dropped. It counts readings, and not periods: an answer that comes while the loop stands still is found by the next reading.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Drain {
    /// Readings without a byte that are still wanted; 0: nothing is dropped.
    quiet_left: u64,
    /// Readings until it is given up.
    left: u64,
    /// Readings without a byte that make a line quiet.
    wanted: u64,
    /// The arm was told once more to let go.
    told: bool,
}

impl Drain {
    /// From now on, until nothing came for as long as an arm may be silent: an answer that is later is a fault by itself.
    pub(super) fn begin(&mut self, silence_periods: u64) {
        let wanted = silence_periods.max(1);
        *self = Self { quiet_left: wanted, left: wanted.saturating_mul(MOST), wanted, told: false };
    }

    /// Whether all is dropped.
    pub(super) fn is_on(&self) -> bool {
        self.quiet_left > 0
    }

    /// The share of the force that the arm has now.
    pub(super) fn force_share(&self) -> f64 {
        if self.is_on() { 0.0 } else { 1.0 }
    }

    /// Whether the arm was told once more to let go: a force may have gone out behind the guard's words.
    pub(super) fn told(&mut self, sent: bool) {
        self.told |= sent;
    }

    /// One reading, in which something came or not; whether the line is quiet now.
    ///
    /// # Errors
    /// [`Fault::Garbled`]: it does not end. [`Fault::Silent`]: it takes no word.
    pub(super) fn pass(&mut self, came: bool) -> Result<bool, Fault> {
        let endless = if self.told { Fault::Garbled } else { Fault::Silent };
        self.left = self.left.checked_sub(1).ok_or(endless)?;
        self.quiet_left = if came || !self.told { self.wanted } else { self.quiet_left.saturating_sub(1) };
        Ok(!self.is_on())
    }
}

/// The same on a serial line.
impl Drain {
    /// Drops what has come; whether the line is quiet now.
    ///
    /// # Errors
    /// As [`Drain::pass`], and [`Fault::Disconnected`].
    pub(super) fn hear(&mut self, line: &mut Line) -> Result<bool, Fault> {
        let came = line.newest(|_| Ok(Some(())))?.is_some();
        self.pass(came)
    }

    /// Tells the arm, unless it was told.
    ///
    /// # Errors
    /// [`Fault::Disconnected`].
    pub(super) fn tell(&mut self, line: &mut Line, nothing: &[u8]) -> Result<(), Fault> {
        if !self.told {
            self.told = line.send(nothing)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_ends_when_nothing_came_for_so_long_since_the_arm_was_told() {
        let mut drain = Drain::default();
        assert!(!drain.is_on());
        drain.begin(3);
        // Not told, told, an answer, and then nothing.
        for (told, came, quiet) in [
            (false, false, false),
            (false, false, false),
            (true, false, false),
            (false, true, false),
            (false, false, false),
            (false, false, false),
            (false, false, true),
        ] {
            assert!(drain.is_on());
            drain.told(told);
            assert_eq!(drain.pass(came), Ok(quiet));
        }
        assert!(!drain.is_on());
    }

    #[test]
    fn a_line_that_is_never_quiet_is_not_its_protocol() {
        let mut drain = Drain::default();
        drain.begin(20);
        drain.told(true);
        let readings = (0..1000).take_while(|_| drain.pass(true).is_ok()).count();
        assert_eq!((readings, drain.pass(true)), (200, Err(Fault::Garbled)));
        drain.begin(1);
        let readings = (0..1000).take_while(|_| drain.pass(false).is_ok()).count();
        assert_eq!((readings, drain.pass(false)), (10, Err(Fault::Silent)), "it was never told");
    }
}
