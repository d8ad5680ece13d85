//! Points that lie at one place.
use glam::DVec3;
use std::collections::HashMap;

/// Points nearer than this part of the bounding box's diagonal are one point (single-precision files need 1e-7).
const SAME_POINT: f64 = 1e-6;

/// Returns the distance below which points lie at one place, as far as rounding tells.
pub(crate) fn same_place(points: &[DVec3]) -> f64 {
    let low = points.iter().fold(DVec3::INFINITY, |m, p| m.min(*p));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |m, p| m.max(*p));
    let diagonal = low.distance(high);
    if diagonal > 0.0 { SAME_POINT * diagonal } else { 1.0 }
}

/// Returns for every point the first one at its place: itself, or one within `tolerance`. Points that `counts` leaves
/// out are by themselves.
pub(crate) fn first_at_each_place(points: &[DVec3], tolerance: f64, counts: impl Fn(u32) -> bool) -> Vec<u32> {
    let mut grid = Grid::new(points, tolerance);
    let mut first_of = Vec::with_capacity(points.len());
    for v in 0..points.len() as u32 {
        let first = if counts(v) { grid.nearest(points[v as usize], |_| true) } else { None };
        if first.is_none() && counts(v) {
            grid.insert(v);
        }
        first_of.push(first.map_or(v, |(first, _)| first));
    }
    first_of
}

/// Points by cell of a grid with the given cell size; queries look at the 27 cells around.
pub(crate) struct Grid<'a> {
    points: &'a [DVec3],
    cell: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Grid<'a> {
    pub(crate) fn new(points: &'a [DVec3], cell: f64) -> Self {
        Self { points, cell, cells: HashMap::new() }
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        (p / self.cell).floor().to_array().map(|x| x as i64)
    }

    pub(crate) fn insert(&mut self, v: u32) {
        self.cells.entry(self.key(self.points[v as usize])).or_default().push(v);
    }

    /// Nearest inserted point within the cell size that `ok` accepts, lowest index first among equals.
    pub(crate) fn nearest(&self, p: DVec3, ok: impl Fn(u32) -> bool) -> Option<(u32, f64)> {
        let [x, y, z] = self.key(p);
        let mut best: Option<(u32, f64)> = None;
        for (dx, dy, dz) in (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| (i, j, k)))) {
            for &v in self
                .cells
                .get(&[x.saturating_add(dx), y.saturating_add(dy), z.saturating_add(dz)])
                .into_iter()
                .flatten()
            {
                let distance = self.points[v as usize].distance(p);
                let better = best.is_none_or(|(w, least)| (distance, v) < (least, w));
                if distance <= self.cell && better && ok(v) {
                    best = Some((v, distance));
                }
            }
        }
        best
    }
}
