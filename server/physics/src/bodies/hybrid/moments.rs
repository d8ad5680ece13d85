//! Moments of the part of each lattice cell that is body: its volume, and the integrals of its shape gradients.
//!
//! A cell `c` is integrated with one point (`F_c = Σ_p y_p b_cpᵀ`), so all that it needs to know of the shape of the
//! body within it is
//! ```text
//! V_c = ∫_{c∩Ω} dV        V_c b_cp = ∫_{c∩Ω} ∇N_p dV        N_p trilinear
//! ```
//! `Σ_p b_cp = 0` and `Σ_p X_p b_cpᵀ = I` hold whatever the shape, because they hold at every point: affine motion is
//! reproduced. The integrals of all cells at an interior particle add up to that of `∇N_p` over its whole support,
//! which is zero: uniform stress leaves the particle in balance.
//!
//! The integrals are taken along rays in z, [`RAYS`] by [`RAYS`] to a cell, exactly between the points where a ray
//! crosses the surface. Which side of an edge a ray passes is decided by the same arithmetic for both triangles of the
//! edge, so no ray slips through.
use super::{sites::Sites, skin::Skin};
use glam::DVec3;

/// Number of rays through a cell along each of x and y.
const RAYS: usize = 6;
/// A cell is left out if the body fills less than this fraction of it.
const LEAST_FILLED: f64 = 0.01;
/// A cell counts as full if the body fills this fraction of it, or more.
const FULL: f64 = 1.0 - 1e-9;

/// Volume and shape gradients of the part of a cell that is body, integrated over it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments {
    /// `V_c` (m³).
    pub volume_m3: f64,
    /// `V_c b_cp` (m²), `p` the cell's particles.
    pub gradients_m2: [DVec3; 8],
}

impl Moments {
    /// Returns the moments of a full cell.
    pub fn full(edge_m: f64) -> Self {
        Self { volume_m3: edge_m.powi(3), gradients_m2: full_gradients_m2(edge_m) }
    }
}

/// The moments of the part of one cell that is body, with its number.
#[derive(Debug, Clone, PartialEq)]
pub struct CellMoments {
    /// Number of the cell.
    pub cell: usize,
    /// Whether it is eight cells merged into one, of which `cell` is the first (`sizes`).
    pub doubled: bool,
    /// `V_c` (m³).
    pub volume_m3: f64,
    /// `V_c b_cp` (m²); `None` for a full cell, which has [`full_gradients_m2`].
    pub gradients_m2: Option<Box<[DVec3; 8]>>,
}

/// Returns `V b_p` (m²) of a full cell of spacing h: `± h²/4` along every axis.
pub fn full_gradients_m2(spacing_m: f64) -> [DVec3; 8] {
    let quarter = 0.25 * spacing_m * spacing_m;
    super::sites::CORNERS.map(|corner| (corner * 2.0 - DVec3::ONE) * quarter)
}

/// Returns the cells that hold some of the body, ascending. `progress` is told the fraction done.
pub fn integrate(skin: &Skin, sites: &Sites, progress: &mut dyn FnMut(f64)) -> Vec<CellMoments> {
    let [_, rows, _] = sites.cells();
    let in_row = triangles_by_row(skin, sites);
    let mut found = Vec::new();
    let mut row = Row::new(sites);
    for (j, triangles) in in_row.iter().enumerate() {
        row.integrate(skin, triangles, j);
        row.move_into(j, &mut found);
        progress((j + 1) as f64 / rows as f64);
    }
    found.sort_by_key(|moments| moments.cell);
    found
}

/// Returns the triangles that reach into each row of cells, a row being all cells of one y.
fn triangles_by_row(skin: &Skin, sites: &Sites) -> Vec<Vec<u32>> {
    let mut rows = vec![Vec::new(); sites.cells()[1]];
    for triangle in 0..skin.triangles().len() {
        let corners = skin.corners_m(triangle);
        let low = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
        let high = corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
        for row in &mut rows[sites.cell_near(low)[1]..=sites.cell_near(high)[1]] {
            row.push(triangle as u32);
        }
    }
    rows
}

/// A point where a ray crosses the surface.
#[derive(Debug, Clone, Copy)]
struct Crossing {
    ray: u32,
    /// Height above the origin, in cells.
    z: f64,
    enters: bool,
}

#[derive(Debug, Clone, Copy)]
struct Sums {
    volume: f64,
    gradients: [DVec3; 8],
}

impl Sums {
    const ZERO: Self = Self { volume: 0.0, gradients: [DVec3::ZERO; 8] };
}

/// The cells of one y; lengths are in units of the spacing.
struct Row<'a> {
    sites: &'a Sites,
    crossings: Vec<Crossing>,
    sums: Vec<Sums>,
}

