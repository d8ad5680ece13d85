//! Whether a point is inside a deformed hybrid body.
//!
//! Its many-vertexed skin is not looked at: the coarse tets, linear between their corners, take the point back to rest, where it is inside
//! when a cell of the body holds it. That is right to within about a spacing, beyond which a tool touches.
use glam::{DMat3, DVec3};
use palpate_physics::{
    TetMesh,
    bodies::hybrid::{HybridBody, partition::NONE},
};

/// A point between two tets or cells is in one of them, whatever rounding says.
const ROUNDING: f64 = 1e-9;

/// Whether a point (m) is inside the body whose coarse nodes are at `x` (m). Does not allocate.
pub(super) fn holds(hybrid: &HybridBody, x: &[DVec3], point_m: DVec3) -> bool {
    at_rest(hybrid.coarse(), x, point_m).any(|rest_m| is_in_a_cell(hybrid, rest_m))
}

/// Where a point may be at rest (m): once for every coarse tet that holds it.
fn at_rest<'a>(coarse: &'a TetMesh, x: &'a [DVec3], point_m: DVec3) -> impl Iterator<Item = DVec3> + 'a {
    let rest = coarse.positions_m();
    coarse.tets().iter().filter_map(move |tet| {
        let [a, b, c, d] = tet.map(|node| x[node as usize]);
        let local = DMat3::from_cols(b - a, c - a, d - a).inverse() * (point_m - a);
        let weights = [1.0 - local.element_sum(), local.x, local.y, local.z];
        let held = weights.iter().all(|&weight| weight >= -ROUNDING);
        held.then(|| tet.iter().zip(weights).map(|(&node, weight)| rest[node as usize] * weight).sum())
    })
}

fn is_in_a_cell(hybrid: &HybridBody, rest_m: DVec3) -> bool {
    let sites = hybrid.partition().sites();
    let cell = sites.cell(sites.cell_near(rest_m));
    let local = (rest_m - sites.cell_m(cell)) / sites.spacing_m();
    // The nearest cell of a point outside the lattice's box does not hold it.
    let in_box = (local - 0.5).abs().max_element() <= 0.5 + ROUNDING;
    in_box && hybrid.partition().cell_at(cell) != NONE
}
