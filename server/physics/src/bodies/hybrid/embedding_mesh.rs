//! Coarse tets that hold every particle: their boundary is moved outwards until they do.
//!
//! Coarse tets cut the corners of a curved body, and the lattice reaches past its surface by up to a cell. A particle
//! outside all tets would have a negative weight: it would still follow affine motion, but may not be woken
//! ([`super::HybridBody::may_wake`]). The tets carry no geometry (`partition`), so nothing is lost by making them larger.
//! Nodes that are held stay where they are.
use super::locate::Locator;
use crate::{
    contact::closest_weights,
    mesh::{Surface, TetMesh},
};
use glam::DVec3;
use std::collections::BTreeSet;

/// Most rounds of moving nodes.
const ROUNDS: usize = 12;
/// A point that lies outside by less than this fraction of an edge counts as inside.
const ROUNDING: f64 = 1e-9;
/// A node moves along its normal by what its faces need, divided by the cosine between their normals and its own, which
/// counts as this at least.
const LEAST_COSINE: f64 = 0.3;
/// A face is moved for a point only where the weights of its free nodes sum to more than this at the point.
const LEAST_FREE_PART: f64 = 0.3;
/// Nodes are moved by this times what is needed, so that the rounds end.
const SURPLUS: f64 = 1.05;
/// No tet may lose more than this fraction of its volume in a round.
const MOST_LOST: f64 = 0.5;

/// A mesh that holds the particles.
#[derive(Debug, Clone, PartialEq)]
pub struct EmbeddingMesh {
    /// The mesh, with the same tets.
    pub mesh: TetMesh,
    /// Largest displacement (m) of a node of its boundary.
    pub moved_m: f64,
    /// Points that are still outside (m).
    pub outside_m: Vec<DVec3>,
}

/// Moves the boundary outwards, but for `held` nodes, until the tets hold the points or no node can be moved further.
pub fn cover(mesh: &TetMesh, surface: &Surface, held: &BTreeSet<u32>, points_m: &[DVec3]) -> EmbeddingMesh {
    let mut covering = mesh.clone();
    let mut waiting: Vec<DVec3> = points_m.to_vec();
    for _ in 0..ROUNDS {
        let needs = needs(&covering, surface, held, &mut waiting);
        if waiting.is_empty() {
            break;
        }
        let moves = moves(&covering, surface, held, &needs);
        let Some(next) = moved(&covering, &moves) else { break };
        if next == covering {
            break;
        }
        covering = next;
    }
    let moved_m =
        covering.positions_m().iter().zip(mesh.positions_m()).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    needs(&covering, surface, held, &mut waiting);
    EmbeddingMesh { mesh: covering, moved_m, outside_m: waiting }
}

/// Returns how far (m) each node's faces would have to move to hold the points outside, and takes the points inside off
/// the list.
fn needs(mesh: &TetMesh, surface: &Surface, held: &BTreeSet<u32>, waiting: &mut Vec<DVec3>) -> Vec<f64> {
    let locator = Locator::new(mesh);
    let mut needs = vec![0.0_f64; mesh.positions_m().len()];
    waiting.retain(|&point| {
        let (tet, barycentric) = locator.nearest(point);
        if locator.inside_m(tet, &barycentric) > -ROUNDING * mesh.longest_edge_m(tet) {
            return false;
        }
        let near = nearest_face(mesh, surface, point);
        let nodes = surface.triangle_nodes(near.triangle);
        // Beside held nodes the face hardly moves with its free ones: such a point stays outside.
        let moves = |(node, weight): (&u32, f64)| if held.contains(node) { 0.0 } else { weight };
        let free_part: f64 = nodes.iter().zip(near.weights).map(moves).sum();
        if free_part > LEAST_FREE_PART {
            for node in nodes {
                needs[node as usize] = needs[node as usize].max(near.above_m / free_part);
            }
        }
        true
    });
    needs
}

/// A boundary triangle near a point outside.
struct NearFace {
    triangle: usize,
    /// Weights of its corners at its point that is nearest to the point outside.
    weights: [f64; 3],
    /// Height (m) of the point outside above the triangle's plane.
    above_m: f64,
}

/// Returns the boundary triangle nearest to a point; of several that are as near, the one that the point is highest
/// above.
fn nearest_face(mesh: &TetMesh, surface: &Surface, point_m: DVec3) -> NearFace {
    let (mut best, mut nearest_m) = (NearFace { triangle: 0, weights: [0.0; 3], above_m: 0.0 }, f64::INFINITY);
    for triangle in 0..surface.triangles.len() {
        let corners = surface.triangle_nodes(triangle).map(|n| mesh.positions_m()[n as usize]);
        let weights = closest_weights(point_m, corners);
        let closest: DVec3 = corners.iter().zip(weights).map(|(c, w)| *c * w).sum();
        let distance_m = closest.distance(point_m);
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
        let above_m = (point_m - corners[0]).dot(normal);
        let tie = (distance_m - nearest_m).abs() <= ROUNDING * nearest_m;
        if if tie { above_m > best.above_m } else { distance_m < nearest_m } {
            (best, nearest_m) = (NearFace { triangle, weights, above_m }, distance_m);
        }
    }
    best
}

