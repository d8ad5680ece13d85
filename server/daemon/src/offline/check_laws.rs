//! What `palpated check` says of laws that bear less the more they are pressed.
use crate::{
    bodies::served,
    strained::{INSTEAD, percent},
};
use palpate_physics::{
    Model, Region,
    material::{Law, stvk},
};
use palpate_scene::Scene;

/// A warning for each material whose law does so, where another could be taken.
pub(super) fn warnings(scene: &Scene, model: &Model) -> Vec<String> {
    if !served(model).takes_any_law() {
        return Vec::new();
    }
    let regions = scene.model.body.solid().map_or(&[][..], |solid| &solid.regions);
    regions.iter().filter_map(warning).collect()
}

fn warning(region: &Region) -> Option<String> {
    let (law, lame) = (region.material.law, region.material.lame);
    let limit = law.weakens_below()?;
    let sideways = stvk::gives_way_sideways_below(lame);
    let sideways = if law == Law::StVenantKirchhoff && sideways > limit {
        format!(
            "; where its sides are held, with Poisson's ratio {:.3} it gives way sideways below {} already",
            lame.poisson_ratio(),
            percent(sideways)
        )
    } else {
        String::new()
    };
    Some(format!(
        "the material \"{}\" has law = \"{}\", which holds until it is pressed to {} of its length, and bears less the more it is pressed \
         below{sideways}. Take law = \"{}\" where a body is pressed: it bears more with all compression",
        region.name,
        law.name(),
        percent(limit),
        INSTEAD.name()
    ))
}
