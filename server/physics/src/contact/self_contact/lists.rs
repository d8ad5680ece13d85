//! The vertices and triangles that may meet before the surface has moved some way, in a list that never grows.

use crate::contact::{CarriersThen, ClustersThen, MostCarriers, broad::ROUNDING_M};
use glam::DVec3;

/// Most pairs that are listed, per vertex of the skin, and at least.
const PAIRS_PER_VERTEX: usize = 24;
const AT_LEAST: usize = 4096;
/// Part of the way until the next query after which it is looked again which pairs may be within reach: after a query, where
/// the surface may be at rest and stay so, and then.
const AWAKE_FIRST: f64 = 0.04;
const AWAKE: f64 = 0.2;
/// Part of the way until the next query below which a list is made anew rather than looked after.
const WORTH_KEEPING: f64 = 0.25;
/// Number of lists for one stride after it did not pay to list for several.
const SHORT: u32 = 64;
/// A way (m) that no surface moves between two queries.
const FOR_EVER_M: f64 = 1e6;

/// A vertex and a triangle that are near each other.
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd)]
pub(super) struct Pair {
    pub(super) node: u32,
    pub(super) triangle: u32,
    /// How far (m) the surface has to have moved since the query before they can matter.
    pub(super) free_m: f64,
}

/// Pairs of a vertex and a triangle that are near each other. It follows from positions: it is neither saved nor
/// compared. Its clones keep the capacity.
#[derive(Debug, Clone)]
pub(in crate::contact) struct NearWalls {
    pairs: Box<[Pair]>,
    count: usize,
    /// Number of lists until it is tried again to list for several strides.
    short: u32,
    /// How far (m) the surface may still move until the list is out of date.
    pub(in crate::contact) slack_m: f64,
    /// The same when the list was made.
    whole_slack_m: f64,
    /// Number of pairs for which there was no room.
    pub(super) missed: u32,
    /// What the walls that meet store (J), as far as it is known.
    energy_j: Option<f64>,
    /// How far (m) the surface may have moved since then until more pairs may be within reach than were told to be.
    awake_m: f64,
    /// Where (m) the nodes were when the list was made.
    then_m: Box<[DVec3]>,
    /// Where what carries the nodes was then, if they are vertices of a skin.
    pub(super) carriers_then: CarriersThen,
    /// Where what carries each cluster was then.
    pub(super) clusters_then: ClustersThen,
}

impl Default for NearWalls {
    fn default() -> Self {
        Self {
            pairs: Box::default(),
            count: 0,
            short: 0,
            slack_m: f64::NEG_INFINITY,
            whole_slack_m: 0.0,
            missed: 0,
            energy_j: None,
            awake_m: 0.0,
            then_m: Box::default(),
            carriers_then: CarriersThen::default(),
            clusters_then: ClustersThen::default(),
        }
    }
}

impl NearWalls {
    /// Makes room for pairs of so many vertices, among so many nodes of so many clusters, and for what carries these.
    pub(super) fn with_room(vertices: usize, nodes: usize, clusters: usize, carriers: MostCarriers) -> Self {
        let room = (PAIRS_PER_VERTEX * vertices).max(AT_LEAST);
        let none = Pair { node: 0, triangle: 0, free_m: 0.0 };
        let then_m = vec![DVec3::ZERO; nodes].into_boxed_slice();
        Self {
            pairs: vec![none; room].into_boxed_slice(),
            then_m,
            carriers_then: CarriersThen::with_room(carriers),
            clusters_then: ClustersThen::with_room(carriers, clusters),
            ..Self::default()
        }
    }

    /// Returns the pairs, sorted by vertex and then by triangle.
    pub(super) fn pairs(&self) -> &[Pair] {
        &self.pairs[..self.count]
    }

    /// Counts a list that is to be made. Returns whether it is to be tried to make it for several strides.
    pub(super) fn tries_long(&mut self) -> bool {
        self.short = self.short.saturating_sub(1);
        self.short == 0
    }

    /// Notes whether so little is near that it pays to list for several strides; if not, the next lists are for one.
    pub(super) fn tried_long(&mut self, pays: bool) {
        self.short = if pays { 0 } else { SHORT };
    }

