//! Mass-spring surfaces. The loop hands over awake nodes and levels; where the surface refined everywhere is, is worked out beside the loop.
//! Viewers always see the same triangles.
use super::{
    ServedBody, Shape, ShapeReader,
    shape::{double, single},
};
use glam::DVec3;
use palpate_physics::{
    Model, State,
    bodies::mass_spring::{MassSpringBody, Refinement, SpringMotion, region::Constants},
    contact::is_inside,
};
use palpate_scene::wording::{counted, short};
use std::sync::Arc;

impl ServedBody for MassSpringBody {
    fn largest_shape(&self, _model: &Model) -> Shape {
        let springs = self.model();
        let x = vec![DVec3::ZERO; springs.most_nodes()];
        Shape::Springs(SpringShape { motion: SpringMotion::filled(springs), x })
    }

    fn shape_reader(&self, model: &Arc<Model>, rest_f32_m: &[[f32; 3]]) -> Box<dyn ShapeReader> {
        Box::new(SpringReader::new(model, self, rest_f32_m))
    }

    /// They see it refined already.
    fn may_be_refined_for_viewers(&self) -> bool {
        false
    }

    /// None of a surface that is open.
    fn enclosing_triangles(&self, _model: &Model) -> Vec<[u32; 3]> {
        let surface = self.model().surface();
        if surface.is_closed() { surface.triangles().to_vec() } else { Vec::new() }
    }

    /// Looks at the surface at rest, from which a tool's dent differs by little.
    fn holds(&self, enclosing_triangles: &[[u32; 3]], _state: &State, point_m: DVec3) -> bool {
        is_inside(point_m, enclosing_triangles, self.rest_positions_m())
    }

    fn description(&self, _: &Model) -> Vec<String> {
        let spec = self.model().spec();
        let of = |constants: &Constants| {
            format!("K_m {} N/m, K_h {} N/m", short(constants.mesh_n_per_m), short(constants.anchor_n_per_m))
        };
        let coarse = of(&spec.coarse);
        let refined = match self.refinement() {
            None => "coarse everywhere".to_owned(),
            Some(Refinement { rings, blend_s, .. }) => format!(
                "{} around what is touched are refined within {} s: at most {}",
                counted(rings as usize, "ring"),
                short(blend_s),
                of(&spec.fine)
            ),
        };
        let awake = if self.is_all_awake() {
            "all vertices are awake always".to_owned()
        } else {
            format!("the {} vertices nearest to tools are awake", spec.most_awake)
        };
        vec![
            format!("springs    {coarse}; edges {} mm long in the mean", short(self.edge_m() * 1e3)),
            format!("           {refined}"),
            format!("           {awake}"),
        ]
    }

    fn no_equilibrium(&self, _scene: &str) -> Option<miette::Report> {
        Some(miette::miette!(
            help = "let `palpated simulate` come to rest",
            "the equilibrium of a mass-spring surface is not solved for"
        ))
    }
}

/// Where a mass-spring surface is.
#[derive(Debug, Clone, PartialEq)]
pub struct SpringShape {
    /// Awake nodes and levels.
    pub motion: SpringMotion,
    /// Positions (m) of the awake nodes.
    pub x: Vec<DVec3>,
}

impl SpringShape {
    pub(super) fn fill(&mut self, state: &State) {
        if let Some(springs) = state.body.as_mass_spring() {
            self.x.clone_from(&state.mechanical.x);
            self.motion.copy_from(&springs.motion);
        }
    }
}

/// Displacements of the vertices of the surface refined everywhere.
#[derive(Debug)]
struct SpringReader {
    model: Arc<Model>,
    /// Rest position less the one that viewers have (m), of every vertex.
    rounding_m: Vec<[f32; 3]>,
    /// Displacement (m) of every node, 0 of those that sleep.
    moved_m: Vec<DVec3>,
    /// Nodes and vertices that were moved in the last frame.
    moved: Vec<u32>,
    displacements_m: Vec<[f32; 3]>,
}

impl SpringReader {
    fn new(model: &Arc<Model>, body: &MassSpringBody, rest_f32_m: &[[f32; 3]]) -> Self {
        let rounding = |(rest, rest_f32): (&DVec3, &[f32; 3])| single(*rest - double(*rest_f32));
        let rounding_m: Vec<[f32; 3]> = body.model().rest_m().iter().zip(rest_f32_m).map(rounding).collect();
        Self {
            model: Arc::clone(model),
            displacements_m: rounding_m.clone(),
            moved_m: vec![DVec3::ZERO; rounding_m.len()],
            moved: Vec::new(),
            rounding_m,
        }
    }
}

