//! Particles that are held themselves, where a held face of the coarse tets lies across the lattice.
//!
//! What follows held coarse nodes alone is held; so are the particles in a lattice plane that a held face lies in. Beside any other held
//! face particles follow free nodes, too, in part and beyond the face against them, and where all else is awake nothing holds these nodes: the
//! body then gives way as if it were held deeper down, a heart with a base that is bent by 2 mm by a quarter. So particles beyond a held
//! face, or less than `t` spacings before it, each get a coarse node of their own, which is held with the face. Those of another part of the body, across
//! a gap, follow none of the face's nodes, and are not beside it.
//!
//! A cell that a held face cuts holds too little: with a particle `δ` before the face and one that is held beyond it, `h` from the first, its strain is
//! `u/h` in a volume of `A δ`, where it should be `u/δ`. It gives way by `h²/δ` in place of `δ`; a particle that is held before the face makes the
//! body too short by `δ`. Over all places of the face both are alike where
//! ```text
//! ∫_t^1 (1/s − s) ds = ∫_0^t s ds,   −ln t − (1 − t²)/2 = t²/2,   t = e^{−1/2}
//! ```
use super::{
    composite::{Anchor, Composite, NO_WEIGHT},
    sites::Sites,
};
use crate::{
    contact::closest_weights,
    mesh::{Surface, TetMesh},
    settings::PrescribedSpec,
};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// `t`, in spacings.
const BEFORE: f64 = 0.606_530_659_712_633_4;
/// How far, in spacings, a particle may be beyond a held face, or beside it: no farther than a cell reaches that holds some of the body there.
const BEYOND: f64 = 2.0;

/// The coarse nodes of held particles.
#[derive(Debug, Clone, Default)]
pub(super) struct HeldParticles {
    /// The node of each site that is held.
    pub(super) node_at: BTreeMap<usize, u32>,
    /// Each of these nodes with a corner of its held face.
    corner_of: BTreeMap<u32, u32>,
}

impl HeldParticles {
    /// Moves the reactions (N) at particles' own nodes to corners of their held faces: who asks for the reaction of a held region knows these.
    pub(super) fn move_to_faces(&self, reactions_n: &mut [DVec3]) {
        for (&node, &corner) in &self.corner_of {
            let reaction_n = std::mem::take(&mut reactions_n[node as usize]);
            reactions_n[corner as usize] += reaction_n;
        }
    }
}

/// Gives particles beside held faces, of the sites told, nodes of their own, which go into the prescribed sets of these faces.
pub(super) fn hold(
    mesh: &TetMesh,
    surface: &Surface,
    sites: &Sites,
    particles: impl Iterator<Item = usize>,
    composite: &mut Composite,
    prescribed: &mut [PrescribedSpec],
) -> HeldParticles {
    let mut held = HeldParticles::default();
    let spacing_m = sites.spacing_m();
    let nodes_of: Vec<BTreeSet<u32>> = prescribed.iter().map(|set| set.nodes.iter().copied().collect()).collect();
    let faces_of = prescribed.iter().zip(&nodes_of).map(|(set, nodes)| {
        if set.axes == [true; 3] { faces(mesh, surface, nodes, BEYOND * spacing_m) } else { Vec::new() }
    });
    let faces_of: Vec<Vec<Face>> = faces_of.collect();
    for site in particles {
        let at_m = sites.site_m(site);
        for ((set, nodes), faces) in prescribed.iter_mut().zip(&nodes_of).zip(&faces_of) {
            let Some((face, near)) = nearest(faces, at_m) else { continue };
            let is_beside = near.above_m > -BEFORE * spacing_m
                && near.above_m < BEYOND * spacing_m
                && near.aside_m < BEYOND * spacing_m;
            if is_beside && follows_in_part(&composite.anchor(at_m), nodes) {
                let node = composite.add_node(at_m);
                set.nodes.push(node);
                held.node_at.insert(site, node);
                held.corner_of.insert(node, face.nodes[near.corner]);
                break;
            }
        }
    }
    held
}

/// Whether something that is anchored there follows some of these nodes, and others.
fn follows_in_part(anchor: &Anchor, nodes: &BTreeSet<u32>) -> bool {
    let follows = anchor.nodes.iter().zip(anchor.weights).filter(|(_, weight)| weight.abs() >= NO_WEIGHT);
    let (own, others): (Vec<_>, Vec<_>) = follows.partition(|(node, _)| nodes.contains(node));
    !own.is_empty() && !others.is_empty()
}

/// A held face.
struct Face {
    nodes: [u32; 3],
    corners_m: [DVec3; 3],
    outwards: DVec3,
    /// The corners (m) of a box that holds all that may be beside the face.
    reach_m: [DVec3; 2],
}

