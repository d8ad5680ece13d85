//! The share of its force that an arm is given.

/// None where it may have none, and after that all of it only slowly: a whole force at once would be a blow, and at a border that is crossed again and again a rattle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Share(f64);

impl Share {
    /// All of it.
    pub const ALL: Self = Self(1.0);
    /// Nothing.
    pub const NONE: Self = Self(0.0);
    /// So much comes back with a frame.
    const BACK_PER_FRAME: f64 = 0.02;

    /// A frame has come in which the arm may have force, or not.
    pub fn pass(&mut self, may_push: bool) {
        self.0 = if may_push { (self.0 + Self::BACK_PER_FRAME).min(1.0) } else { 0.0 };
    }

    /// How much of it now, 0 to 1.
    pub fn now(self) -> f64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_gone_at_once_and_comes_back_slowly() {
        let mut share = Share::ALL;
        share.pass(true);
        assert_eq!(share, Share::ALL);
        share.pass(false);
        assert_eq!(share, Share::NONE);
        for frame in 1..=50 {
            share.pass(true);
            assert!((share.now() - 0.02 * f64::from(frame)).abs() < 1e-12, "{share:?}");
        }
        // In and out again: never more than a frame's part.
        for frame in 0..10 {
            share.pass(frame % 2 == 1);
            assert!(share.now() <= 0.02);
        }
    }
}
