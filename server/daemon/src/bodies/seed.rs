//! The papers' own hybrid.
use super::{
    ServedBody, Shape, ShapeReader,
    tet::{NodeReader, NodeShape},
};
use palpate_physics::{
    Model, Scratch, State,
    bodies::seed::{SeedBody, region::Region},
};
use palpate_scene::wording::{counted, short};
use std::sync::Arc;

impl ServedBody for SeedBody {
    fn largest_shape(&self, model: &Model) -> Shape {
        Shape::Nodes(NodeShape::largest(model))
    }

    fn shape_reader(&self, _model: &Arc<Model>, rest_f32_m: &[[f32; 3]]) -> Box<dyn ShapeReader> {
        Box::new(NodeReader::new(rest_f32_m))
    }

    /// As if the triangle were touched under which the most particles are.
    fn make_next_tick_the_heaviest(&self, _model: &Model, state: &mut State, _scratch: &mut Scratch) {
        if let Some(own) = state.body.as_seed_mut() {
            own.touched = self.model().largest_region();
        }
    }

    /// The papers have one.
    fn takes_any_law(&self) -> bool {
        false
    }

    fn description(&self, _: &Model) -> Vec<String> {
        let seed = self.model();
        let parameters = seed.parameters();
        let mut lines = vec![
            format!("seed       the papers' own hybrid; steps of {} ms", short(parameters.dt_s * 1e3)),
            "           its law, \"stvk\", bears less the more it is pressed below 58 % of its length, and does not resist inversion".to_owned(),
        ];
        if let Some(layer) = seed.layer() {
            let spacing_m = layer.voxels.spacing_m;
            let sizes = seed.regions().iter().map(Region::len);
            lines.push(format!(
                "particles  {}, {} mm apart; {} to {} awake, {:.0} on average over {}",
                layer.particle_count(),
                short(spacing_m * 1e3),
                sizes.clone().min().unwrap_or_default(),
                seed.most_awake(),
                sizes.sum::<usize>() as f64 / seed.regions().len() as f64,
                counted(seed.regions().len(), "triangle")
            ));
            lines.push(format!(
                "           waves cross a spacing in {} ms, by the papers' formula in {} ms",
                short(parameters.courant_s(spacing_m) * 1e3),
                short(parameters.courant_as_printed_s(spacing_m) * 1e3)
            ));
        }
        lines
    }

    fn no_equilibrium(&self, scene: &str) -> Option<miette::Report> {
        Some(miette::miette!(
            help = "let `palpated simulate` come to rest, or put [body.particles] in place of [body.seed]: that hybrid's equilibrium is solved for",
            "\"{scene}\" is the papers' hybrid, whose forces have no equilibrium that is solved for"
        ))
    }
}