/// Where a point is beside a face.
#[derive(Clone, Copy)]
struct Beside {
    /// Height (m) above the face, and distance (m) aside of it.
    above_m: f64,
    aside_m: f64,
    /// The nearest corner.
    corner: usize,
}

/// Faces all of whose corners are held; what is beside one is no farther above it, and no farther aside of it, than `beyond_m`.
fn faces(mesh: &TetMesh, surface: &Surface, held: &BTreeSet<u32>, beyond_m: f64) -> Vec<Face> {
    let reach = DVec3::splat(beyond_m * std::f64::consts::SQRT_2);
    let face = |nodes: [u32; 3]| {
        let corners_m @ [a, b, c] = nodes.map(|node| mesh.positions_m()[node as usize]);
        let reach_m = [a.min(b).min(c) - reach, a.max(b).max(c) + reach];
        Face { nodes, corners_m, outwards: (b - a).cross(c - a).normalize_or_zero(), reach_m }
    };
    let all = (0..surface.triangles.len()).map(|triangle| surface.triangle_nodes(triangle));
    all.filter(|nodes| nodes.iter().all(|node| held.contains(node))).map(face).collect()
}

/// The face nearest to a point, of those that it may be beside.
fn nearest(faces: &[Face], at_m: DVec3) -> Option<(&Face, Beside)> {
    let beside = |face: &Face| {
        let weights = closest_weights(at_m, face.corners_m);
        let nearest_m: DVec3 = face.corners_m.iter().zip(weights).map(|(corner_m, weight)| *corner_m * weight).sum();
        let away_m = at_m - nearest_m;
        let above_m = away_m.dot(face.outwards);
        let corner = (0..3).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or_default();
        (away_m.length_squared(), Beside { above_m, aside_m: (away_m - face.outwards * above_m).length(), corner })
    };
    let in_reach = |face: &&Face| at_m.cmpge(face.reach_m[0]).all() && at_m.cmple(face.reach_m[1]).all();
    let each = faces.iter().filter(in_reach).map(|face| (face, beside(face)));
    each.min_by(|a, b| a.1.0.total_cmp(&b.1.0)).map(|(face, (_, beside))| (face, beside))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::tet_box;

    /// Of two slabs with a gap of 5 mm the lower one is held above, 2 mm over a plane of a lattice of 4 mm: particles of that plane and of the next one,
    /// in the gap, are held, and none in the upper slab, which is less than two spacings from the face.
    #[test]
    fn what_is_across_a_gap_is_not_held() {
        let size = DVec3::new(0.04, 0.04, 0.02);
        let [lower, upper] = [-0.02, 0.005].map(|z| tet_box(DVec3::Z * z, size, [2, 2, 1]));
        let of_lower = lower.positions_m().len() as u32;
        let positions = [lower.positions_m(), upper.positions_m()].concat();
        let shifted = upper.tets().iter().map(|tet| tet.map(|node| node + of_lower));
        let mesh = TetMesh::new(positions, lower.tets().iter().copied().chain(shifted).collect()).unwrap();
        let mut composite = Composite::new(&mesh);
        let nodes = composite.positions_m().iter().enumerate().filter(|(_, p)| p.z == 0.0).map(|(node, _)| node as u32);
        let mut prescribed =
            [PrescribedSpec { name: "top".into(), nodes: nodes.collect(), axes: [true; 3], is_fixed: false }];
        let sites = Sites::covering((DVec3::Z * -0.02, DVec3::new(0.04, 0.04, 0.025)), 4e-3, DVec3::Z * -2e-3);
        let surface = Surface::of(&mesh).unwrap();
        let held = hold(&mesh, &surface, &sites, 0..sites.site_count(), &mut composite, &mut prescribed);
        let heights_mm: BTreeSet<i64> =
            held.node_at.keys().map(|&site| (1e3 * sites.site_m(site).z).round() as i64).collect();
        assert_eq!(heights_mm, BTreeSet::from([-2, 2]));
        // Eleven sites to a side, in either plane, and as many nodes; their reactions go to the face.
        assert!(held.node_at.len() >= 2 * 11 * 11, "{}", held.node_at.len());
        let mut reactions_n = vec![DVec3::X; composite.positions_m().len()];
        held.move_to_faces(&mut reactions_n);
        let of_face: DVec3 = prescribed[0].nodes.iter().map(|&node| reactions_n[node as usize]).sum();
        assert!((of_face.x - prescribed[0].nodes.len() as f64).abs() < 1e-9);
        assert!(held.node_at.values().all(|&node| reactions_n[node as usize] == DVec3::ZERO));
    }
}
