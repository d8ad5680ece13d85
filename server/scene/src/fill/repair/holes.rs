//! Open edges: the base rim stays, everything else is a hole and is closed.
use super::Repairs;
use crate::fill::error::FillError;
use crate::fill::trimesh::TriMesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// Loops of open edges, in the direction of the triangles' edges, each from its smallest vertex.
fn loops(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut next: BTreeMap<u32, u32> = BTreeMap::new();
    for &[a, b, c] in &mesh.triangles {
        for [i, j] in [[a, b], [b, c], [c, a]] {
            if mesh.left_of(j, i).is_none() {
                next.insert(i, j);
            }
        }
    }
    let mut loops = Vec::new();
    while let Some((start, mut at)) = next.pop_first() {
        let mut one = vec![start];
        while at != start {
            one.push(at);
            match next.remove(&at) {
                Some(following) => at = following,
                None => break,
            }
        }
        loops.push(one);
    }
    loops
}

/// Size of the area vector of a loop: ½|Σ pᵢ × pᵢ₊₁|. A slit has none, however long it is.
fn spanned_area(mesh: &TriMesh, rim: &[u32]) -> f64 {
    let p = |i: usize| mesh.positions[rim[i % rim.len()] as usize] - mesh.positions[rim[0] as usize];
    0.5 * (0..rim.len()).map(|i| p(i).cross(p(i + 1))).sum::<DVec3>().length()
}

/// Closes every hole but the base rim, which is returned (empty for a closed surface).
pub(super) fn close_all_but_rim(
    which: &'static str,
    mesh: &mut TriMesh,
    largest_hole: f64,
    repairs: &mut Repairs,
) -> Result<Vec<u32>, FillError> {
    let surface: f64 = mesh.triangles.iter().map(|&t| 0.5 * mesh.area_vector(t).length()).sum();
    let mut rims: Vec<(f64, Vec<u32>)> = Vec::new();
    let mut triangles = mesh.triangles.clone();
    let mut positions = mesh.positions.clone();
    for open in loops(mesh) {
        let area = spanned_area(mesh, &open);
        if area > largest_hole * surface {
            rims.push((area, open));
        } else {
            fill(&mut positions, &mut triangles, mesh, open);
            repairs.filled_holes += 1;
        }
    }
    if rims.len() > 1 {
        let at_m: Vec<DVec3> = rims
            .iter()
            .map(|(_, rim)| rim.iter().map(|&v| positions[v as usize]).sum::<DVec3>() / rim.len() as f64)
            .collect();
        return Err(FillError::SeveralOpenings { which, openings: rims.len(), first_m: at_m[0], second_m: at_m[1] });
    }
    if repairs.filled_holes > 0 {
        *mesh = TriMesh::new(positions, triangles);
    }
    Ok(rims.pop().map(|(_, rim)| rim).unwrap_or_default())
}

/// Cuts ears off the loop, the one with the shortest closing edge first: slits zip up, small holes become flat. Where
/// no ear is left that is not already an edge, a new point in the middle closes the rest.
fn fill(positions: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>, mesh: &TriMesh, mut open: Vec<u32>) {
    let mut made: Vec<[u32; 2]> = Vec::new();
    while open.len() > 3 {
        let n = open.len();
        let is_edge = |made: &[[u32; 2]], a: u32, b: u32| {
            mesh.left_of(a, b).is_some() || mesh.left_of(b, a).is_some() || made.contains(&[a.min(b), a.max(b)])
        };
        let ear = (0..n)
            .map(|i| (i, open[(i + n - 1) % n], open[(i + 1) % n]))
            .filter(|&(_, a, b)| !is_edge(&made, a, b))
            .min_by(|x, y| {
                let length = |&(_, a, b): &(usize, u32, u32)| positions[a as usize].distance(positions[b as usize]);
                length(x).total_cmp(&length(y)).then(x.0.cmp(&y.0))
            });
        let Some((i, a, b)) = ear else { break };
        // Against the direction of the open edges.
        triangles.push([a, b, open[i]]);
        made.push([a.min(b), a.max(b)]);
        open.remove(i);
    }
    if let [a, b, c] = open[..] {
        triangles.push([a, c, b]);
        return;
    }
    let centre = open.iter().map(|&v| positions[v as usize]).sum::<DVec3>() / open.len().max(1) as f64;
    let new = positions.len() as u32;
    positions.push(centre);
    for i in 0..open.len() {
        triangles.push([open[(i + 1) % open.len()], open[i], new]);
    }
}
