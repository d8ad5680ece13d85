//! Whether a point is inside the deformed body: asked now and then for a tool that waits to be clear of it.
use glam::{DMat3, DVec3};
use palpate_physics::{
    Model, State,
    contact::is_inside,
    hybrid::{Hybrid, partition::NONE},
};

/// What is looked at.
#[derive(Debug)]
pub struct Inside {
    /// Nodes of the surface's triangles; of a hybrid body, none.
    triangles: Vec<[u32; 3]>,
}

impl Inside {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        let count = if model.hybrid().is_some() { 0 } else { model.surface().triangles.len() };
        Self { triangles: (0..count).map(|triangle| model.surface().triangle_nodes(triangle)).collect() }
    }

    /// Whether a point (m) is inside. Does not allocate.
    ///
    /// Of a hybrid body, its many-vertexed skin is not looked at: the coarse tets, linear between their corners, take the point back to
    /// rest, where it is inside when a cell of the body holds it. That is right to within about a spacing, beyond which a tool touches.
    pub fn holds(&self, model: &Model, state: &State, point_m: DVec3) -> bool {
        match model.hybrid() {
            None => is_inside(point_m, &self.triangles, &state.x),
            Some(hybrid) => at_rest(model, state, point_m).any(|rest_m| is_in_a_cell(hybrid, rest_m)),
        }
    }
}

/// Where a point may be at rest (m): once for every coarse tet that holds it.
fn at_rest<'a>(model: &'a Model, state: &'a State, point_m: DVec3) -> impl Iterator<Item = DVec3> + 'a {
    let rest = model.mesh().positions_m();
    model.mesh().tets().iter().filter_map(move |tet| {
        let [a, b, c, d] = tet.map(|node| state.x[node as usize]);
        let local = DMat3::from_cols(b - a, c - a, d - a).inverse() * (point_m - a);
        let weights = [1.0 - local.element_sum(), local.x, local.y, local.z];
        let held = weights.iter().all(|&weight| weight >= 0.0);
        held.then(|| tet.iter().zip(weights).map(|(&node, weight)| rest[node as usize] * weight).sum())
    })
}

fn is_in_a_cell(hybrid: &Hybrid, rest_m: DVec3) -> bool {
    let sites = hybrid.partition().sites();
    let cell = sites.cell(sites.cell_near(rest_m));
    let local = (rest_m - sites.cell_m(cell)) / sites.spacing_m();
    let in_box = local.cmpge(DVec3::ZERO).all() && local.cmple(DVec3::ONE).all();
    in_box && hybrid.partition().cell_at(cell) != NONE
}
