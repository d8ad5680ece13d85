//! Merging of points: those that coincide, and those that face each other across a gap.
use super::{Repairs, Soup, edges_of};
use crate::places::{Grid, first_at_each_place};
use glam::DVec3;
use std::collections::BTreeMap;

/// Points on open edges are joined across gaps up to this part of their open edges' length.
const GAP: f64 = 0.3;

/// Merges points that `may_weld` allows and that are nearer than `tolerance`; drops triangles that are degenerate or
/// present twice.
pub(super) fn weld(
    points: &[DVec3],
    triangles: &[[u32; 3]],
    tolerance: f64,
    may_weld: impl Fn(u32) -> bool,
    repairs: &mut Repairs,
) -> Soup {
    let map = first_at_each_place(points, tolerance, may_weld);
    repairs.welded_points += (0..).zip(&map).filter(|(v, first)| v != *first).count();
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
