//! Flat regions that are held between planes of the lattice. Particles beside them are held in their place (`held_particles` in the physics crate), which
//! lengthens or shortens the body by up to a spacing; over a region that is bent the errors are alike on both sides.
use glam::DVec3;
use palpate_physics::{Model, PrescribedSpec, bodies::hybrid::HybridBody};
use palpate_scene::wording::short;

/// Distance from a plane, over the spacing, that is none.
const NONE: f64 = 1e-3;

/// Says so of every such region.
pub(super) fn warnings(model: &Model, body: &HybridBody) -> Vec<String> {
    let sites = body.partition().sites();
    let in_spacings = |node: &u32| (model.rest_positions_m()[*node as usize] - sites.site_m(0)) / sites.spacing_m();
    // Held particles have nodes of their own, which lie before and beyond the region.
    let of_mesh = body.coarse().positions_m().len() as u32;
    let words = |set: &PrescribedSpec| {
        let off = off_planes(set.nodes.iter().filter(|node| **node < of_mesh).map(in_spacings))?;
        Some(format!(
            "what is held as \"{}\" is flat and lies {} mm off the planes of the particles' lattice: the body is up to a spacing ({} mm) too long or too \
             short there; choose a spacing that divides its distance from the other held region",
            set.name,
            short(1e3 * off * sites.spacing_m()),
            short(1e3 * sites.spacing_m())
        ))
    };
    model.prescribed().iter().filter_map(words).collect()
}

/// How far points (in spacings) that lie in a plane across one axis, and in no line, are from the nearest plane of the lattice; `None` of others, and where
/// they lie in one.
fn off_planes(mut points: impl Iterator<Item = DVec3>) -> Option<f64> {
    let first = points.next()?;
    let (low, high) = points.fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
    let mut across = (0..3).filter(|&axis| high[axis] - low[axis] < NONE);
    let (axis, None) = (across.next()?, across.next()) else { return None };
    let off = (first[axis] - first[axis].round()).abs();
    (off > NONE).then_some(off)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_flat_and_between_planes_is_told() {
        let square = |z: [f64; 4]| {
            let corners = [[0.3, 0.1], [2.6, 0.0], [2.4, 3.3], [0.0, 3.1]];
            off_planes(corners.into_iter().zip(z).map(|([x, y], z)| DVec3::new(x, y, z)))
        };
        assert!((square([2.3; 4]).unwrap() - 0.3).abs() < 1e-12 && (square([2.9; 4]).unwrap() - 0.1).abs() < 1e-12);
        assert!(square([2.0; 4]).is_none() && square([2.0, 2.4, 2.0, 2.4]).is_none());
        // A pinned node, and an edge.
        let line = |far: f64| off_planes([0.0, far].map(|y| DVec3::new(0.3, y, 0.4)).into_iter());
        assert!(line(0.0).is_none() && line(2.5).is_none() && off_planes(std::iter::empty()).is_none());
    }
}
