//! Triangulates a surface anew with a wanted number of nearly equilateral triangles (after Botsch and Kobbelt 2004:
//! collapse short edges, split long ones, flip to Delaunay, smooth in the tangent plane, project back).
use super::bvh::SurfaceIndex;
use super::repair::CleanSurface;
use super::trimesh::TriMesh;
use glam::DVec3;

/// Laplacian passes before coarsening: voxel staircases and noise must not decide which edges may go.
const PRESMOOTHING: usize = 6;
/// Rounds of equalising edges, and of smoothing after them.
const EQUALISING_ROUNDS: usize = 10;
const FINAL_ROUNDS: usize = 8;
/// Edges outside this range around the mean are collapsed or split in a round.
const EDGE_RANGE: (f64, f64) = (0.65, 1.45);
/// Passes that may go by without progress in the count before giving up.
const PATIENCE: usize = 6;
/// A collapse must not turn a triangle by more than about 78°.
const COLLAPSE_AGREEMENT: f64 = 0.2;
/// Largest part of the edges collapsed in one pass: short ones all over rather than one place emptied.
const COLLAPSED_PER_PASS: f64 = 0.2;

/// A surface to project on: its triangles and its rim.
pub(crate) struct Target {
    pub(crate) surface: SurfaceIndex,
    pub(crate) rim: SurfaceIndex,
}

impl Target {
    pub(crate) fn of(clean: &CleanSurface) -> Self {
        // Segments as triangles with a repeated corner.
        let next = |i: usize| clean.rim[(i + 1) % clean.rim.len()];
        let segments: Vec<[u32; 3]> = (0..clean.rim.len()).map(|i| [clean.rim[i], next(i), next(i)]).collect();
        Self {
            surface: SurfaceIndex::new(&clean.mesh.positions, &clean.mesh.triangles),
            rim: SurfaceIndex::new(&clean.mesh.positions, &segments),
        }
    }

    /// Nearest point of the surface, or of its rim for a vertex on the boundary.
    pub(crate) fn project(&self, p: DVec3, on_rim: bool) -> DVec3 {
        if on_rim { self.rim.nearest(p).point } else { self.surface.nearest(p).point }
    }
}

/// Remeshes to about `wanted` triangles.
pub(crate) fn remesh(clean: &CleanSurface, target: &Target, wanted: usize, mut progress: impl FnMut(f64)) -> TriMesh {
    let mut mesh = clean.mesh.clone();
    let start = mesh.triangles.len() as f64;
    if mesh.triangles.len() > wanted {
        (0..PRESMOOTHING).for_each(|_| smooth_freely(&mut mesh));
        mesh.delaunay(3);
    }
    reach(&mut mesh, target, wanted, |now| {
        progress(0.5 * (start / now).ln().abs() / (start / wanted as f64).ln().abs());
    });
    for round in 0..EQUALISING_ROUNDS {
        progress(0.5 + 0.5 * round as f64 / (EQUALISING_ROUNDS + FINAL_ROUNDS) as f64);
        let mean = mean_edge(&mesh);
        collapse(&mut mesh, target, usize::MAX, EDGE_RANGE.0 * mean);
        split(&mut mesh, target, usize::MAX, EDGE_RANGE.1 * mean);
        reach(&mut mesh, target, wanted, |_| {});
        relax(&mut mesh, Some(target));
        mesh.delaunay(3);
    }
    for round in 0..FINAL_ROUNDS {
        progress(0.5 + 0.5 * (EQUALISING_ROUNDS + round) as f64 / (EQUALISING_ROUNDS + FINAL_ROUNDS) as f64);
        relax(&mut mesh, Some(target));
        mesh.delaunay(3);
    }
    mesh
}