/// Returns displacements (m) of the nodes that meet the needs.
fn moves(mesh: &TetMesh, surface: &Surface, held: &BTreeSet<u32>, needs: &[f64]) -> Vec<DVec3> {
    let normal_of = |triangle: usize| {
        let [a, b, c] = surface.triangle_nodes(triangle).map(|n| mesh.positions_m()[n as usize]);
        (b - a).cross(c - a)
    };
    let mut normals = vec![DVec3::ZERO; needs.len()];
    for triangle in 0..surface.triangles.len() {
        surface.triangle_nodes(triangle).iter().for_each(|&n| normals[n as usize] += normal_of(triangle));
    }
    let mut cosines = vec![1.0_f64; needs.len()];
    for triangle in 0..surface.triangles.len() {
        let normal = normal_of(triangle).normalize_or_zero();
        for &node in &surface.triangle_nodes(triangle) {
            let cosine = normals[node as usize].normalize_or_zero().dot(normal);
            cosines[node as usize] = cosines[node as usize].min(cosine);
        }
    }
    let displacement = |node: usize| {
        let free = needs[node] > 0.0 && !held.contains(&(node as u32));
        let distance_m = SURPLUS * needs[node] / cosines[node].max(LEAST_COSINE);
        if free { normals[node].normalize_or_zero() * distance_m } else { DVec3::ZERO }
    };
    (0..needs.len()).map(displacement).collect()
}

/// Returns the mesh with its nodes moved, all by less where a tet would lose too much volume; `None` when they cannot
/// be moved.
fn moved(mesh: &TetMesh, moves: &[DVec3]) -> Option<TetMesh> {
    let mut scale = 1.0;
    for _ in 0..6 {
        let positions: Vec<DVec3> = mesh.positions_m().iter().zip(moves).map(|(p, m)| *p + *m * scale).collect();
        if let Ok(next) = TetMesh::new(positions, mesh.tets().to_vec()) {
            let kept = |tet: usize| next.volume_m3(tet) > MOST_LOST * mesh.volume_m3(tet);
            if (0..mesh.tets().len()).all(kept) {
                return Some(next);
            }
        }
        scale *= 0.5;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::hybrid::{
        composite::Composite,
        mass_matrix::MassMatrix,
        masses::Masses,
        moments::integrate,
        partition::Partition,
        sites::Sites,
        testing::{ball, tet_box},
    };
    use glam::BVec3;

    /// Twenty tets inside a ball hold three fifths of it at first.
    #[test]
    fn tets_inside_a_ball_are_made_to_hold_its_particles() {
        let skin = ball(0.01, DVec3::ZERO, 3);
        let inner = ball(0.01, DVec3::ZERO, 0);
        let mut positions = inner.positions_m().to_vec();
        positions.push(DVec3::ZERO);
        let tets = inner.triangles().iter().map(|&[a, b, c]| [12, a, b, c]).collect();
        let mesh = TetMesh::new(positions, tets).unwrap();
        assert!(mesh.total_volume_m3() < 0.65 * skin.volume_m3());
        let sites = Sites::covering(skin.bounds_m(), 1.1e-3, DVec3::splat(0.4e-3));
        let moments = integrate(&skin, &sites, &mut |_| {});
        let points: Vec<DVec3> =
            moments.iter().flat_map(|m| sites.corners(m.cell)).map(|site| sites.site_m(site)).collect();
        let embedding = cover(&mesh, &Surface::of(&mesh).unwrap(), &BTreeSet::new(), &points);
        assert_eq!(embedding.outside_m, []);
        assert!(embedding.moved_m < 8e-3, "{}", embedding.moved_m);
        let partition = Partition::new(sites, Composite::new(&embedding.mesh), &moments);
        let all: BTreeSet<u32> = (0..partition.particle_count() as u32).collect();
        assert!(all.iter().all(|&p| partition.anchor(p).weights.iter().all(|&w| w > -1e-8)));
        let masses = Masses::new(&partition, |_| 1000.0);
        let free = vec![BVec3::TRUE; masses.node_kg.len()];
        assert!(MassMatrix::new(&partition, &masses, &all).factorise(&free).is_ok());
    }

    #[test]
    fn held_nodes_stay() {
        let mesh = tet_box(DVec3::ZERO, DVec3::splat(0.02), [2, 2, 2]);
        let floor = (0..27).filter(|&n| mesh.positions_m()[n as usize].z < 1e-9).collect();
        let points = [DVec3::new(0.01, 0.01, 0.021), DVec3::new(0.021, 0.01, 0.01), DVec3::new(0.01, 0.01, -0.001)];
        let embedding = cover(&mesh, &Surface::of(&mesh).unwrap(), &floor, &points);
        assert_eq!(embedding.outside_m, [points[2]]);
        for (node, (now, before)) in embedding.mesh.positions_m().iter().zip(mesh.positions_m()).enumerate() {
            assert!(!floor.contains(&(node as u32)) || now == before);
        }
    }
}
