//! Whether a point is inside the deformed body: asked now and then for a tool that waits to be clear of it.
use glam::{DMat3, DVec3};
use palpate_physics::{
    Model, State, TetMesh,
    bodies::{
        hybrid::{HybridBody, partition::NONE},
        mass_spring::topology::Edge,
    },
    contact::is_inside,
};

/// A point between two tets or cells is in one of them, whatever rounding says.
const ROUNDING: f64 = 1e-9;

/// What is looked at.
#[derive(Debug)]
pub struct Inside {
    /// Nodes of the surface's triangles; of a hybrid body, none, nor of springs on a surface that is open.
    triangles: Vec<[u32; 3]>,
}

impl Inside {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        if let Some(springs) = model.body().as_mass_spring() {
            let surface = springs.model().surface();
            let is_closed = !surface.edges().iter().any(Edge::is_boundary);
            return Self { triangles: if is_closed { surface.triangles().to_vec() } else { Vec::new() } };
        }
        let count = if model.body().as_hybrid().is_some() { 0 } else { model.surface().triangles.len() };
        Self { triangles: (0..count).map(|triangle| model.surface().triangle_nodes(triangle)).collect() }
    }

    /// Whether a point (m) is inside. Does not allocate.
    ///
    /// Of a hybrid body, its many-vertexed skin is not looked at: the coarse tets, linear between their corners, take the point back to
    /// rest, where it is inside when a cell of the body holds it. That is right to within about a spacing, beyond which a tool touches.
    ///
    /// Of springs, it is the surface at rest that is looked at, from which a tool's dent differs by little.
    pub fn holds(&self, model: &Model, state: &State, point_m: DVec3) -> bool {
        if model.body().as_mass_spring().is_some() {
            return is_inside(point_m, &self.triangles, model.rest_positions_m());
        }
        match model.body().as_hybrid() {
            None => is_inside(point_m, &self.triangles, &state.mechanical.x),
            Some(hybrid) => {
                at_rest(hybrid.coarse(), &state.mechanical.x, point_m).any(|rest_m| is_in_a_cell(hybrid, rest_m))
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_scene::{Limits, parse};

    fn model(particles: &str) -> Model {
        let text = format!(
            "[scene]\nname = \"t\"\n[body.ventricle]\nouter_semi_axes_mm = [45, 90]\ninner_semi_axes_mm = [31.5, 76.5]\n\
             cut_z_mm = 22.5\ntarget_tets = 3000\n{particles}\n[[material]]\nlaw = \"stvk\"\nyoung_modulus_pa = 1e4\n\
             poisson_ratio = 0.3\ndensity_kg_per_m3 = 1000\n[[fixed]]\nregion = \"base\"\n"
        );
        Model::build(parse(&text, "t", None, &Limits::local(), &mut |_, _| ()).unwrap().model).unwrap()
    }

    /// A tool was looked for among triangles of surface vertices at the positions of nodes, which are numbered otherwise: of a body
    /// with nodes inside, it was in or out by chance.
    #[test]
    fn walls_hold_what_is_in_them_and_cavities_do_not() {
        for particles in ["", "[body.particles]\nspacing_mm = 4"] {
            let model = model(particles);
            let inside = Inside::new(&model);
            let mut state = State::at_rest(&model);
            let turn = glam::DQuat::from_rotation_y(1.0);
            state.mechanical.x.iter_mut().for_each(|x| *x = turn * *x + DVec3::X);
            let holds = |x: f64, y: f64, z: f64| inside.holds(&model, &state, turn * DVec3::new(x, y, z) + DVec3::X);
            for [x, y, z] in [[0.038, 0.0, 0.0], [0.0, -0.038, 0.01], [0.0, 0.0, -0.083]] {
                assert!(holds(x, y, z), "the wall at {x} {y} {z}, {particles}");
            }
            for [x, y, z] in
                [[0.0, 0.0, 0.0], [0.0, 0.02, -0.04], [0.06, 0.0, 0.0], [0.0, 0.0, -0.1], [0.038, 0.0, 0.04]]
            {
                assert!(!holds(x, y, z), "outside or in the cavity, at {x} {y} {z}, {particles}");
            }
        }
    }
}
