//! The papers' table of running times (2006, table 1), on this machine: how many of their steps a second their three models make, at rest and
//! pressed. `cargo run --release -p palpate-scene --example seeds`
use glam::DVec3;
use palpate_physics::bodies::seed::{
    AtVertex, PaperModel, SeedContact, SeedModel, SeedParameters, SeedScratch, SeedState,
};
use palpate_scene::shapes::seeds::paper_model;
use std::time::Instant;

const STEPS: u32 = 2000;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("model       tets  particles  awake  steps/s at rest  pressed  printed");
    for (model, printed) in
        [(PaperModel::Ellipsoids, "980"), (PaperModel::FullFem, "35"), (PaperModel::Hybrid, "330 to 600")]
    {
        let built = SeedModel::build(paper_model(model, SeedParameters::paper_2006(model))?)?;
        // Where the most particles wake.
        let triangle = (0..built.regions().len()).max_by_key(|&t| built.regions()[t].len()).unwrap_or(0);
        let corners = built.surface_triangles()[triangle];
        let goals = corners.map(|vertex| {
            let rest = built.surface_rest_m()[vertex as usize];
            AtVertex { vertex, value: rest - rest.normalize_or(DVec3::Z) * 1e-3 }
        });
        let rate = |contact: &SeedContact<'_>| {
            let (mut state, mut scratch) = (SeedState::at_rest(&built), SeedScratch::new(&built));
            let start = Instant::now();
            let mut awake = 0;
            for _ in 0..STEPS {
                awake = built.step(&mut state, &mut scratch, contact).particles_touched;
            }
            (f64::from(STEPS) / start.elapsed().as_secs_f64(), awake)
        };
        let pressed = SeedContact { triangle: Some(triangle as u32), displaced_m: &goals, ..SeedContact::default() };
        let (at_rest, _) = rate(&SeedContact::default());
        let (pressed, awake) = rate(&pressed);
        println!(
            "{:<11} {:>4}  {:>9}  {awake:>5}  {at_rest:>15.0}  {pressed:>7.0}  {printed}",
            format!("{model:?}"),
            built.core().mesh().tets().len(),
            built.layer().map_or(0, palpate_physics::bodies::seed::layer::Layer::particle_count),
        );
    }
    Ok(())
}
