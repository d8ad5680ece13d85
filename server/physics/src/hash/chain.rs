//! A hash of every bit that ticks change, which is chained from tick to tick: two runs that differ in one bit of one
//! tick have different hashes from there on.
//!
//! It is FNV-1a over numbers that are taken one by one, so that the same run has the same hash whichever structs hold
//! the numbers. The length of a list comes before it, and 0 or 1 before what may be missing. What a state keeps only
//! for speed (boxes, layouts, buffers) is left out; if it is wrong, this shows in the next ticks. The parts of a whole
//! state and their order are given where the state is ([`crate::world`]).
use super::{OFFSET, fnv};
use glam::{DMat3, DQuat, DVec3};

/// A hash that numbers are added to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Chain(u64);

impl Default for Chain {
    fn default() -> Self {
        Self(OFFSET)
    }
}

impl Chain {
    /// Returns a hash that continues another one.
    pub fn after(hash: u64) -> Self {
        Self(hash)
    }

    /// Returns the hash of everything that was added.
    pub fn value(self) -> u64 {
        self.0
    }

    /// Adds a whole number.
    pub fn whole(&mut self, number: u64) {
        self.0 = fnv(self.0, number.to_le_bytes().into_iter());
    }

    /// Adds the bits of a number.
    pub fn real(&mut self, number: f64) {
        self.whole(number.to_bits());
    }

    /// Adds a flag as 0 or 1.
    pub fn flag(&mut self, flag: bool) {
        self.whole(u64::from(flag));
    }

    /// Adds a vector.
    pub fn vector(&mut self, vector: DVec3) {
        vector.to_array().into_iter().for_each(|component| self.real(component));
    }

    /// Adds a rotation: x, y, z, w.
    pub fn rotation(&mut self, rotation: DQuat) {
        rotation.to_array().into_iter().for_each(|component| self.real(component));
    }

    /// Adds a matrix, column by column.
    pub fn matrix(&mut self, matrix: &DMat3) {
        matrix.to_cols_array().into_iter().for_each(|entry| self.real(entry));
    }

    /// Adds a list of vectors.
    pub fn vectors(&mut self, list: &[DVec3]) {
        self.list(list, |chain, vector| chain.vector(*vector));
    }

    /// Adds a list of numbers.
    pub fn reals(&mut self, list: &[f64]) {
        self.list(list, |chain, number| chain.real(*number));
    }

    /// Adds a list of whole numbers.
    pub fn wholes(&mut self, list: &[u32]) {
        self.list(list, |chain, number| chain.whole(u64::from(*number)));
    }

    /// Adds the length of a list, then its entries with `add`.
    pub fn list<T>(&mut self, list: &[T], mut add: impl FnMut(&mut Self, &T)) {
        self.whole(list.len() as u64);
        for entry in list {
            add(self, entry);
        }
    }

    /// Adds whether something is there, then the thing itself with `add`.
    pub fn maybe<T>(&mut self, what: Option<T>, add: impl FnOnce(&mut Self, T)) {
        self.flag(what.is_some());
        if let Some(what) = what {
            add(self, what);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An entry has another hash in the first of two lists than in the second.
    #[test]
    fn lists_do_not_run_into_one_another() {
        let of = |one: &[f64], other: &[f64]| {
            let mut chain = Chain::default();
            chain.reals(one);
            chain.reals(other);
            chain.value()
        };
        assert_ne!(of(&[0.0], &[]), of(&[], &[0.0]));
    }
}
