//! Hybrid bodies: coarse tetrahedra, and particles of which those near a contact are awake.
mod held;
mod inside;
mod skin;
mod touch;

use super::{FirstTouch, ServedBody, Shape, ShapeReader, ripple};
use glam::DVec3;
use palpate_physics::{
    Model, Scratch, State,
    bodies::hybrid::{HybridBody, Waking},
    world::wake_only,
};
use palpate_scene::{
    Scene,
    wording::{counted, short},
};
use skin::SkinReader;
use std::sync::Arc;

impl ServedBody for HybridBody {
    fn largest_shape(&self, _model: &Model) -> Shape {
        let most = self.particles().most_active;
        Shape::Lattice(LatticeShape { x: vec![DVec3::ZERO; self.node_count() + most], active: vec![0; most] })
    }

    fn shape_reader(&self, model: &Arc<Model>, rest_f32_m: &[[f32; 3]]) -> Box<dyn ShapeReader> {
        Box::new(SkinReader::new(model, self, rest_f32_m))
    }

    fn enclosing_triangles(&self, _model: &Model) -> Vec<[u32; 3]> {
        Vec::new()
    }

    fn holds(&self, _enclosing_triangles: &[[u32; 3]], state: &State, point_m: DVec3) -> bool {
        inside::holds(self, &state.mechanical.x, point_m)
    }

    fn make_next_tick_the_heaviest(&self, model: &Model, state: &mut State, scratch: &mut Scratch) {
        if state.mechanical.tick == 0 {
            wake_only(model, state, scratch, 0..self.partition().particle_count() as u32);
        }
        // Only at every tenth tick it is asked which particles are to be awake.
        state.mechanical.tick = 1;
    }

    fn wakes_particles_for_tools(&self) -> bool {
        matches!(self.particles().waking, Waking::ByTools { .. })
    }

    fn part_in_whole_cells(&self) -> f64 {
        self.partition().whole_part()
    }

    fn first_touch(&self, scene: &Scene) -> Option<FirstTouch> {
        touch::first_touch(self, scene)
    }

    fn description(&self, model: &Model) -> Vec<String> {
        let (spec, partition, embedding) = (self.particles(), self.partition(), self.embedding());
        let mut lines = vec![format!(
            "particles  {}, {} mm apart, at most {} awake; skin of {}",
            partition.particle_count(),
            short(spec.spacing_m * 1e3),
            spec.most_active,
            counted(spec.skin.triangles().len(), "triangle")
        )];
        if let Some(depth_m) = spec.fine_depth_m {
            let doubled = partition.cells().iter().filter(|cell| cell.doubled).count();
            lines.push(format!(
                "           {} mm apart deeper than {} mm ({doubled} of {})",
                short(spec.spacing_m * 2e3),
                short(depth_m * 1e3),
                counted(partition.cells().len(), "cell")
            ));
        }
        if let Waking::ByTools { reach_m } = spec.waking {
            lines.push(format!("           those within {} mm of a tool's contact wake", short(reach_m * 1e3)));
        }
        lines.push(format!(
            "           the coarse tets' surface was moved by up to {} mm to hold them{}",
            short(embedding.moved_m * 1e3),
            if embedding.outside == 0 { ", and none is outside" } else { "" }
        ));
        lines.extend(self.remarks().iter().map(|remark| format!("           {remark}")));
        lines.push(format!(
            "           coarse level of {}; {:.0} % of the volume is in whole cells, the surface cuts the others",
            counted(self.node_count(), "node"),
            100.0 * partition.whole_part()
        ));
        lines.extend(ripple::told(model, spec));
        lines
    }

    /// Particles outside the coarse tets, where they are so few that it is no warning.
    fn remarks(&self) -> Vec<String> {
        outside(self).filter(|_| !many_are_outside(self)).into_iter().collect()
    }

    fn warnings(&self, model: &Model) -> Vec<String> {
        /// Of the volume in whole cells: less is a lattice that hardly sees the body.
        const FEW_WHOLE: f64 = 0.2;
        let (spec, partition) = (self.particles(), self.partition());
        let mut warnings = Vec::new();
        if partition.whole_part() < FEW_WHOLE {
            warnings.push(format!(
                "only {:.0} % of the volume is in whole cells: particles {} mm apart are coarse for this body; lower their spacing in [body.particles]",
                100.0 * partition.whole_part(),
                short(spec.spacing_m * 1e3)
            ));
        }
        if many_are_outside(self) {
            warnings.extend(
                outside(self).map(|outside| format!("{outside}; ask for more tets, or hold less of the surface")),
            );
        }
        if spec.fine_depth_m.is_some() && !partition.cells().iter().any(|cell| cell.doubled) {
            warnings.push(
                "fine depth in [body.particles]: no cell is of twice the spacing, the body is too thin for any deeper down; leave the key out"
                    .to_owned(),
            );
        }
        warnings.extend(held::warnings(model, self));
        warnings.extend(ripple::warning(model, spec));
        warnings
    }
}

/// Whether so many particles are outside the coarse tets that it is a warning.
fn many_are_outside(body: &HybridBody) -> bool {
    /// Of all particles.
    const MANY: f64 = 0.1;
    body.embedding().outside as f64 > MANY * body.partition().particle_count() as f64
}

/// Says which particles are outside the coarse tets, and what becomes of it; `None` where none is.
fn outside(body: &HybridBody) -> Option<String> {
    let embedding = body.embedding();
    let [low, high] = embedding.outside_m.map(|corner_m| {
        let [x, y, z] = (corner_m * 1e3).to_array().map(short);
        format!("({x}, {y}, {z})")
    });
    (embedding.outside > 0).then(|| {
        format!(
            "{} of {} particles, between {low} and {high} mm, are outside the coarse tets, whose surface cannot be moved further there, as where it is \
             held: they never wake, and there the body answers as coarsely as its tets",
            embedding.outside,
            body.partition().particle_count()
        )
    })
}

/// What the skin of a hybrid body follows.
#[derive(Debug, Clone, PartialEq)]
pub struct LatticeShape {
    /// Positions (m) of coarse nodes and then of active particles.
    pub x: Vec<DVec3>,
    /// Active particles, ascending.
    pub active: Vec<u32>,
}

impl LatticeShape {
    pub(super) fn fill(&mut self, state: &State) {
        self.x.clone_from(&state.mechanical.x);
        self.active.clear();
        self.active.extend_from_slice(state.body.active_particles());
    }

    pub(super) fn particles_m(&self) -> &[DVec3] {
        &self.x[self.x.len() - self.active.len()..]
    }
}
