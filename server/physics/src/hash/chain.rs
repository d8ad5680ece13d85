//! A hash of every bit that ticks change, chained from tick to tick: two runs that differ in one bit of one tick have different hashes
//! from there on.
//!
//! FNV-1a over numbers that are taken one by one: whichever structs hold them, the same run has the same hash. A list comes after its
//! length, what may be missing after 0 or 1. What a state keeps for speed alone (boxes, layouts, buffers) is left out; it shows in the
//! ticks after, if it is wrong. What of a whole state is added, and in which order, is where the state is ([`crate::world`]).
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
    /// Goes on after a hash.
    pub fn after(hash: u64) -> Self {
        Self(hash)
    }

    /// The hash of all that was added.
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

    /// Adds whether something is so.
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

    /// Adds a list of anything.
    pub fn list<T>(&mut self, list: &[T], mut add: impl FnMut(&mut Self, &T)) {
        self.whole(list.len() as u64);
        for entry in list {
            add(self, entry);
        }
    }

    /// Adds what may be missing.
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

    /// A list that begins earlier is not one that ends later.
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
