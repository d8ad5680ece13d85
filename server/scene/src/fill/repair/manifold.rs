//! One connected, oriented manifold out of triangles.
use super::{Repairs, Soup, edges_of};
use crate::fill::error::FillError;
use crate::fill::relation::enclosed_volume;
use crate::fill::trimesh::TriMesh;
use glam::DVec3;

/// Drops triangles until no edge has more than two: flaps (triangles with an open edge) first, then the smallest.
pub(super) fn drop_extra_triangles(soup: &mut Soup, repairs: &mut Repairs) {
    loop {
        let edges = edges_of(&soup.triangles);
        let open_sides = |t: u32| {
            let [a, b, c] = soup.triangles[t as usize];
            let is_open = |i: u32, j: u32| edges[&[i.min(j), i.max(j)]].len() == 1;
            usize::from(is_open(a, b)) + usize::from(is_open(b, c)) + usize::from(is_open(c, a))
        };
        let mut drop = vec![false; soup.triangles.len()];
        for owners in edges.values().filter(|owners| owners.len() > 2) {
            let worst = owners.iter().copied().max_by(|&s, &t| {
                let area = |t: u32| soup.area(soup.triangles[t as usize]);
                open_sides(s).cmp(&open_sides(t)).then(area(t).total_cmp(&area(s))).then(s.cmp(&t))
            });
            if let Some(t) = worst {
                drop[t as usize] = true;
            }
        }
        let count = drop.iter().filter(|&&d| d).count();
        if count == 0 {
            return;
        }
        repairs.non_manifold_triangles += count;
        let mut keep = drop.iter().map(|d| !d);
        soup.triangles.retain(|_| keep.next().unwrap_or(true));
        soup.compact();
    }
}

/// Triangles across the edges of each triangle.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut adjacent = vec![Vec::with_capacity(3); triangles.len()];
    for owners in edges_of(triangles).values() {
        if let [s, t] = owners[..] {
            adjacent[s as usize].push(t);
            adjacent[t as usize].push(s);
        }
    }
    adjacent
}

fn runs_along(triangle: [u32; 3], a: u32, b: u32) -> bool {
    (0..3).any(|i| triangle[i] == a && triangle[(i + 1) % 3] == b)
}

/// The two triangles run along a common edge in the same direction: one of them is the wrong way round.
fn disagree(s: [u32; 3], t: [u32; 3]) -> bool {
    (0..3).any(|i| runs_along(t, s[i], s[(i + 1) % 3]))
}

/// Turns triangles so that neighbours agree; in every part the minority by area is turned.
pub(super) fn orient(which: &'static str, soup: &mut Soup, repairs: &mut Repairs) -> Result<(), FillError> {
    let adjacent = neighbours(&soup.triangles);
    let mut turned: Vec<Option<bool>> = vec![None; soup.triangles.len()];
    for start in 0..soup.triangles.len() {
        if turned[start].is_some() {
            continue;
        }
        turned[start] = Some(false);
        let mut part = vec![start as u32];
        let mut done = 0;
        while done < part.len() {
            let t = part[done] as usize;
            done += 1;
            for &s in &adjacent[t] {
                let want = turned[t].unwrap_or(false) != disagree(soup.triangles[t], soup.triangles[s as usize]);
                match turned[s as usize] {
                    None => {
                        turned[s as usize] = Some(want);
                        part.push(s);
                    }
                    Some(is) if is != want => {
                        let at_m = soup.points[soup.triangles[t][0] as usize];
                        return Err(FillError::NotOrientable { which, at_m });
                    }
                    Some(_) => {}
                }
            }
        }
        let area = |is: bool| {
            let of = part.iter().filter(|&&t| turned[t as usize] == Some(is));
            of.map(|&t| soup.area(soup.triangles[t as usize])).sum::<f64>()
        };
        let minority = area(true) <= area(false);
        for &t in part.iter().filter(|&&t| turned[t as usize] == Some(minority)) {
            soup.triangles[t as usize].swap(1, 2);
            repairs.turned_triangles += 1;
        }
    }
    Ok(())
}

