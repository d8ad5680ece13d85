//! The patch of a switch to come, laid out in slices over the ticks before it: one tick has no time for all of it.
use super::{body::HybridBody, running::RunningPatch};

/// A patch beside the one that runs.
#[derive(Debug, Clone)]
pub(super) struct StagedPatch {
    pub(super) patch: RunningPatch,
    /// Slices that are done, for the particles that the patch has.
    done: u32,
}

impl StagedPatch {
    pub(super) fn new(patch: RunningPatch) -> Self {
        Self { patch, done: 0 }
    }

    /// The next slice, for these particles: from the first one where the last was for others. Allocates nothing.
    pub(super) fn go_on(&mut self, body: &HybridBody, particles: &[u32]) {
        if self.done > 0 && self.patch.active() != particles {
            self.done = 0;
        }
        if self.done < RunningPatch::SLICES {
            self.patch.set_slice(body, particles, self.done);
            self.done += 1;
        }
    }

    /// All slices that are left.
    pub(super) fn finish(&mut self, body: &HybridBody, particles: &[u32]) {
        self.go_on(body, particles);
        while self.done < RunningPatch::SLICES {
            self.go_on(body, particles);
        }
    }

    /// Makes it the one that runs.
    pub(super) fn swap(&mut self, running: &mut RunningPatch) {
        self.patch.number_after(running);
        std::mem::swap(&mut self.patch, running);
        self.done = 0;
    }
}