/// Collapses or splits edges until the count is met within two triangles.
fn reach(mesh: &mut TriMesh, target: &Target, wanted: usize, mut progress: impl FnMut(f64)) {
    let mut stalled = 0;
    while stalled < PATIENCE {
        let count = mesh.triangles.len();
        let off = count.abs_diff(wanted);
        if off < 2 {
            break;
        }
        let most = (off / 2).min(1 + (COLLAPSED_PER_PASS * count as f64) as usize);
        let changed =
            if count > wanted { collapse(mesh, target, most, f64::INFINITY) } else { split(mesh, target, most, 0.0) };
        stalled = if changed == 0 { stalled + 1 } else { 0 };
        mesh.delaunay(2);
        // Far from the wanted count the surface need not be met yet; most of the time would go into meeting it.
        let meet = if mesh.triangles.len() > 2 * wanted { None } else { Some(target) };
        relax(mesh, meet);
        progress(mesh.triangles.len() as f64);
    }
}

fn mean_edge(mesh: &TriMesh) -> f64 {
    let edges = mesh.edges();
    edges.iter().map(|&e| length(mesh, e)).sum::<f64>() / edges.len().max(1) as f64
}

fn length(mesh: &TriMesh, [a, b]: [u32; 2]) -> f64 {
    mesh.positions[a as usize].distance(mesh.positions[b as usize])
}

/// Moves every vertex halfway to the mean of its neighbours; the rim stays.
fn smooth_freely(mesh: &mut TriMesh) {
    let fixed = mesh.on_boundary();
    let mut sums = vec![(DVec3::ZERO, 0.0); mesh.positions.len()];
    for [a, b] in mesh.edges() {
        for (to, from) in [(a, b), (b, a)] {
            sums[to as usize].0 += mesh.positions[from as usize];
            sums[to as usize].1 += 1.0;
        }
    }
    for v in 0..sums.len() {
        if !fixed[v] && sums[v].1 > 0.0 {
            mesh.positions[v] = 0.5 * (mesh.positions[v] + sums[v].0 / sums[v].1);
        }
    }
}

/// One step of centroidal smoothing in the tangent plane (along the rim for its vertices), projected on the target if
/// there is one; without, the rim stays.
fn relax(mesh: &mut TriMesh, target: Option<&Target>) {
    let normals = mesh.vertex_normals();
    let mut aims = mesh.centroids();
    for v in 0..aims.len() {
        let step = aims[v] - mesh.positions[v];
        aims[v] = mesh.positions[v] + step.reject_from_normalized(normals[v]);
    }
    let sides = mesh.rim_neighbours();
    for (&v, &[before, after]) in &sides {
        aims[v as usize] = 0.25 * (mesh.positions[before as usize] + mesh.positions[after as usize])
            + 0.5 * mesh.positions[v as usize];
    }
    for v in 0..aims.len() {
        let on_rim = sides.contains_key(&(v as u32));
        match target {
            Some(target) => mesh.positions[v] = target.project(aims[v], on_rim),
            None if on_rim => {}
            None => mesh.positions[v] = aims[v],
        }
    }
}

/// Triangles around every vertex.
fn incidence(mesh: &TriMesh) -> Vec<Vec<u32>> {
    let mut around = vec![Vec::with_capacity(6); mesh.positions.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        for &v in triangle {
            around[v as usize].push(t as u32);
        }
    }
    around
}

fn sorted_edges(mesh: &TriMesh) -> Vec<(f64, [u32; 2])> {
    let mut edges: Vec<(f64, [u32; 2])> = mesh.edges().into_iter().map(|e| (length(mesh, e), e)).collect();
    edges.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    edges
}