/// The part of each triangle, joined through edges, numbered in order of first triangle.
pub(super) fn parts(triangles: &[[u32; 3]]) -> Vec<usize> {
    let adjacent = neighbours(triangles);
    let mut part_of = vec![usize::MAX; triangles.len()];
    let mut count = 0;
    for start in 0..triangles.len() {
        if part_of[start] != usize::MAX {
            continue;
        }
        part_of[start] = count;
        let mut stack = vec![start as u32];
        while let Some(t) = stack.pop() {
            for &s in &adjacent[t as usize] {
                if part_of[s as usize] == usize::MAX {
                    part_of[s as usize] = count;
                    stack.push(s);
                }
            }
        }
        count += 1;
    }
    part_of
}

/// Keeps the part with the largest area; the others must be debris.
pub(super) fn keep_largest_part(
    which: &'static str,
    soup: &mut Soup,
    debris: f64,
    repairs: &mut Repairs,
) -> Result<(), FillError> {
    let part_of = parts(&soup.triangles);
    let mut areas = vec![0.0; part_of.iter().max().map_or(0, |last| last + 1)];
    for (&part, &triangle) in part_of.iter().zip(&soup.triangles) {
        areas[part] += soup.area(triangle);
    }
    let whole: f64 = areas.iter().sum();
    let largest = (0..areas.len()).max_by(|&a, &b| areas[a].total_cmp(&areas[b])).unwrap_or(0);
    let others = areas.iter().enumerate().filter(|&(part, &area)| part != largest && area > debris * whole).count();
    if others > 0 {
        return Err(FillError::SeveralParts { which, parts: others + 1 });
    }
    repairs.dropped_parts += areas.len() - 1;
    let mut parts = part_of.iter();
    soup.triangles.retain(|_| parts.next() == Some(&largest));
    soup.compact();
    Ok(())
}

/// Gives every fan of triangles around a point its own copy: no two sheets hang together by a point only.
pub(super) fn split_pinched_vertices(soup: &mut Soup) {
    let mut around: Vec<Vec<u32>> = vec![Vec::new(); soup.points.len()];
    for (t, triangle) in soup.triangles.iter().enumerate() {
        for &v in triangle {
            around[v as usize].push(t as u32);
        }
    }
    for v in 0..around.len() {
        let mut rest = around[v].clone();
        let mut first = true;
        while let Some(seed) = rest.first().copied() {
            let mut fan = vec![seed];
            let mut done = 0;
            while done < fan.len() {
                let t = soup.triangles[fan[done] as usize];
                done += 1;
                let shares_edge = |s: [u32; 3]| s.iter().any(|w| *w as usize != v && t.contains(w));
                for &s in &rest {
                    if !fan.contains(&s) && shares_edge(soup.triangles[s as usize]) {
                        fan.push(s);
                    }
                }
            }
            rest.retain(|t| !fan.contains(t));
            if !first {
                let copy = soup.points.len() as u32;
                soup.points.push(soup.points[v]);
                for &t in &fan {
                    soup.triangles[t as usize].iter_mut().filter(|w| **w as usize == v).for_each(|w| *w = copy);
                }
            }
            first = false;
        }
    }
}

/// Turns the whole surface if its normals point inwards.
pub(super) fn outwards(mesh: TriMesh, mut rim: Vec<u32>) -> (TriMesh, Vec<u32>) {
    let points =
        if rim.is_empty() { &mesh.positions } else { &rim.iter().map(|&v| mesh.positions[v as usize]).collect() };
    let apex = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
    if enclosed_volume(&mesh, &rim, apex) >= 0.0 {
        return (mesh, rim);
    }
    rim.reverse();
    let triangles = mesh.triangles.iter().map(|&[a, b, c]| [a, c, b]).collect();
    (TriMesh::new(mesh.positions, triangles), rim)
}
