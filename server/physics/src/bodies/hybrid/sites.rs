//! The cubic lattice on which particles sit, in the rest state.
use glam::DVec3;

/// Corners of a cell, in units of the spacing: bit 0 is x, bit 1 is y, bit 2 is z.
pub const CORNERS: [DVec3; 8] = [
    DVec3::new(0.0, 0.0, 0.0),
    DVec3::new(1.0, 0.0, 0.0),
    DVec3::new(0.0, 1.0, 0.0),
    DVec3::new(1.0, 1.0, 0.0),
    DVec3::new(0.0, 0.0, 1.0),
    DVec3::new(1.0, 0.0, 1.0),
    DVec3::new(0.0, 1.0, 1.0),
    DVec3::new(1.0, 1.0, 1.0),
];

/// Sites `origin + h (i, j, k)` of a box of cubic cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sites {
    origin_m: DVec3,
    spacing_m: f64,
    cells: [usize; 3],
}

impl Sites {
    /// Makes the sites of cells of `spacing_m` that cover a box, with sites on the planes through `on_m`.
    pub fn covering((low_m, high_m): (DVec3, DVec3), spacing_m: f64, on_m: DVec3) -> Self {
        // A box that ends on a plane of sites, but for rounding, gets no further cells.
        let slack = 1e-9;
        let first = ((low_m - on_m) / spacing_m + slack).floor();
        let last = ((high_m - on_m) / spacing_m - slack).ceil();
        let cells = (last - first).max(DVec3::ONE);
        Self { origin_m: on_m + first * spacing_m, spacing_m, cells: cells.to_array().map(|n| n as usize) }
    }

    /// Returns the spacing h (m).
    pub fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// Returns the number of cells along each axis.
    pub fn cells(&self) -> [usize; 3] {
        self.cells
    }

    /// Returns the number of all cells of the box.
    pub fn cell_count(&self) -> usize {
        self.cells.iter().product()
    }

    /// Returns the number of all sites of the box.
    pub fn site_count(&self) -> usize {
        self.cells.iter().map(|n| n + 1).product()
    }

    /// Returns the number of a cell.
    pub fn cell(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * self.cells[1] + j) * self.cells[0] + i
    }

    /// Returns where a cell is, in cells from the origin.
    pub fn cell_at(&self, cell: usize) -> [usize; 3] {
        let [nx, ny, _] = self.cells;
        [cell % nx, cell / nx % ny, cell / (nx * ny)]
    }

    /// Returns the number of a site.
    pub fn site(&self, [i, j, k]: [usize; 3]) -> usize {
        (k * (self.cells[1] + 1) + j) * (self.cells[0] + 1) + i
    }

    /// Returns the position (m) of a site.
    pub fn site_m(&self, site: usize) -> DVec3 {
        let [nx, ny] = [self.cells[0] + 1, self.cells[1] + 1];
        self.at_m([site % nx, site / nx % ny, site / (nx * ny)])
    }

    /// Returns the sites of a cell's corners, in the order of [`CORNERS`].
    pub fn corners(&self, cell: usize) -> [usize; 8] {
        let [i, j, k] = self.cell_at(cell);
        std::array::from_fn(|corner| self.site([i + (corner & 1), j + (corner >> 1 & 1), k + (corner >> 2)]))
    }

    /// Returns the position (m) of a cell's first corner.
    pub fn cell_m(&self, cell: usize) -> DVec3 {
        self.at_m(self.cell_at(cell))
    }

    /// Returns the cell of the box that holds a point or is nearest to it.
    pub fn cell_near(&self, point_m: DVec3) -> [usize; 3] {
        let from = (point_m - self.origin_m) / self.spacing_m;
        std::array::from_fn(|axis| (from[axis].max(0.0) as usize).min(self.cells[axis] - 1))
    }

    fn at_m(&self, at: [usize; 3]) -> DVec3 {
        self.origin_m + DVec3::from(at.map(|n| n as f64)) * self.spacing_m
    }
}

/// Returns the weights of a cell's corners at a point of it, given in units of the spacing from its first corner: the
/// trilinear shape functions.
pub fn trilinear(local: DVec3) -> [f64; 8] {
    CORNERS.map(|corner| {
        let factor = |axis: usize| if corner[axis] == 0.0 { 1.0 - local[axis] } else { local[axis] };
        factor(0) * factor(1) * factor(2)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_on_planes_of_sites_gets_no_cell_more() {
        let sites = Sites::covering((DVec3::ZERO, DVec3::new(0.3, 0.2, 0.1)), 0.1, DVec3::ZERO);
        assert_eq!(sites.cells(), [3, 2, 1]);
        let off = Sites::covering((DVec3::ZERO, DVec3::new(0.3, 0.2, 0.1)), 0.1, DVec3::splat(0.05));
        assert_eq!(off.cells(), [4, 3, 2]);
        assert!((off.cell_m(0) - DVec3::splat(-0.05)).length() < 1e-15);
    }

    #[test]
    fn numbers_and_positions_agree() {
        let sites = Sites::covering((DVec3::ZERO, DVec3::new(0.3, 0.2, 0.4)), 0.1, DVec3::ZERO);
        for cell in 0..sites.cell_count() {
            assert_eq!(sites.cell(sites.cell_at(cell)), cell);
            for (site, corner) in sites.corners(cell).into_iter().zip(CORNERS) {
                assert!((sites.site_m(site) - sites.cell_m(cell) - corner * 0.1).length() < 1e-15);
            }
            assert_eq!(sites.cell(sites.cell_near(sites.cell_m(cell) + DVec3::splat(0.03))), cell);
        }
    }

    #[test]
    fn trilinear_weights_reproduce_the_point() {
        let local = DVec3::new(0.2, 0.7, -0.1);
        let weights = trilinear(local);
        assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-15);
        let point: DVec3 = weights.iter().zip(CORNERS).map(|(w, c)| c * *w).sum();
        assert!((point - local).length() < 1e-15);
    }
}
