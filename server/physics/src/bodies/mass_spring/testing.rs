//! Surfaces and specifications for tests.
#![allow(clippy::unwrap_used)]
use super::{anchor::AnchorLaw, model::SpringSpec, region::Constants, triangulation::Triangulation};
use glam::DVec3;

/// Returns a flat patch of equilateral triangles of edge `edge_m` (m) in the plane z = 0: all vertices within `rings`
/// rings about vertex 0.
pub(crate) fn hexagon(rings: i32, edge_m: f64) -> Triangulation {
    super::net::hexagonal_patch(rings, edge_m).unwrap()
}

/// Returns an octahedron about the origin with corners at this radius (m), whose triangles are split in four `levels`
/// times, with all vertices pushed out to the sphere.
pub(crate) fn sphere(levels: u32, radius_m: f64) -> Triangulation {
    let mut p = vec![DVec3::X, DVec3::Y, DVec3::Z, -DVec3::X, -DVec3::Y, -DVec3::Z];
    let mut t = vec![[0, 1, 2], [1, 3, 2], [3, 4, 2], [4, 0, 2], [1, 0, 5], [3, 1, 5], [4, 3, 5], [0, 4, 5]];
    for _ in 0..levels {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32, p: &mut Vec<DVec3>| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                p.push((p[a as usize] + p[b as usize]).normalize());
                p.len() as u32 - 1
            })
        };
        let mut finer = Vec::new();
        for [a, b, c] in t {
            let [ab, bc, ca] = [middle(a, b, &mut p), middle(b, c, &mut p), middle(c, a, &mut p)];
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        t = finer;
    }
    Triangulation::new(p.into_iter().map(|p| p * radius_m).collect(), t).unwrap()
}

/// Returns a specification of springs on a surface, with constants that differ where it is refined.
pub(crate) fn spring_spec(surface: Triangulation) -> SpringSpec {
    let mass_kg: Vec<f64> = surface.vertex_areas_m2().iter().map(|area_m2| area_m2 * 2.0).collect();
    SpringSpec {
        coarse: Constants { mesh_n_per_m: 60.0, anchor_n_per_m: 40.0 },
        fine: Constants { mesh_n_per_m: 50.0, anchor_n_per_m: 12.0 },
        anchor_law: AnchorLaw::Linear,
        most_awake: surface.positions_m().len() + surface.edges().len(),
        most_refined: surface.triangles().len(),
        mass_kg,
        held: vec![],
        surface,
    }
}
