//! Whether a point is inside the deformed body: asked now and then for a tool that waits to be clear of it.
use crate::bodies::served;
use glam::DVec3;
use palpate_physics::{Model, State};

/// What is looked at.
#[derive(Debug)]
pub struct Inside {
    enclosing_triangles: Vec<[u32; 3]>,
}

impl Inside {
    /// For a model.
    pub fn new(model: &Model) -> Self {
        Self { enclosing_triangles: served(model).enclosing_triangles(model) }
    }

    /// Whether a point (m) is inside the body. Does not allocate.
    pub fn holds(&self, model: &Model, state: &State, point_m: DVec3) -> bool {
        served(model).holds(&self.enclosing_triangles, state, point_m)
    }
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
