//! The vertices and triangles that may meet before the surface has moved some way, in a list that never grows.

/// Most pairs that are listed, per vertex of the skin, and at least.
const PAIRS_PER_VERTEX: usize = 8;
const AT_LEAST: usize = 4096;

/// Pairs of a vertex and a triangle that are near each other. It follows from positions: it is neither saved nor
/// compared. Its clones keep the capacity.
#[derive(Debug, Clone)]
pub(in crate::contact) struct NearWalls {
    pairs: Box<[[u32; 2]]>,
    count: usize,
    /// How far (m) the surface may still move until the list is out of date.
    pub(in crate::contact) slack_m: f64,
    /// Number of pairs for which there was no room.
    pub(super) missed: u32,
}

impl Default for NearWalls {
    fn default() -> Self {
        Self { pairs: Box::default(), count: 0, slack_m: f64::NEG_INFINITY, missed: 0 }
    }
}

impl NearWalls {
    pub(super) fn with_room(vertices: usize) -> Self {
        let room = (PAIRS_PER_VERTEX * vertices).max(AT_LEAST);
        Self { pairs: vec![[0; 2]; room].into_boxed_slice(), ..Self::default() }
    }

    /// Returns the pairs, sorted by vertex and then by triangle.
    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs[..self.count]
    }

    pub(super) fn clear(&mut self) {
        (self.count, self.missed) = (0, 0);
    }

    pub(super) fn push(&mut self, node: u32, triangle: usize) {
        match self.pairs.get_mut(self.count) {
            Some(slot) => {
                *slot = [node, triangle as u32];
                self.count += 1;
            }
            None => self.missed = self.missed.saturating_add(1),
        }
    }

    /// Sorts the pairs, so that sums have the same bits whenever they were listed.
    pub(super) fn finish(&mut self) {
        self.pairs[..self.count].sort_unstable();
    }
}