impl<'a> Row<'a> {
    fn new(sites: &'a Sites) -> Self {
        let [nx, _, nz] = sites.cells();
        Self { sites, crossings: Vec::new(), sums: vec![Sums::ZERO; nx * nz] }
    }

    fn integrate(&mut self, skin: &Skin, triangles: &[u32], j: usize) {
        self.crossings.clear();
        let [nx, ..] = self.sites.cells();
        let (origin_m, spacing_m) = (self.sites.cell_m(0), self.sites.spacing_m());
        for &triangle in triangles {
            let ids = skin.triangles()[triangle as usize];
            let corners = skin.corners_m(triangle as usize).map(|p| (p - origin_m) / spacing_m);
            cross(ids, corners, nx, j, &mut self.crossings);
        }
        self.crossings.sort_by(|a, b| a.ray.cmp(&b.ray).then(a.z.total_cmp(&b.z)).then(b.enters.cmp(&a.enters)));
        let mut depth = 0;
        for at in 0..self.crossings.len() {
            let Crossing { ray, z, enters } = self.crossings[at];
            depth = if at > 0 && self.crossings[at - 1].ray == ray { depth } else { 0 };
            depth += if enters { 1 } else { -1 };
            if let Some(next) = self.crossings.get(at + 1).filter(|next| next.ray == ray && depth > 0) {
                let next_z = next.z;
                self.add(ray as usize, z, next_z);
            }
        }
    }

    /// Adds one stretch of a ray within the body.
    fn add(&mut self, ray: usize, from: f64, to: f64) {
        let [nx, _, nz] = self.sites.cells();
        let (along_x, along_y) = (ray % (nx * RAYS), ray / (nx * RAYS));
        let at = |n: usize| ((n % RAYS) as f64 + 0.5) / RAYS as f64;
        let (x, y) = (at(along_x), at(along_y));
        let fraction = 1.0 / (RAYS * RAYS) as f64;
        let (from, to) = (from.max(0.0), to.min(nz as f64));
        for k in from as usize..(to.ceil().max(0.0) as usize).min(nz) {
            let (a, b) = ((from - k as f64).max(0.0), (to - k as f64).min(1.0));
            if b <= a {
                continue;
            }
            let sums = &mut self.sums[k * nx + along_x / RAYS];
            sums.volume += (b - a) * fraction;
            // ∫ z dz over the stretch within the cell
            let first = 0.5 * (b * b - a * a);
            for (gradient, corner) in sums.gradients.iter_mut().zip(super::sites::CORNERS) {
                let [sx, sy, sz] = (corner * 2.0 - DVec3::ONE).to_array();
                let wx = if corner.x == 0.0 { 1.0 - x } else { x };
                let wy = if corner.y == 0.0 { 1.0 - y } else { y };
                let wz = if corner.z == 0.0 { b - a - first } else { first };
                *gradient += DVec3::new(sx * wy * wz, sy * wx * wz, sz * wx * wy * (b - a)) * fraction;
            }
        }
    }

    /// Moves what was found into `found`, and clears the row.
    fn move_into(&mut self, j: usize, found: &mut Vec<CellMoments>) {
        let [nx, ..] = self.sites.cells();
        let h = self.sites.spacing_m();
        for (at, sums) in self.sums.iter_mut().enumerate() {
            if sums.volume >= LEAST_FILLED {
                let cut = sums.volume < FULL;
                found.push(CellMoments {
                    cell: self.sites.cell([at % nx, j, at / nx]),
                    doubled: false,
                    volume_m3: if cut { sums.volume * h.powi(3) } else { h.powi(3) },
                    gradients_m2: cut.then(|| Box::new(sums.gradients.map(|g| g * (h * h)))),
                });
            }
            *sums = Sums::ZERO;
        }
    }
}

