//! The grid to which displacements are rounded before strains in f32 are computed from them.
use crate::settings::Precision;
use glam::DVec3;

/// The least strain that a grid leaves, or up to twice of it. From 2.3e-13 on, f32 has cubes as normal numbers: of the
/// strains that are left the least few have none. A coarser grid would cost digits of small strains.
const LEAST_STRAIN: f64 = 1e-13;

/// Multiples of a length, to which displacements are rounded.
///
/// A body that is still moves by the last bits of its positions, 1e-18 m. Those are strains of 1e-16, whose cubes f32 has
/// only as subnormal numbers, and processors compute subnormal numbers much more slowly. On a grid such strains are zero.
/// The grid follows the largest elements' size, so that a strain of 1e-6 keeps six digits in these, and one less in
/// elements a tenth as large.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct DisplacementGrid {
    /// `G = 1.5·2⁵² q` (m) of the grid's step `q`: f64 about `G` are its multiples. Zero for none.
    around_m: f64,
}

impl DisplacementGrid {
    /// Returns the grid for elements in which a displacement `u` of one node makes a strain of `u/extent_m` or more; in
    /// f64 there is none.
    ///
    /// Its step is the least power of two `q ≥ 1e-13·extent_m` (m).
    pub(crate) fn new(precision: Precision, extent_m: f64) -> Self {
        let around_m = match precision {
            Precision::Single => 1.5 * 2.0_f64.powi(52) * (LEAST_STRAIN * extent_m).log2().ceil().exp2(),
            Precision::Double => 0.0,
        };
        Self { around_m }
    }

    /// Returns the grid for tetrahedra, of which the largest has this volume `V` (m³): a regular one has edges of
    /// `2.04 V^⅓`.
    pub(crate) fn of_tets(precision: Precision, largest_m3: f64) -> Self {
        Self::new(precision, 2.04 * largest_m3.cbrt())
    }

    /// Returns the grid for cells with eight corners, of edge `h` (m) and of twice that edge, in which `u` of one corner
    /// makes a strain of `u/(8h)`.
    pub(crate) fn of_cells(precision: Precision, edge_m: f64) -> Self {
        Self::new(precision, 8.0 * edge_m)
    }

    /// Returns `(u + G) − G`, the multiple of the grid's step that is nearest to a displacement (m).
    pub(crate) fn rounded(self, u: DVec3) -> DVec3 {
        (u + self.around_m) - self.around_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacements_are_rounded_to_multiples_and_noise_to_zero() {
        for extent_m in [1e-4, 2.5e-3, 7e-3, 0.4] {
            let grid = DisplacementGrid::new(Precision::Single, extent_m);
            let step_m = grid.around_m / (1.5 * 2.0_f64.powi(52));
            assert!((LEAST_STRAIN..2.0 * LEAST_STRAIN).contains(&(step_m / extent_m)), "{extent_m} {step_m:e}");
            for strain in [1e-16, -3e-15, 4e-14, 1.1e-13, 2.6e-13, -1e-11, 1.234_567e-6, -0.42, 3.0] {
                let u = strain * extent_m;
                let rounded = grid.rounded(DVec3::splat(u)).x;
                assert!((rounded - u).abs() <= 0.5 * step_m, "{u:e} {rounded:e}");
                assert_eq!((rounded / step_m).fract(), 0.0, "{u:e}");
                assert_eq!(rounded == 0.0, strain.abs() < 5e-14, "{u:e}");
            }
        }
    }

    #[test]
    fn in_f64_nothing_is_rounded() {
        let grid = DisplacementGrid::of_tets(Precision::Double, 1e-9);
        for u in [1e-18, -2.345_678_9e-7, 0.1] {
            assert_eq!(grid.rounded(DVec3::splat(u)), DVec3::splat(u));
        }
    }
}