/// Collapses up to `most` of the shortest edges below `limit` that do not touch each other; returns how many.
fn collapse(mesh: &mut TriMesh, target: &Target, most: usize, limit: f64) -> usize {
    let boundary = mesh.on_boundary();
    let around = incidence(mesh);
    let mut locked = vec![false; mesh.positions.len()];
    let mut dead = vec![false; mesh.triangles.len()];
    let mut done = 0;
    for (_, [a, b]) in sorted_edges(mesh).into_iter().take_while(|(l, _)| *l < limit) {
        if done >= most {
            break;
        }
        // The vertex on the rim stays; among equals the first.
        let [keep, gone] = if boundary[b as usize] && !boundary[a as usize] { [b, a] } else { [a, b] };
        if locked[a as usize] || locked[b as usize] || !may_collapse(mesh, &boundary, &around, keep, gone) {
            continue;
        }
        let both = boundary[keep as usize] == boundary[gone as usize];
        let position = if both {
            let middle = 0.5 * (mesh.positions[a as usize] + mesh.positions[b as usize]);
            target.project(middle, boundary[keep as usize])
        } else {
            mesh.positions[keep as usize]
        };
        if !keeps_normals(mesh, &around, keep, gone, position) {
            continue;
        }
        for &t in around[keep as usize].iter().chain(&around[gone as usize]) {
            mesh.triangles[t as usize].iter().for_each(|&v| locked[v as usize] = true);
        }
        for &t in &around[gone as usize] {
            let triangle = &mut mesh.triangles[t as usize];
            if triangle.contains(&keep) {
                dead[t as usize] = true;
            } else {
                triangle.iter_mut().filter(|v| **v == gone).for_each(|v| *v = keep);
            }
        }
        mesh.positions[keep as usize] = position;
        done += 1;
    }
    if done > 0 {
        let mut is_dead = dead.iter();
        mesh.triangles.retain(|_| is_dead.next() != Some(&true));
        mesh.compact();
    }
    done
}

/// The link condition (common neighbours are exactly the corners opposite the edge), and the rim stays a simple loop.
fn may_collapse(mesh: &TriMesh, boundary: &[bool], around: &[Vec<u32>], keep: u32, gone: u32) -> bool {
    let at_edge = usize::from(mesh.left_of(keep, gone).is_some()) + usize::from(mesh.left_of(gone, keep).is_some());
    if boundary[keep as usize] && boundary[gone as usize] && at_edge == 2 {
        return false;
    }
    let neighbours = |v: u32| {
        let mut all: Vec<u32> = around[v as usize].iter().flat_map(|&t| mesh.triangles[t as usize]).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    let of_gone = neighbours(gone);
    let common = neighbours(keep).into_iter().filter(|v| *v != keep && *v != gone && of_gone.contains(v));
    common.count() == at_edge && around[keep as usize].len() + around[gone as usize].len() - 2 * at_edge >= 3
}

fn keeps_normals(mesh: &TriMesh, around: &[Vec<u32>], keep: u32, gone: u32, position: DVec3) -> bool {
    let survivors = around[keep as usize].iter().chain(&around[gone as usize]).map(|&t| mesh.triangles[t as usize]);
    survivors.filter(|t| !(t.contains(&keep) && t.contains(&gone))).all(|triangle| {
        let before = mesh.area_vector(triangle);
        let [a, b, c] = triangle.map(|v| if v == keep || v == gone { position } else { mesh.positions[v as usize] });
        let after = (b - a).cross(c - a);
        after.dot(before) > COLLAPSE_AGREEMENT * after.length() * before.length() || before == DVec3::ZERO
    })
}

/// Splits up to `most` of the longest edges above `limit`, each triangle at most once; returns how many.
fn split(mesh: &mut TriMesh, target: &Target, most: usize, limit: f64) -> usize {
    let mut locked = vec![false; mesh.triangles.len()];
    let mut done = 0;
    for (_, [a, b]) in sorted_edges(mesh).into_iter().rev().take_while(|(l, _)| *l > limit) {
        let sides = [mesh.left_of(a, b), mesh.left_of(b, a)];
        if done >= most {
            break;
        }
        if sides.iter().flatten().any(|&t| locked[t as usize]) {
            continue;
        }
        let middle = 0.5 * (mesh.positions[a as usize] + mesh.positions[b as usize]);
        let new = mesh.positions.len() as u32;
        mesh.positions.push(target.project(middle, sides.contains(&None)));
        for t in sides.into_iter().flatten() {
            locked[t as usize] = true;
            let whole = mesh.triangles[t as usize];
            let with = |out: u32| whole.map(|v| if v == out { new } else { v });
            mesh.triangles[t as usize] = with(b);
            mesh.triangles.push(with(a));
        }
        done += 1;
    }
    if done > 0 {
        mesh.index_edges();
    }
    done
}