/// Finds where the rays of row `j` cross a triangle, whose corners are given in cells from the origin.
fn cross(ids: [u32; 3], corners: [DVec3; 3], nx: usize, j: usize, crossings: &mut Vec<Crossing>) {
    let low = corners.iter().fold(DVec3::INFINITY, |low, p| low.min(*p));
    let high = corners.iter().fold(DVec3::NEG_INFINITY, |high, p| high.max(*p));
    let rays = |low: f64, high: f64, first: usize, count: usize| {
        let number = |at: f64| at * RAYS as f64 - 0.5;
        let from = (number(low).floor().max(first as f64)) as usize;
        let to = (number(high).ceil().max(0.0) as usize + 1).min(first + count);
        from..to
    };
    for along_y in rays(low.y, high.y, j * RAYS, RAYS) {
        for along_x in rays(low.x, high.x, 0, nx * RAYS) {
            let (x, y) = ((along_x as f64 + 0.5) / RAYS as f64, (along_y as f64 + 0.5) / RAYS as f64);
            // Twice the areas that the point makes with the edges; the sign is that of the edge from its lower to its
            // higher vertex.
            let mut areas = [0.0; 3];
            let mut left = [false; 3];
            for edge in 0..3 {
                let (a, b) = ((edge + 1) % 3, (edge + 2) % 3);
                let (u, v, turned) = if ids[a] < ids[b] { (a, b, false) } else { (b, a, true) };
                let (u, v) = (corners[u], corners[v]);
                let area = (v.x - u.x) * (y - u.y) - (v.y - u.y) * (x - u.x);
                left[edge] = (area >= 0.0) != turned;
                areas[edge] = if turned { -area } else { area };
            }
            if left[0] != left[1] || left[1] != left[2] {
                continue;
            }
            let total: f64 = areas.iter().sum();
            let height = (areas[0] * corners[0].z + areas[1] * corners[1].z + areas[2] * corners[2].z) / total;
            let z = if height.is_finite() { height.clamp(low.z, high.z) } else { low.z };
            // Triangles are counter-clockwise seen from outside: through one that faces down a ray enters the body.
            let ray = (along_y - j * RAYS) * nx * RAYS + along_x;
            crossings.push(Crossing { ray: ray as u32, z, enters: !left[0] });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::{sites::CORNERS, testing::ball};

    fn cells_of(skin: &Skin, sites: &Sites) -> Vec<CellMoments> {
        integrate(skin, sites, &mut |_| {})
    }

    fn gradients_m2(moments: &CellMoments, sites: &Sites) -> [DVec3; 8] {
        moments.gradients_m2.as_deref().copied().unwrap_or(full_gradients_m2(sites.spacing_m()))
    }

    #[test]
    fn every_cell_reproduces_affine_motion_and_interior_particles_balance() {
        let skin = ball(0.01, DVec3::new(0.003, -0.002, 0.001), 4);
        let sites = Sites::covering(skin.bounds_m(), 1.5e-3, DVec3::splat(0.4e-3));
        let found = cells_of(&skin, &sites);
        let mut at_site = vec![(DVec3::ZERO, 0); sites.site_count()];
        for moments in &found {
            let gradients = gradients_m2(moments, &sites);
            let sum: DVec3 = gradients.iter().sum();
            assert!(sum.length() < 1e-18);
            for axis in 0..3 {
                let column: DVec3 =
                    gradients.iter().zip(CORNERS).map(|(g, c)| *g * (c[axis] * sites.spacing_m())).sum();
                assert!((column - DVec3::AXES[axis] * moments.volume_m3).length() < 1e-12 * 1e-9);
            }
            for (site, gradient) in sites.corners(moments.cell).into_iter().zip(gradients) {
                at_site[site].0 += gradient;
                at_site[site].1 += usize::from(moments.gradients_m2.is_none());
            }
        }
        let interior: Vec<_> = at_site.iter().filter(|(_, full)| *full == 8).collect();
        assert!(interior.len() > 500);
        for (sum, _) in interior {
            assert!(sum.length() < 1e-15 * 1e-3, "{sum}");
        }
    }

    #[test]
    fn the_volume_is_that_of_the_surface() {
        let skin = ball(0.01, DVec3::ZERO, 4);
        let mut errors = Vec::new();
        for spacing_m in [4e-3, 2e-3, 1e-3] {
            let sites = Sites::covering(skin.bounds_m(), spacing_m, DVec3::new(0.3e-3, 0.1e-3, 0.2e-3));
            let volume: f64 = cells_of(&skin, &sites).iter().map(|m| m.volume_m3).sum();
            errors.push((volume / skin.volume_m3() - 1.0).abs());
        }
        assert!(errors[0] < 2e-2 && errors[1] < 5e-3 && errors[2] < 2e-3, "{errors:?}");
    }

    /// In a box whose faces lie on planes of sites every cell is full, and rounding adds none outside.
    #[test]
    fn a_box_on_the_lattice_has_full_cells_only() {
        let p: Vec<DVec3> = CORNERS.map(|c| c * DVec3::new(0.08, 0.08, 0.04) - DVec3::new(0.04, 0.04, 0.0)).to_vec();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let skin = Skin::new(p, triangles).unwrap();
        let sites = Sites::covering(skin.bounds_m(), 2.5e-3, DVec3::ZERO);
        let found = cells_of(&skin, &sites);
        assert_eq!(found.len(), 32 * 32 * 16);
        assert!(found.iter().all(|m| m.gradients_m2.is_none()));
    }
}
