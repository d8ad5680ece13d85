//! The staged patch: the next patch, laid out in slices over the ticks before its switch, since one tick has no time
//! for all of it.
use super::{body::HybridBody, running::RunningPatch};

/// A patch that is prepared beside the one that runs.
#[derive(Debug, Clone)]
pub(super) struct StagedPatch {
    pub(super) patch: RunningPatch,
    /// Number of slices that are done for the particles that the patch has.
    done: u32,
}

impl StagedPatch {
    pub(super) fn new(patch: RunningPatch) -> Self {
        Self { patch, done: 0 }
    }

    /// Does the next slice for these particles; it is the first one if the last was for others. Allocates nothing.
    pub(super) fn go_on(&mut self, body: &HybridBody, particles: &[u32]) {
        if self.done > 0 && self.patch.active() != particles {
            self.done = 0;
        }
        if self.done < RunningPatch::SLICES {
            self.patch.set_slice(body, particles, self.done);
            self.done += 1;
        }
    }

    /// Does all slices that are left.
    pub(super) fn finish(&mut self, body: &HybridBody, particles: &[u32]) {
        self.go_on(body, particles);
        while self.done < RunningPatch::SLICES {
            self.go_on(body, particles);
        }
    }

    /// Exchanges it with the patch that runs.
    pub(super) fn swap(&mut self, running: &mut RunningPatch) {
        self.patch.number_after(running);
        std::mem::swap(&mut self.patch, running);
        self.done = 0;
    }
}
