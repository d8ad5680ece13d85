//! Merging of points: those that coincide, and those that face each other across a gap.
use super::{Repairs, Soup, edges_of};
use glam::DVec3;
use std::collections::{BTreeMap, HashMap};

/// Points nearer than this part of the bounding box's diagonal are one point (single-precision files need 1e-7).
const SAME_POINT: f64 = 1e-6;
/// Points on open edges are joined across gaps up to this part of their open edges' length.
const GAP: f64 = 0.3;

/// Points by cell of a grid with the given cell size; queries look at the 27 cells around.
struct Grid<'a> {
    points: &'a [DVec3],
    cell: f64,
    cells: HashMap<[i64; 3], Vec<u32>>,
}

impl<'a> Grid<'a> {
    fn new(points: &'a [DVec3], cell: f64) -> Self {
        Self { points, cell, cells: HashMap::new() }
    }

    fn key(&self, p: DVec3) -> [i64; 3] {
        (p / self.cell).floor().to_array().map(|x| x as i64)
    }

    fn insert(&mut self, v: u32) {
        self.cells.entry(self.key(self.points[v as usize])).or_default().push(v);
    }

    /// Nearest inserted point within the cell size that `ok` accepts, lowest index first among equals.
    fn nearest(&self, p: DVec3, ok: impl Fn(u32) -> bool) -> Option<(u32, f64)> {
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

/// Merges coinciding points; drops triangles that are degenerate or present twice.
pub(super) fn weld(points: &[DVec3], triangles: &[[u32; 3]], repairs: &mut Repairs) -> Soup {
    let diagonal = Soup::diagonal(points);
    let tolerance = if diagonal > 0.0 { SAME_POINT * diagonal } else { 1.0 };
    let mut grid = Grid::new(points, tolerance);
    let mut map: Vec<u32> = Vec::with_capacity(points.len());
    for v in 0..points.len() as u32 {
        if let Some((first, _)) = grid.nearest(points[v as usize], |_| true) {
            map.push(first);
            repairs.welded_points += 1;
        } else {
            map.push(v);
            grid.insert(v);
        }
    }
    let mut soup = Soup { points: points.to_vec(), triangles: triangles.to_vec() };
    soup.renumber(&map, repairs);
    // Flat triangles with three different corners would open a slit when dropped; they stay and do no harm.
    soup
}

/// Joins points of open edges with points of other open edges that face them across a gap.
pub(super) fn join_gaps(soup: &mut Soup, repairs: &mut Repairs) {
    let edges = edges_of(&soup.triangles);
    // Shortest open edge at every point; infinite inside.
    let mut reach = vec![f64::INFINITY; soup.points.len()];
    for [a, b] in edges.iter().filter(|(_, t)| t.len() == 1).map(|(e, _)| *e) {
        let length = soup.points[a as usize].distance(soup.points[b as usize]);
        for v in [a, b] {
            reach[v as usize] = reach[v as usize].min(length);
        }
    }
    let open: Vec<u32> = (0..soup.points.len() as u32).filter(|&v| reach[v as usize].is_finite()).collect();
    let longest = open.iter().map(|&v| reach[v as usize]).fold(0.0, f64::max);
    if open.is_empty() || longest == 0.0 {
        return;
    }
    let mut grid = Grid::new(&soup.points, GAP * longest);
    for &v in &open {
        grid.insert(v);
    }
    // Neighbours along the same open line do not face each other, however jagged it is.
    let mut beside: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for [a, b] in edges.iter().filter(|(_, t)| t.len() == 1).map(|(e, _)| *e) {
        beside.entry(a).or_default().push(b);
        beside.entry(b).or_default().push(a);
    }
    let close = |a: u32, b: u32| {
        let of_b = beside.get(&b);
        let shared = beside.get(&a).into_iter().flatten().any(|v| of_b.is_some_and(|of_b| of_b.contains(v)));
        shared || edges.contains_key(&[a.min(b), a.max(b)])
    };
    let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
    for &v in &open {
        let ok = |w: u32| w != v && !close(v, w);
        if let Some((w, distance)) = grid.nearest(soup.points[v as usize], ok)
            && distance <= GAP * reach[v as usize].min(reach[w as usize])
        {
            pairs.push((distance, v.min(w), v.max(w)));
        }
    }
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    pairs.dedup();
    let mut map: Vec<u32> = (0..soup.points.len() as u32).collect();
    let mut taken = vec![false; soup.points.len()];
    for (_, v, w) in pairs {
        if !taken[v as usize] && !taken[w as usize] {
            taken[v as usize] = true;
            taken[w as usize] = true;
            map[w as usize] = v;
            soup.points[v as usize] = 0.5 * (soup.points[v as usize] + soup.points[w as usize]);
            repairs.joined_gap_points += 1;
        }
    }
    if repairs.joined_gap_points > 0 {
        soup.renumber(&map, repairs);
    }
}
