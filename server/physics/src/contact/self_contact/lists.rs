//! The vertices and triangles that may meet before the surface has moved some way, in a list that never grows.

/// Most pairs that are listed, per vertex of the skin, and at least.
const PAIRS_PER_VERTEX: usize = 24;
const AT_LEAST: usize = 4096;
/// A way (m) that no surface moves between two queries.
const FOR_EVER_M: f64 = 1e6;

/// A vertex and a triangle that are near each other.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub(super) struct Pair {
    pub(super) node: u32,
    pub(super) triangle: u32,
    /// How far (m) the surface has to have moved since the query before they can be within the vertex's reach.
    pub(super) free_m: f64,
}

/// Pairs of a vertex and a triangle that are near each other. It follows from positions: it is neither saved nor
/// compared. Its clones keep the capacity.
#[derive(Debug, Clone)]
pub(in crate::contact) struct NearWalls {
    pairs: Box<[Pair]>,
    count: usize,
    /// How far (m) the surface may still move until the list is out of date.
    pub(in crate::contact) slack_m: f64,
    /// The same when the list was made.
    whole_slack_m: f64,
    /// Number of pairs for which there was no room.
    pub(super) missed: u32,
}

impl Default for NearWalls {
    fn default() -> Self {
        Self { pairs: Box::default(), count: 0, slack_m: f64::NEG_INFINITY, whole_slack_m: 0.0, missed: 0 }
    }
}

impl NearWalls {
    pub(super) fn with_room(vertices: usize) -> Self {
        let room = (PAIRS_PER_VERTEX * vertices).max(AT_LEAST);
        let none = Pair { node: 0, triangle: 0, free_m: 0.0 };
        Self { pairs: vec![none; room].into_boxed_slice(), ..Self::default() }
    }

    /// Returns the pairs, sorted by vertex and then by triangle.
    pub(super) fn pairs(&self) -> &[Pair] {
        &self.pairs[..self.count]
    }

    /// Returns the same, to note how far they are, and how far (m) the surface has moved since the query.
    pub(super) fn pairs_mut(&mut self) -> (&mut [Pair], f64) {
        (&mut self.pairs[..self.count], self.whole_slack_m - self.slack_m)
    }

    pub(super) fn clear(&mut self) {
        (self.count, self.missed) = (0, 0);
    }

    pub(super) fn push(&mut self, pair: Pair) {
        match self.pairs.get_mut(self.count) {
            Some(slot) => {
                *slot = pair;
                self.count += 1;
            }
            None => self.missed = self.missed.saturating_add(1),
        }
    }

    /// Sorts the pairs, so that sums have the same bits whenever they were listed, which serve while the surface moves no
    /// more than `slack_m` (m).
    pub(super) fn finish(&mut self, slack_m: f64) {
        self.pairs[..self.count].sort_unstable_by_key(|pair| (pair.node, pair.triangle));
        self.slack_m = slack_m.min(FOR_EVER_M);
        self.whole_slack_m = self.slack_m;
    }

    /// Does the same where the list is to be made again at once, and every pair looked at.
    pub(super) fn finish_for_now(&mut self) {
        self.finish(0.0);
        self.pairs[..self.count].iter_mut().for_each(|pair| pair.free_m = f64::NEG_INFINITY);
        self.slack_m = f64::NEG_INFINITY;
    }
}
