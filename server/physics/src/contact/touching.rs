//! The samples inside a tool, in a buffer that never grows.
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// More samples than this inside one tool are pressed without friction and without memory, or not at all where the tool
/// was put into the surface.
const MOST: usize = 16_384;

/// A sample inside the tool.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct Touch {
    /// Its number.
    pub(super) sample: u32,
    /// Whether the tool reached it from behind the surface: then it carries nothing until it leaves.
    pub(super) from_behind: bool,
    /// Whether the tool reached it from behind and then came round an edge to its outer side.
    pub(super) came_round: bool,
    /// Whether the tool reached it from behind while it pressed another wall, and pushes it out.
    pub(super) pushed_out: bool,
    /// Depth (m) up to which it carries nothing: that at which the tool was put there, or the least since. For a sample
    /// that was met before a tool that was put there had left the surface, it is the depth at which it was met. It is
    /// recorded for samples met from behind, too, since it tells that the tool was put there. For a sample that came
    /// round, it is the depth at which it did, or the least since; for one that is pushed out, that at which this began, or the least
    /// since.
    pub(super) free_depth_m: f64,
    /// Position relative to the tool's centre (m) where its friction spring is at rest.
    pub(super) spring_origin_m: DVec3,
}

impl Touch {
    /// Returns the record of the same sample, reached from behind, as it comes into the tool's way with this depth (m).
    pub(super) fn push_out(self, depth_m: f64) -> Self {
        Self { from_behind: false, pushed_out: true, free_depth_m: depth_m, ..self }
    }

    /// Returns the record of the same sample, reached from behind, as the tool comes to its outer side: with this depth (m),
    /// and at this position relative to the tool's centre (m).
    pub(super) fn come_round(self, depth_m: f64, from_centre_m: DVec3) -> Self {
        // One that tells that the tool was put there goes on telling it.
        let came_round = self.free_depth_m == 0.0;
        Self { from_behind: false, came_round, free_depth_m: depth_m, spring_origin_m: from_centre_m, ..self }
    }
}

/// Records of samples, in ascending order of these. Its clones keep the capacity.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(from = "Vec<Touch>", into = "Vec<Touch>")]
pub(super) struct Touching {
    buffer: Box<[Touch]>,
    count: usize,
}

impl Touching {
    pub(super) fn with_capacity(samples: usize) -> Self {
        let empty = Touch {
            sample: 0,
            from_behind: false,
            came_round: false,
            pushed_out: false,
            free_depth_m: 0.0,
            spring_origin_m: DVec3::ZERO,
        };
        Self { buffer: vec![empty; samples.min(MOST)].into_boxed_slice(), count: 0 }
    }

    pub(super) fn records(&self) -> &[Touch] {
        &self.buffer[..self.count]
    }

    /// Returns whether the tool presses samples that it met from the outside.
    pub(super) fn presses_a_wall(&self) -> bool {
        let is_of_wall =
            |touch: &Touch| !touch.from_behind && !touch.came_round && !touch.pushed_out && touch.free_depth_m == 0.0;
        self.records().iter().any(is_of_wall)
    }

    /// Returns whether the tool was put where it is, and has not left the surface yet.
    pub(super) fn tells_it_was_put(&self) -> bool {
        self.records().iter().any(|touch| touch.free_depth_m > 0.0 && !touch.came_round && !touch.pushed_out)
    }

    pub(super) fn clear(&mut self) {
        self.count = 0;
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        self.count = other.count.min(self.buffer.len());
        self.buffer[..self.count].copy_from_slice(&other.buffer[..self.count]);
    }

    /// Adds a record; when the buffer is full it is dropped, and false returned.
    pub(super) fn push(&mut self, touch: Touch) -> bool {
        let Some(slot) = self.buffer.get_mut(self.count) else { return false };
        *slot = touch;
        self.count += 1;
        true
    }
}

impl From<Vec<Touch>> for Touching {
    fn from(touches: Vec<Touch>) -> Self {
        Self { count: touches.len(), buffer: touches.into_boxed_slice() }
    }
}

impl From<Touching> for Vec<Touch> {
    fn from(touching: Touching) -> Self {
        touching.records().to_vec()
    }
}

impl PartialEq for Touching {
    fn eq(&self, other: &Self) -> bool {
        self.records() == other.records()
    }
}