    /// Returns a bound of how far (m) the surface is from where it was at the query.
    pub(super) fn moved_m(&self) -> f64 {
        self.whole_slack_m - self.slack_m
    }

    /// Notes where (m) the nodes are when the list is made.
    pub(super) fn remember(&mut self, x: &[DVec3]) {
        self.then_m.copy_from_slice(x);
    }

    /// Notes where (m) some of them are, if no others are asked for.
    pub(super) fn remember_some(&mut self, x: &[DVec3], nodes: impl Iterator<Item = u32>) {
        nodes.for_each(|node| self.then_m[node as usize] = x[node as usize]);
    }

    /// Looks, where the surface's travel has used the list up, how far (m) it really is from where it was: what trembles
    /// travels far and goes nowhere. Returns whether the list is good for some time after all.
    pub(super) fn is_still_good(&mut self, moved_m: impl FnOnce(&Self) -> f64) -> bool {
        if !self.slack_m.is_finite() {
            return false;
        }
        let slack_m = self.whole_slack_m - moved_m(self) - ROUNDING_M;
        let is_good = slack_m > WORTH_KEEPING * self.whole_slack_m;
        if is_good {
            self.slack_m = slack_m;
        }
        is_good
    }

    /// Returns where (m) a node was when the list was made.
    pub(super) fn then_m(&self, node: u32) -> DVec3 {
        self.then_m[node as usize]
    }

    /// Returns how far (m) the surface may have moved from there for the list to be worth keeping.
    pub(super) fn worth_keeping_m(&self) -> f64 {
        (1.0 - WORTH_KEEPING) * self.whole_slack_m - ROUNDING_M
    }

    /// Returns how far (m) the farthest of nodes at `x` (m) is from where it was when the list was made.
    pub(super) fn farthest_m(&self, x: &[DVec3]) -> f64 {
        x.iter().zip(&self.then_m).map(|(now, then)| now.distance_squared(*then)).fold(0.0, f64::max).sqrt()
    }

    /// Returns the pairs that may be within reach until the surface has moved some way.
    pub(super) fn awake(&self) -> impl Iterator<Item = &Pair> {
        self.pairs().iter().filter(|pair| pair.free_m <= self.awake_m)
    }

    /// Looks whether the surface has moved so far that more pairs may be within reach. Returns whether it has; then
    /// [`Self::awake`] tells of more.
    pub(super) fn wakes_more(&mut self) -> bool {
        let wakes = self.moved_m() > self.awake_m;
        if wakes {
            self.awake_m = self.moved_m() + AWAKE * self.whole_slack_m;
        }
        wakes
    }

    /// Forgets all that follows from positions.
    pub(in crate::contact) fn forget(&mut self) {
        (self.slack_m, self.energy_j) = (f64::NEG_INFINITY, None);
    }

    /// Returns what the walls that meet stored (J) at the last evaluation of forces, if it is known.
    pub(in crate::contact) fn energy_j(&self) -> Option<f64> {
        self.energy_j
    }

    pub(super) fn set_energy_j(&mut self, energy_j: f64) {
        self.energy_j = Some(energy_j);
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
            None => self.miss(),
        }
    }

    /// Counts what is not listed though it may meet.
    pub(super) fn miss(&mut self) {
        self.missed = self.missed.saturating_add(1);
    }

    /// Sorts the pairs, so that sums have the same bits whenever they were listed, which serve while the surface moves no
    /// more than `slack_m` (m). `later` tells of all pairs of a vertex how far (m) at least the surface has to move before any of them matters.
    pub(super) fn finish(&mut self, slack_m: f64, later: impl Fn(&[Pair]) -> f64) {
        let pairs = &mut self.pairs[..self.count];
        pairs.sort_unstable_by_key(|pair| (pair.node, pair.triangle));
        for of_vertex in pairs.chunk_by_mut(|one, next| one.node == next.node) {
            let free_m = later(of_vertex);
            for pair in of_vertex {
                pair.free_m = pair.free_m.max(free_m);
            }
        }
        self.slack_m = slack_m.min(FOR_EVER_M);
        self.whole_slack_m = self.slack_m;
        self.awake_m = AWAKE_FIRST * self.whole_slack_m;
    }
}