impl ShapeReader for SpringReader {
    fn read(&mut self, shape: &Shape) -> f64 {
        let (Shape::Springs(SpringShape { motion, x }), Some(body)) = (shape, self.model.body().as_mass_spring())
        else {
            return 0.0;
        };
        let (model, rest_m) = (body.model(), body.model().rest_m());
        for node in self.moved.drain(..) {
            self.moved_m[node as usize] = DVec3::ZERO;
            self.displacements_m[node as usize] = self.rounding_m[node as usize];
        }
        for (&node, x) in motion.ids.iter().zip(x) {
            self.moved_m[node as usize] = *x - rest_m[node as usize];
        }
        let vertices = motion.ids.iter().copied().take_while(|node| *node < model.vertices());
        let mut largest_sq = 0.0_f64;
        for vertex in vertices {
            let moved_m = self.moved_m[vertex as usize];
            largest_sq = largest_sq.max(moved_m.length_squared());
            self.displacements_m[vertex as usize] = sum(self.rounding_m[vertex as usize], moved_m);
            self.moved.push(vertex);
            for &edge in model.surface().edges_at(vertex) {
                let other = model.surface().other_end(edge, vertex);
                let middle = (model.vertices() + edge) as usize;
                let level = motion.levels.of_edge(model.surface(), edge);
                let of_ends_m = (moved_m + self.moved_m[other as usize]) * 0.5;
                let moved_m = self.moved_m[middle] * level + of_ends_m * (1.0 - level);
                largest_sq = largest_sq.max(moved_m.length_squared());
                self.displacements_m[middle] = sum(self.rounding_m[middle], moved_m);
                self.moved.push(middle as u32);
            }
        }
        largest_sq.sqrt()
    }

    fn displacements_m(&self) -> &[[f32; 3]] {
        &self.displacements_m
    }
}

fn sum(rounding_m: [f32; 3], moved_m: DVec3) -> [f32; 3] {
    single(double(rounding_m) + moved_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{bodies::served, stream::keyframe::rest_positions_f32};
    use palpate_physics::{Scratch, State, TickInput, contact::ToolTarget, step};
    use palpate_scene::{Limits, parse};

    /// While a tool presses, refines, and leaves: every vertex is where the model says, in every frame.
    #[test]
    fn viewers_see_the_surface_of_the_model() {
        let text = "[scene]\nname = \"t\"\n[body.sphere_shell]\ninner_radius_mm = 30\nouter_radius_mm = 40\ntarget_tets = 3000\n\
            [body.springs]\npart = \"outer\"\nmesh_n_per_m = 60\nanchor_n_per_m = 12\nvertex_mass_kg = 2e-4\ndamping_n_s_per_m = 0.02\nmost_awake = 150\n\
            [body.springs.refine]\nrings = 2\nconstants = \"area\"\n\
            [[tool]]\nname = \"tip\"\nradius_mm = 5\ncoupling = \"rigid\"\ndriver = \"device\"\nstart_m = [0, 0, 0.05]\n";
        let scene = parse(text, "t", None, &Limits::local(), &mut |_, _| ()).unwrap();
        let model = Arc::new(Model::build(scene.model).unwrap());
        let rest_f32_m = rest_positions_f32(&model);
        let mut reader = served(&model).shape_reader(&model, &rest_f32_m);
        let mut shape = served(&model).largest_shape(&model);
        let (mut state, mut scratch) = (State::at_rest(&model), Scratch::new(&model));
        let (mut expected_m, mut refined) = (Vec::new(), 0);
        for tick in 0..900 {
            let height_m = if tick < 500 { 0.05 - 4e-5 * f64::from(tick).min(200.0) } else { 0.08 };
            let target = ToolTarget::at(DVec3::Z * height_m);
            let input =
                TickInput { tools: &[target], load_factors: &[], prescribed_displacements_m: &[], point_forces: &[] };
            step(&model, &mut state, &mut scratch, &input);
            if tick % 30 == 0 {
                let springs = state.body.as_mass_spring().unwrap();
                refined = refined.max(springs.refined_nodes(model.body().as_mass_spring().unwrap()));
                shape.fill(&model, &state);
                let largest_m = reader.read(&shape);
                model.surface_positions_m(&state, &mut expected_m);
                let found = reader.displacements_m().iter().zip(&rest_f32_m);
                let mut farthest_m = 0.0_f64;
                for ((found, rest_f32), expected) in found.zip(&expected_m) {
                    let place = DVec3::from(found.map(f64::from)) + DVec3::from(rest_f32.map(f64::from));
                    assert!(place.distance(*expected) < 1e-9, "tick {tick}: {place} {expected}");
                    farthest_m = farthest_m.max(DVec3::from(found.map(f64::from)).length());
                }
                assert!((largest_m - farthest_m).abs() < 1e-8);
            }
        }
        assert!(refined > 30, "{refined}");
    }
}
