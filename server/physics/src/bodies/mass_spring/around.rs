//! Triangles and vertices around given vertices, written into buffers of the loop. The oracle is [`super::Region`].
use super::triangulation::{NONE, Triangulation};

/// Writes the triangles of `rings` rings about the vertices `centres` into `triangles`, ascending, as
/// [`super::Region::rings`] has them, but at most `most` of them. A ring for which there is no room is left out; of the
/// first ring the triangles at as many centres as there is room for are taken. Triangles that would close the region
/// are left out where there is no room. `corners` is a buffer.
///
/// Nothing is allocated where `triangles` has room for `most` triangles and `corners` for three times as many.
pub fn rings_into(
    surface: &Triangulation,
    centres: &[u32],
    rings: u32,
    most: usize,
    triangles: &mut Vec<u32>,
    corners: &mut Vec<u32>,
) {
    triangles.clear();
    corners.clear();
    corners.extend_from_slice(centres);
    for ring in 0..rings {
        let before = triangles.len();
        let mut whole = before;
        let fits = corners.iter().all(|&vertex| {
            let fits = take_at(surface, vertex, before, most, triangles);
            whole = if fits && ring == 0 { triangles.len() } else { whole };
            fits
        });
        if !fits {
            triangles.truncate(whole);
            triangles.sort_unstable();
            break;
        }
        triangles.sort_unstable();
        corners.clear();
        corners.extend(triangles.iter().flat_map(|&t| surface.triangles()[t as usize]));
        corners.sort_unstable();
        corners.dedup();
    }
    close(surface, most, triangles, corners);
}

/// Adds the triangles at a vertex to `triangles`, of which the first `before` are ascending, while there are fewer than
/// `most`. Returns whether all of them had room.
fn take_at(surface: &Triangulation, vertex: u32, before: usize, most: usize, triangles: &mut Vec<u32>) -> bool {
    surface.triangles_at(vertex).iter().all(|&triangle| {
        let found = triangles[..before].binary_search(&triangle).is_ok() || triangles[before..].contains(&triangle);
        if !found && triangles.len() < most {
            triangles.push(triangle);
        }
        found || triangles.last() == Some(&triangle)
    })
}

/// Adds every triangle that has two neighbours in `triangles`, while there are fewer than `most`. `new` is a buffer.
fn close(surface: &Triangulation, most: usize, triangles: &mut Vec<u32>, new: &mut Vec<u32>) {
    new.clear();
    new.extend_from_slice(triangles);
    while let Some(triangle) = new.pop() {
        for edge in surface.edges_of(triangle) {
            let [one, other] = surface.edges()[edge as usize].triangles;
            let across = if one == triangle { other } else { one };
            if across == NONE {
                continue;
            }
            let Err(place) = triangles.binary_search(&across) else { continue };
            let of_neighbour = |edge: &u32| {
                let [one, other] = surface.edges()[*edge as usize].triangles;
                let beyond = if one == across { other } else { one };
                beyond != NONE && triangles.binary_search(&beyond).is_ok()
            };
            let refined = surface.edges_of(across).iter().filter(|edge| of_neighbour(edge)).count();
            if refined > 1 && triangles.len() < most {
                triangles.insert(place, across);
                new.push(across);
            }
        }
    }
}

/// Writes the `most` vertices that are the fewest edges away from `centres` into `vertices`, ascending. `seen` is false
/// for every vertex, before and after. Nothing is allocated where `vertices` has room.
pub fn nearest_into(
    surface: &Triangulation,
    centres: impl Iterator<Item = u32>,
    most: usize,
    vertices: &mut Vec<u32>,
    seen: &mut [bool],
) {
    vertices.clear();
    let mut take = |vertex: u32, vertices: &mut Vec<u32>| {
        if vertices.len() < most && !std::mem::replace(&mut seen[vertex as usize], true) {
            vertices.push(vertex);
        }
    };
    centres.for_each(|vertex| take(vertex, vertices));
    let mut next = 0;
    while next < vertices.len() && vertices.len() < most {
        surface.neighbours(vertices[next]).for_each(|vertex| take(vertex, vertices));
        next += 1;
    }
    for &vertex in vertices.iter() {
        seen[vertex as usize] = false;
    }
    vertices.sort_unstable();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::mass_spring::{
        Region,
        testing::{hexagon, sphere},
    };

    #[test]
    fn rings_are_those_of_the_region() {
        let (patch, ball) = (hexagon(6, 0.03), sphere(3, 0.05));
        let (mut triangles, mut corners) = (Vec::new(), Vec::new());
        for surface in [&patch, &ball] {
            for other in 0..surface.positions_m().len() as u32 {
                for (centres, rings) in [(vec![other], 3), (vec![0, other], 1), (vec![5, other], 2)] {
                    let region = Region::rings(surface, &centres, rings);
                    rings_into(surface, &centres, rings, 1000, &mut triangles, &mut corners);
                    assert!(triangles.iter().eq(region.triangles()), "{centres:?} {rings}");
                }
            }
        }
    }

    #[test]
    fn no_more_triangles_than_allowed() {
        let patch = hexagon(6, 0.03);
        let (mut triangles, mut corners) = (Vec::new(), Vec::new());
        for (most, expected) in [(5, 0), (6, 6), (23, 6), (24, 24), (53, 24), (54, 54)] {
            rings_into(&patch, &[0], 3, most, &mut triangles, &mut corners);
            assert_eq!(triangles.len(), expected, "{most}");
        }
        let [middle, far] = [0, patch.positions_m().len() as u32 - 1];
        let about = |vertex: u32| patch.triangles_at(vertex).to_vec();
        for (most, expected) in [(5, Vec::new()), (7, about(middle)), (8, [about(middle), about(far)].concat())] {
            rings_into(&patch, &[middle, far], 1, most, &mut triangles, &mut corners);
            assert_eq!(triangles, expected, "{most}");
        }
    }

    #[test]
    fn the_nearest_vertices_come_first() {
        let patch = hexagon(6, 0.03);
        let (mut vertices, mut seen) = (Vec::new(), vec![false; patch.positions_m().len()]);
        for (most, expected) in [(1, 1), (7, 7), (19, 19), (37, 37), (1000, patch.positions_m().len())] {
            nearest_into(&patch, [0].into_iter(), most, &mut vertices, &mut seen);
            let rings = Region::rings(&patch, &[0], [1, 7, 19, 37].iter().filter(|n| **n < most).count() as u32);
            let corners = rings.triangles().iter().flat_map(|&t| patch.triangles()[t as usize]);
            let mut within: Vec<u32> = corners.chain([0]).collect();
            within.sort_unstable();
            within.dedup();
            assert_eq!(vertices.len(), expected);
            assert!(most > 1 && most < 1000 && within == vertices || vertices.len() == expected);
            assert!(vertices.is_sorted() && seen.iter().all(|seen| !seen));
        }
        nearest_into(&patch, [0, 60, 0].into_iter(), 9, &mut vertices, &mut seen);
        assert!(vertices.len() == 9 && vertices.contains(&60) && seen.iter().all(|seen| !seen));
        nearest_into(&patch, std::iter::empty(), 9, &mut vertices, &mut seen);
        assert!(vertices.is_empty());
    }
}
