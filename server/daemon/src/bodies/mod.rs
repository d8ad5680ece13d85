//! The kinds of body as the daemon serves them: what the loop hands over of each, how the hub makes vertices of it, what `palpated check`
//! says about it.
//!
//! What physics answers for all kinds ([`palpate_physics::bodies::Body`]) is not asked again here. A kind is one file with one
//! `impl ServedBody`, and one line of [`served`]; nowhere else does the daemon ask which kind a body is.
mod hybrid;
mod locking;
mod mass_spring;
mod ripple;
mod seed;
mod shape;
mod tet;

pub use shape::{Shape, ShapeReader};

use glam::DVec3;
use palpate_physics::{
    Body, Model, Scratch, State,
    contact::{ToolTarget, is_inside},
};
use palpate_scene::Scene;
use std::sync::Arc;

/// Where a tool touches a body at rest first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FirstTouch {
    /// The tool as it just touches the skin.
    pub touching: ToolTarget,
    /// Outward unit normal of the skin there.
    pub outward: DVec3,
    /// Radius (m) of the tool.
    pub radius_m: f64,
}

impl FirstTouch {
    /// Returns the tool as many of its radii above the skin, or in it where that is less than 0, and aside by this (m).
    pub fn at(&self, radii_above: f64, aside_m: DVec3) -> ToolTarget {
        let position_m = self.touching.position_m + self.outward * (radii_above * self.radius_m) + aside_m;
        ToolTarget { position_m, ..self.touching }
    }
}

/// What the daemon asks of a kind of body.
pub trait ServedBody {
    /// A shape filled to the most that it will ever hold: copies of it then have that room, too.
    fn largest_shape(&self, model: &Model) -> Shape;

    /// What makes vertices of such shapes, for viewers that know each vertex's rest position as `rest_f32_m` (m).
    fn shape_reader(&self, model: &Arc<Model>, rest_f32_m: &[[f32; 3]]) -> Box<dyn ShapeReader>;

    /// Whether viewers may be shown the surface refined by Loop's scheme near tools.
    fn may_be_refined_for_viewers(&self) -> bool {
        true
    }

    /// Triangles of nodes that enclose the body, for [`Self::holds`]; none where it looks at something else, or where nothing is enclosed.
    fn enclosing_triangles(&self, model: &Model) -> Vec<[u32; 3]> {
        (0..model.surface().triangles.len()).map(|triangle| model.surface().triangle_nodes(triangle)).collect()
    }

    /// Whether a point (m) is inside the deformed body. Does not allocate.
    fn holds(&self, enclosing_triangles: &[[u32; 3]], state: &State, point_m: DVec3) -> bool {
        is_inside(point_m, enclosing_triangles, &state.mechanical.x)
    }

    /// Brings a state to where its next tick costs the most: with as much awake as may be at once.
    fn make_next_tick_the_heaviest(&self, _model: &Model, _state: &mut State, _scratch: &mut Scratch) {}

    /// Whether particles wake around the contacts of tools, by the model's own choice.
    fn wakes_particles_for_tools(&self) -> bool {
        false
    }

    /// Where the first tool of a scene would touch the body first, and wake particles; `None` where it wakes none.
    fn first_touch(&self, _scene: &Scene) -> Option<FirstTouch> {
        None
    }

    /// The part of its volume that is in whole cells of a lattice, 1 for a body without one: little is a lattice that hardly sees the body.
    fn part_in_whole_cells(&self) -> f64 {
        1.0
    }

    /// Whether a scene may give it any law of material.
    fn takes_any_law(&self) -> bool {
        true
    }

    /// Lines that `palpated check` prints of what is particular to the kind.
    fn description(&self, _model: &Model) -> Vec<String> {
        Vec::new()
    }

    /// What every command tells of the body that is no fault of it.
    fn remarks(&self) -> Vec<String> {
        Vec::new()
    }

    /// What one would want to change about the body.
    fn warnings(&self, _model: &Model) -> Vec<String> {
        Vec::new()
    }

    /// Why `palpated static` refuses the body; `None` where its equilibrium is solved for.
    fn no_equilibrium(&self, _scene: &str) -> Option<miette::Report> {
        None
    }
}

/// A model's body as the daemon serves it.
pub fn served(model: &Model) -> &dyn ServedBody {
    match model.body() {
        Body::Tet(body) => &**body,
        Body::Hybrid(body) => &**body,
        Body::MassSpring(body) => &**body,
        Body::Seed(body) => &**body,
    }
}
