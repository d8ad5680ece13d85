//! Numbers of the free degrees of freedom.
use glam::{BVec3, DVec3};

/// Marks an axis that is prescribed.
pub(crate) const NONE: u32 = u32::MAX;

/// Numbers of the free degrees of freedom.
#[derive(Debug, Clone)]
pub(crate) struct FreeAxes {
    /// Number of each node's axes, [`NONE`] where prescribed.
    pub(crate) number: Vec<[u32; 3]>,
    /// How many are free.
    pub(crate) count: usize,
}

impl FreeAxes {
    /// Of nodes whose free axes are given.
    pub(crate) fn numbered(free: impl Iterator<Item = BVec3>) -> Self {
        let mut count = 0;
        let number = free
            .map(|free| {
                std::array::from_fn(|axis| {
                    if !free.test(axis) {
                        return NONE;
                    }
                    count += 1;
                    count - 1
                })
            })
            .collect();
        Self { number, count: count as usize }
    }

    /// The free components, in order.
    pub(crate) fn gather(&self, nodal: &[DVec3], free: &mut [f64]) {
        for (numbers, value) in self.number.iter().zip(nodal) {
            for axis in (0..3).filter(|&axis| numbers[axis] != NONE) {
                free[numbers[axis] as usize] = value[axis];
            }
        }
    }

    /// The nodal field with zero on prescribed axes.
    pub(crate) fn scatter(&self, free: &[f64]) -> Vec<DVec3> {
        let value = |number: u32| if number == NONE { 0.0 } else { free[number as usize] };
        self.number.iter().map(|n| DVec3::new(value(n[0]), value(n[1]), value(n[2]))).collect()
    }
}
