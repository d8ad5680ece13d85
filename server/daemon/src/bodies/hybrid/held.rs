//! Whether what is held lies in planes of the lattice. Particles in such a plane are held by the coarse nodes in it; beside what lies across
//! the lattice none is, and what is awake hangs on coarse nodes that give way (`docs/measurements/heart.md`).
use glam::DVec3;
use palpate_physics::{Model, PrescribedSpec, bodies::hybrid::HybridBody};

/// Distance from a plane, over the spacing, that is none.
const NONE: f64 = 1e-3;

/// Says so of every held region that lies in no plane.
pub(super) fn warnings(model: &Model, body: &HybridBody) -> Vec<String> {
    let sites = body.partition().sites();
    let in_spacings = |node: &u32| (model.rest_positions_m()[*node as usize] - sites.site_m(0)) / sites.spacing_m();
    let told = |set: &&PrescribedSpec| {
        let nodes: Vec<DVec3> = set.nodes.iter().map(in_spacings).collect();
        !lies_in_a_plane(&nodes)
    };
    let words = |set: &PrescribedSpec| {
        format!(
            "what is held as \"{}\" lies in no plane of the particles' lattice: near it the body gives way too easily, a heart with a base that \
             is bent by 2 mm by a quarter in all; make it flat across x, y or z, and two of them a whole number of spacings apart",
            set.name
        )
    };
    model.prescribed().iter().filter(told).map(words).collect()
}

/// Whether points (in spacings) lie in one plane of the lattice.
fn lies_in_a_plane(points: &[DVec3]) -> bool {
    let Some(first) = points.first() else { return true };
    (0..3).any(|axis| {
        let plane = first[axis].round();
        points.iter().all(|point| (point[axis] - plane).abs() < NONE)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_bent_or_between_planes_lies_in_none() {
        let square = |z: [f64; 4]| [[0.3, 0.1], [2.6, 0.0], [2.4, 3.3], [0.0, 3.1]].map(|[x, y]| DVec3::new(x, y, 0.0)).into_iter().zip(z);
        let in_plane = |z| lies_in_a_plane(&square(z).map(|(p, z)| p + DVec3::Z * z).collect::<Vec<_>>());
        assert!(in_plane([2.0; 4]) && in_plane([2.0, 2.0001, 2.0, 2.0]));
        assert!(!in_plane([2.5; 4]) && !in_plane([2.0, 2.4, 2.0, 2.4]) && !in_plane([2.0, 2.0, 3.0, 3.0]));
        assert!(lies_in_a_plane(&[]));
    }
}
